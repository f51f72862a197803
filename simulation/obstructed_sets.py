"""Sets of photos of one sheet in which each photo hides something else."""

from dataclasses import replace
from typing import Literal, get_args

import cv2
import numpy as np
from numpy.typing import NDArray

from simulation.degradation import PHONE, RgbImage, degrade
from simulation.flat_page import Page, Points
from simulation.mosaic_sets import photograph_set
from simulation.obstructions import (
    Finger,
    Lamp,
    ObstructedPhoto,
    Obstructions,
    Shadow,
    lamp_for,
    lost_contrast,
    mirror_image,
    obstruct,
)
from simulation.scenes import View
from simulation.sheets import Staging, take_photo
from simulation.surfaces import Shape
from simulation.truth import Truth

Kind = Literal["glare", "shadow", "finger", "blur", "all"]
KINDS: tuple[Kind, ...] = get_args(Kind)
SIZE = (1500, 2000)

_SHARES = (0.6, 1.6)
"""Glare of a single photo over the wanted share: one lamp is seen by all of them."""
_MOST_COMMON = 0.1
"""Of the sheet's glare, what two photos may have in common: they hide different places."""
_TRIES = 400
_GRID = 60
"""Points across the sheet at which glare is counted."""
_MOTION_PX = 9.0
_OUT_OF_FOCUS_PX = 3.5
_CLEAN = replace(PHONE, shadow=0.0)


def photograph_whole_views(
    sheet: Page, shape: Shape, count: int, kind: Kind, rng: np.random.Generator, share: float = 0.05
) -> tuple[ObstructedPhoto, ...]:
    """`count` photos that each show the whole sheet from another side.

    Glare is the image of one lamp; it hides about `share` of the sheet in each photo, in different places.

    Raises
    ------
    ValueError
        When no lamp is found.
    """
    for _ in range(_TRIES):
        truths = _draw_views(sheet, shape, count, rng)
        if kind not in {"glare", "all"}:
            return _take(truths, kind, [None] * count, rng)
        lamp = _draw_lamp(truths, share, rng)
        if lamp is not None:
            return _take(truths, kind, [lamp] * count, rng)
    raise ValueError("no lamp is mirrored at different places of all photos")


def photograph_parts(
    page: Page, shape: Shape, kind: Kind, rng: np.random.Generator, overlap: float = 0.4
) -> tuple[ObstructedPhoto, ...]:
    """Four photos of parts of the page, each under its own lamp where there is glare (as on a phone)."""
    made = photograph_set(page, 4, overlap, rng, shape=shape)
    truths = [photo.truth for photo in made.photos]
    lamps: list[Lamp | None] = [None] * len(truths)
    if kind in {"glare", "all"}:
        lamps = [lamp_for(truth, _target(truth, rng), rng.uniform(2.0, 3.5), 0.15) for truth in truths]
    return _take(truths, kind, lamps, rng)


def _draw_views(sheet: Page, shape: Shape, count: int, rng: np.random.Generator) -> list[Truth]:
    """Poses that lean into directions spread over the whole turn, by one camera."""
    focal_length_px = rng.uniform(2200, 3000)
    first = rng.uniform(0, 360)
    truths = []
    for number in range(count):
        azimuth = first + 360 * (number + rng.uniform(-0.2, 0.2)) / count
        view = View(str(number), focal_length_px, rng.uniform(8, 24), azimuth, rng.uniform(-8, 8))
        camera = view.camera(*SIZE)
        truths.append(Truth(sheet, shape, 0.0, view.pose(sheet, shape, camera, 0.04), camera))
    return truths


def _draw_lamp(truths: list[Truth], share: float, rng: np.random.Generator) -> Lamp | None:
    """A lamp with such a radius that its images hide `share` of the sheet on average; None where none is found."""
    for _ in range(20):
        target = _target(truths[0], rng)
        away = rng.uniform(2.5, 4.5)
        low, high = 0.02, 1.5
        for _ in range(7):
            lamp = lamp_for(truths[0], target, away, (low + high) / 2)
            hidden = np.array([_hidden(truth, lamp) for truth in truths])
            low, high = (lamp.radius, high) if hidden.mean() < share else (low, lamp.radius)
        shares = hidden.mean(axis=1) / share
        common = hidden.astype(int) @ hidden.T.astype(int)
        np.fill_diagonal(common, 0)
        apart = common.max() <= _MOST_COMMON * hidden.sum(axis=1).min()
        if apart and shares.min() > _SHARES[0] and shares.max() < _SHARES[1]:
            return lamp
    return None


def _hidden(truth: Truth, lamp: Lamp) -> NDArray[np.bool_]:
    """At which points of a grid over the sheet the photo shows no print for the lamp's image."""
    seen = truth.sheet_to_photo(_sheet_grid(truth.page))
    level = mirror_image(truth, lamp)
    nodes = np.round((seen + 0.5) / 8 - 0.5 + 2).astype(int)
    rows, columns = level.values.shape[:2]
    x, y = np.clip(nodes[:, 0], 0, columns - 1), np.clip(nodes[:, 1], 0, rows - 1)
    return np.asarray(lost_contrast(level.values[y, x, 0]) > 0.5)


def _sheet_grid(page: Page) -> Points:
    rows = round(_GRID * page.half_height_units)
    x = (np.arange(_GRID) + 0.5) / _GRID * 2 - 1
    y = ((np.arange(rows) + 0.5) / rows * 2 - 1) * page.half_height_units
    return np.asarray(np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2), np.float64)


def _target(truth: Truth, rng: np.random.Generator) -> tuple[float, float]:
    """A sheet point well within what the photo shows."""
    place = rng.uniform(0.25, 0.75, 2) * (truth.camera.width, truth.camera.height)
    sheet = truth.photo_to_sheet(place[None])[0]
    limit = 0.8 * np.array([1.0, truth.page.half_height_units])
    x, y = np.clip(np.nan_to_num(sheet), -limit, limit)
    return float(x), float(y)


def _take(
    truths: list[Truth], kind: Kind, lamps: list[Lamp | None], rng: np.random.Generator
) -> tuple[ObstructedPhoto, ...]:
    """The photos, with the dirt of a phone's camera."""
    photos = []
    for number, (truth, lamp) in enumerate(zip(truths, lamps, strict=True)):
        staging = Staging(lamp_deg=rng.uniform(0, 360), exposure=rng.uniform(0.62, 0.85), close=True)
        shadow = _draw_shadow(truth, rng) if kind in {"shadow", "all"} else None
        fingers = (_draw_finger(truth, rng),) if kind in {"finger", "all"} else ()
        clean = take_photo(truth, staging, None, rng)
        made = obstruct(clean, Obstructions(lamp, shadow, fingers))
        image, dirt = made.image, _CLEAN
        if kind == "blur" and number == 0:
            dirt = replace(dirt, motion_px=_MOTION_PX)
        elif kind == "blur" and number == 1:
            image = _out_of_focus(image, rng)
        photos.append(replace(made, image=degrade(image, dirt, rng)))
    return tuple(photos)


def _draw_shadow(truth: Truth, rng: np.random.Generator) -> Shadow:
    """Of a phone and the arm that holds it, over what the photo shows."""
    return Shadow(
        _target(truth, rng),
        (float(rng.uniform(0.2, 0.35)), float(rng.uniform(0.4, 0.9))),
        float(rng.uniform(0, np.pi)),
        float(rng.uniform(0.35, 0.6)),
        float(rng.uniform(0.015, 0.06)),
    )


def _draw_finger(truth: Truth, rng: np.random.Generator) -> Finger:
    """From one of the sheet's long sides inward, far enough to lie on print."""
    half = truth.page.half_height_units
    side = float(rng.choice([-1.0, 1.0]))
    down = float(rng.uniform(-0.7, 0.7)) * half
    tip = (side * float(rng.uniform(0.55, 0.75)), down)
    return Finger((side * 1.3, down + float(rng.uniform(-0.25, 0.25))), tip)


def _out_of_focus(image: RgbImage, rng: np.random.Generator) -> RgbImage:
    """The photo, blurred towards one of its sides."""
    height, width = image.shape[:2]
    angle = rng.uniform(0, 2 * np.pi)
    x, y = np.linspace(-1, 1, width, dtype=np.float32), np.linspace(-1, 1, height, dtype=np.float32)
    share = np.clip(0.5 + np.cos(angle) * x + np.sin(angle) * y[:, None], 0, 1).astype(np.float32)[..., None]
    soft = cv2.GaussianBlur(image, (0, 0), _OUT_OF_FOCUS_PX).astype(np.float32)
    return np.asarray(np.clip(image + share * (soft - image) + 0.5, 0, 255), np.uint8)

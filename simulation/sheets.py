"""Photos of a whole sheet that lies on something, under light from one side."""

import itertools
from dataclasses import dataclass, replace
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from simulation.camera import Camera, Pose
from simulation.degradation import Degradation, RgbImage, degrade, desk_texture
from simulation.flat_page import Page, PageWord
from simulation.photo import Light, SimulatedPhoto, lambertian, simulate_photo
from simulation.scenes import PHOTO_SIZE, View
from simulation.surfaces import Shape
from simulation.truth import Truth

Ground = Literal["black", "desk", "white"]

SHEET_VIEWS = (
    View("1", 2300.0, 8.0, 80.0, -3.0),
    View("2", 2700.0, 15.0, 250.0, 5.0),
    View("3", 2100.0, 20.0, 150.0, 8.0),
    View("4", 2500.0, 25.0, 20.0, -7.0),
    View("5", 2400.0, 12.0, 320.0, 2.0),
    View("6", 2900.0, 22.0, 95.0, -10.0),
)
"""How one holds a phone over a sheet on a desk: tilts up to 25 degrees."""

SHEET_ASPECT = float(np.sqrt(2.0))
"""Of an ISO 216 sheet."""


@dataclass(frozen=True, slots=True)
class Staging:
    """What a sheet lies on, how it is lit and framed.

    ground: "black" as in the dissertation, a wooden "desk", or something as "white" as the sheet.
    lamp_deg: direction in the photo, clockwise from its right, from where the light comes.
    lamp_height_deg: of the lamp over the photo's plane; 90 is along the optical axis.
    ambient: share of the light that does not come from the lamp.
    exposure: brightness of white paper that faces the camera; paper that faces the lamp is brighter.
    shadow: share of the light that the sheet takes from the ground beside it; 0 on "black".
    margin: ground on each side of the sheet, a share of the photo.
    close: held so near that no side of the sheet is in view; `margin` then says nothing.
    """

    ground: Ground = "desk"
    lamp_deg: float = 200.0
    lamp_height_deg: float = 45.0
    ambient: float = 0.6
    exposure: float = 0.85
    shadow: float = 0.45
    margin: float = 0.05
    close: bool = False

    def lights(self) -> tuple[Light, Light]:
        """The lamp, and light from all sides, which is as if it came along the optical axis."""
        lamp = np.radians(self.lamp_deg)
        height = np.radians(self.lamp_height_deg)
        flat = -np.cos(height)
        direction = (float(flat * np.cos(lamp)), float(flat * np.sin(lamp)), float(np.sin(height)))
        lamp_share = (1.0 - self.ambient) / float(np.sin(height))
        return (
            Light((0.0, 0.0, 1.0), self.exposure * self.ambient),
            Light(direction, self.exposure * lamp_share),
        )


def with_margins(page: Page, share: float = 0.12, aspect: float | None = SHEET_ASPECT) -> Page:
    """The print of `page` in the middle of a sheet: white at each side, `share` of the sheet's width.

    With an `aspect` (height over width) the sheet is made as high as that, or wider where the print is high.
    """
    width = round(page.width / (1.0 - 2.0 * share))
    least = page.height + (width - page.width)
    height = least if aspect is None else round(width * aspect)
    if height < least and aspect is not None:
        height, width = least, round(least / aspect)
    left, top = (width - page.width) // 2, (height - page.height) // 2
    image = np.full((height, width, *page.image.shape[2:]), page.paper, np.uint8)
    image[top : top + page.height, left : left + page.width] = page.image
    lines = tuple(tuple(_moved(word, left, top) for word in line) for line in page.lines)
    return Page(image, lines, page.dpi, page.paper, page.name)


def photograph_sheet(
    sheet: Page,
    view: View,
    shape: Shape,
    staging: Staging,
    *,
    dirt: Degradation | None = None,
    rng: np.random.Generator,
    skew_rad: float = 0.0,
    size: tuple[int, int] = PHOTO_SIZE,
) -> SimulatedPhoto:
    """A photo (size: width, height) of the whole sheet, with `dirt` if any; ground and dirt are drawn from `rng`.

    Raises
    ------
    ValueError
        When the shape hides part of itself in this view.
    """
    camera = view.camera(*size)
    pose = view.pose(sheet, shape, camera, staging.margin)
    if staging.close:
        pose = _close_pose(sheet, view, shape, camera)
    return take_photo(Truth(sheet, shape, skew_rad, pose, camera), staging, dirt, rng)


def take_photo(
    truth: Truth, staging: Staging, dirt: Degradation | None, rng: np.random.Generator
) -> SimulatedPhoto:
    """The photo of what `truth` tells, on its ground and under its lamp.

    Raises
    ------
    ValueError
        When the shape hides part of itself and is not `staging.close`.
    """
    photo = simulate_photo(
        truth.page, truth.shape, truth.skew_rad, truth.pose, truth.camera,
        lights=staging.lights(), background=_ground(staging, truth, rng), close_up=staging.close,
    )  # fmt: skip
    image = photo.image if dirt is None else degrade(photo.image, dirt, rng)
    return SimulatedPhoto(image, truth)


def _close_pose(sheet: Page, view: View, shape: Shape, camera: Camera) -> Pose:
    """The farthest pose, in steps of 2 %, from which no side of the sheet is seen."""
    limit = np.array([camera.width, camera.height]) - 0.5
    pose = view.pose(sheet, shape, camera, 0.0)
    for _ in range(60):
        x, y, away = (0.98 * part for part in pose.translation)
        pose = replace(pose, translation=(x, y, away))
        outline = Truth(sheet, shape, 0.0, pose, camera).outline(200)
        if not np.any(np.all((outline > -0.5) & (outline < limit), axis=1)):
            break
    return pose


def _ground(staging: Staging, truth: Truth, rng: np.random.Generator) -> RgbImage:
    width, height = truth.camera.width, truth.camera.height
    if staging.ground == "black":
        return np.zeros((height, width, 3), np.uint8)
    if staging.ground == "desk":
        ground = desk_texture(width, height, rng)
    else:
        # A table under the same lamp; what is white differs by a trifle.
        bright = float(lambertian(truth.pose.rotation()[:, 2][None], staging.lights())[0])
        ground = np.full(
            (height, width, 3), round(bright * truth.page.paper * rng.uniform(0.97, 1.0)), np.uint8
        )
    light = 1.0 - np.float32(staging.shadow) * _cast_shadow(truth, staging)
    return np.asarray(np.clip(ground * light[..., None] + 0.5, 0, 255), np.uint8)


def _cast_shadow(truth: Truth, staging: Staging) -> NDArray[np.float32]:
    """(H, W) 0-1: how much of the lamp the sheet hides from the plane that it lies on."""
    edge = np.array([1.0, truth.page.half_height_units])
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]]) * edge
    steps = np.linspace(0, 1, 40, endpoint=False)[:, None]
    outline = np.concatenate([a + steps * (b - a) for a, b in itertools.pairwise(corners)])
    placed = truth.shape.place(outline)
    lamp = np.array(staging.lights()[1].direction) @ truth.pose.rotation()
    # The lowest point of the sheet's edge touches the ground; a little lift, as no sheet lies quite flat.
    drop = placed[:, 2].max() + 0.01 - placed[:, 2]
    fallen = placed + drop[:, None] * (lamp / max(float(lamp[2]), 0.2))
    seen = truth.camera.project(truth.pose.to_camera(fallen))
    width, height = truth.camera.width, truth.camera.height
    # At a quarter of the size: it is soft.
    small = np.zeros((-(-height // 4), -(-width // 4)), np.float32)
    cv2.fillPoly(small, [np.round(np.nan_to_num(seen) / 4.0).astype(np.int32)], 1.0)
    soft = cv2.GaussianBlur(small, (0, 0), 0.006 * float(np.hypot(*small.shape)))
    return np.asarray(cv2.resize(soft, (width, height), interpolation=cv2.INTER_LINEAR), np.float32)


def _moved(word: PageWord, left: float, top: float) -> PageWord:
    x0, y0, x1, y1 = word.box
    return PageWord(word.text, (x0 + left, y0 + top, x1 + left, y1 + top))

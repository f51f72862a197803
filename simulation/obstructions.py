"""What hides print from one photo and not from the next: a lamp's mirror image, a cast shadow, a finger."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from simulation.degradation import RgbImage
from simulation.flat_page import Points
from simulation.photo import SimulatedPhoto
from simulation.surfaces import Points3
from simulation.truth import Lattice, Truth

FloatImage = NDArray[np.float32]
"""(H, W) float32."""

PAPER_AND_INK = (205.0, 50.0)
"""Gray levels of the paper and the print whose contrast a mirror image takes, for the truth of what is lost."""
_SKIN = np.array([206.0, 150.0, 122.0], np.float32)


@dataclass(frozen=True, slots=True)
class Lamp:
    """A round lamp that glossy paper mirrors.

    place: in the surface frame, half page widths; a negative Z is before the sheet.
    radius: half page widths.
    level: gray levels that its mirror image adds to the photo; print is gone from some 200 on.
    roughness_rad: standard deviation of the paper's small slopes; the image's rim is twice as wide.
    """

    place: tuple[float, float, float]
    radius: float
    level: float = 330.0
    roughness_rad: float = 0.03


@dataclass(frozen=True, slots=True)
class Shadow:
    """A rectangle's shadow: its centre and half sides on the sheet (half page widths), its turn.

    depth: share of the light that it takes. rim: width of the half-shadow, half page widths.
    """

    centre: tuple[float, float]
    half_sides: tuple[float, float]
    turn_rad: float
    depth: float = 0.5
    rim: float = 0.03


@dataclass(frozen=True, slots=True)
class Finger:
    """A finger that lies on the sheet from `root` to `tip` (sheet points); 18 mm wide on a page of 210 mm."""

    root: tuple[float, float]
    tip: tuple[float, float]
    radius: float = 0.085


@dataclass(frozen=True, slots=True)
class Obstructions:
    """All that lies between the sheet and one camera."""

    lamp: Lamp | None = None
    shadow: Shadow | None = None
    fingers: tuple[Finger, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class ObstructedPhoto:
    """A photo (H, W, 3) of what `truth` tells, and what is hidden in it.

    `lost` (H, W) is the share of the print's contrast that is gone, 0-1; `shaded` that of the light.
    """

    image: RgbImage
    truth: Truth
    lost: FloatImage
    shaded: FloatImage


def obstruct(photo: SimulatedPhoto, obstructions: Obstructions) -> ObstructedPhoto:
    """The photo with shadows, mirror images and fingers, in this order; its noise must come later."""
    truth = photo.truth
    height = truth.camera.height
    sheet: FloatImage = np.asarray(
        np.nan_to_num(truth.sheet_lattice().upsampled(0, height), nan=1e3), np.float32
    )
    values = photo.image.astype(np.float32)
    lost, shaded = np.zeros(sheet.shape[:2], np.float32), np.zeros(sheet.shape[:2], np.float32)
    if obstructions.shadow is not None:
        shaded = _shadow_field(sheet, obstructions.shadow)
        values *= 1 - shaded[..., None]
    if obstructions.lamp is not None:
        mirrored = mirror_image(truth, obstructions.lamp).upsampled(0, height)
        edge = np.array([1.0, truth.page.half_height_units], np.float32)
        on_sheet = np.all(np.abs(sheet) <= edge, axis=2)
        added = np.where(on_sheet, np.maximum(mirrored[..., 0], 0), 0).astype(np.float32)
        values += added[..., None]
        lost = lost_contrast(added)
    for finger in obstructions.fingers:
        cover, profile = _finger_field(sheet, finger)
        skin = _SKIN * (0.55 + 0.45 * profile[..., None])
        values += cover[..., None] * (skin - values)
        lost = np.maximum(lost, cover)
    return ObstructedPhoto(np.clip(values + 0.5, 0, 255).astype(np.uint8), truth, lost, shaded)


def mirror_image(truth: Truth, lamp: Lamp) -> Lattice:
    """Gray levels (rows, columns, 1) that the lamp's mirror image adds, at every 8th pixel of the photo.

    The paper mirrors the ray from the eye; the image is full where this meets the lamp, and its rim that of a rough
    mirror, whose slopes are normally distributed.
    """
    lattice = truth.sheet_lattice()
    sheet = lattice.values.reshape(-1, 2)
    missed = np.any(~np.isfinite(sheet), axis=1)
    level = _mirrored_level(truth, np.where(missed[:, None], 0.0, sheet), lamp)
    level[missed] = 0
    return Lattice(level.reshape(*lattice.values.shape[:2], 1), lattice.width)


def lamp_for(truth: Truth, sheet: tuple[float, float], away: float, radius: float) -> Lamp:
    """The lamp, `away` half page widths from the sheet point at which the photo shows its mirror image's middle."""
    at = np.array([sheet])
    point, normal = truth.shape.place(at)[0], np.cross(*truth.shape.tangents(at))[0]
    x, y, z = point + away * _mirrored(point[None] - truth.pose.eye(), normal[None])[0]
    return Lamp((float(x), float(y), float(z)), radius)


def lost_contrast(added: NDArray[np.floating]) -> FloatImage:
    """Share of the contrast of print that clipping takes when `added` gray levels lie over paper and ink."""
    paper, ink = (np.minimum(level + added, 255.0) for level in PAPER_AND_INK)
    return np.asarray(1 - (paper - ink) / (PAPER_AND_INK[0] - PAPER_AND_INK[1]), np.float32)


def _mirrored(rays: Points3, normals: Points3) -> Points3:
    """Unit directions (N, 3) into which mirrors with unit `normals` send `rays`."""
    unit = rays / np.linalg.norm(rays, axis=1, keepdims=True)
    sent: Points3 = unit - 2 * np.sum(unit * normals, axis=1, keepdims=True) * normals
    return sent


def _mirrored_level(truth: Truth, sheet: Points, lamp: Lamp) -> NDArray[np.float64]:
    points, normals = truth.shape.place(sheet), np.cross(*truth.shape.tangents(sheet))
    to_lamp = np.array(lamp.place) - points
    away = np.linalg.norm(to_lamp, axis=1)
    sent = _mirrored(points - truth.pose.eye(), normals)
    angle = np.arccos(np.clip(np.sum(sent * to_lamp, axis=1) / away, -1, 1))
    # A slope of the paper turns the mirrored ray by twice as much.
    beyond = np.maximum(angle - np.arctan2(lamp.radius, away), 0) / (2 * lamp.roughness_rad)
    return np.asarray(lamp.level * np.exp(-0.5 * beyond**2), np.float64)


def _shadow_field(sheet: FloatImage, shadow: Shadow) -> FloatImage:
    """Share of the light (H, W) that is taken, by a smooth step over the rim."""
    c, s = np.cos(shadow.turn_rad), np.sin(shadow.turn_rad)
    turned = (sheet - np.array(shadow.centre, np.float32)) @ np.array([[c, -s], [s, c]], np.float32)
    beyond = (np.abs(turned) - np.array(shadow.half_sides, np.float32)).max(axis=2)
    step = np.clip(0.5 - beyond / shadow.rim, 0, 1)
    return np.asarray(shadow.depth * step * step * (3 - 2 * step), np.float32)


def _finger_field(sheet: FloatImage, finger: Finger) -> tuple[FloatImage, FloatImage]:
    """Cover (H, W) 0-1, and how much the finger's surface faces the viewer, 0-1."""
    root, tip = np.array(finger.root, np.float32), np.array(finger.tip, np.float32)
    along = tip - root
    share = np.clip((sheet - root) @ along / float(along @ along), 0, 1)
    away = np.linalg.norm(sheet - (root + share[..., None] * along), axis=2) / finger.radius
    profile = np.sqrt(np.clip(1 - away**2, 0, 1))
    cover = np.clip((1 - away) / 0.05, 0, 1)
    return np.asarray(cv2.GaussianBlur(cover, (0, 0), 0.8), np.float32), np.asarray(profile, np.float32)

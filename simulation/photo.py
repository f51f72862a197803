"""The generative process as pixels: light, pin-hole, and a filter that neither blurs nor aliases."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from simulation.camera import Camera, Pose
from simulation.flat_page import Page
from simulation.surfaces import Plane, Shape
from simulation.truth import Lattice, Truth

_BAND_ROWS = 256
_MAX_SAMPLES = 8


@dataclass(frozen=True, slots=True)
class Light:
    """A far light source: its radiance, and the direction (camera frame) in which its light travels."""

    direction: tuple[float, float, float] = (0.0, 0.0, 1.0)
    radiance: float = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class SimulatedPhoto:
    """A photo (H, W, 3) RGB uint8 and what is known of it; None where no Exif tells a focal length."""

    image: NDArray[np.uint8]
    truth: Truth
    exif_focal_length_px: float | None = None


def simulate_photo(
    page: Page,
    shape: Shape,
    skew_rad: float,
    pose: Pose,
    camera: Camera,
    *,
    lights: tuple[Light, ...] = (Light(),),
    background: int | NDArray[np.uint8] = 0,
    close_up: bool = False,
) -> SimulatedPhoto:
    """Photograph `page` (Appendix A).

    `background` is a gray value or an (H, W, 3) picture of what lies beside the page, not lit by `lights`.
    A `close_up` shows a part of the page; the rest of it may lie behind the camera.

    Raises
    ------
    ValueError
        When part of the page hides itself or lies behind the camera, or the background has another size.
    """
    truth = Truth(page, shape, skew_rad, pose, camera)
    if not close_up:
        truth.check_visible()
    if not isinstance(background, int) and background.shape != (camera.height, camera.width, 3):
        raise ValueError("the background must have the photo's size")
    lattice = truth.sheet_lattice()
    light = _light_lattice(truth, lattice, lights)
    image = np.empty((camera.height, camera.width, 3), np.uint8)
    for top in range(0, camera.height, _BAND_ROWS):
        bottom = min(top + _BAND_ROWS, camera.height)
        behind = background if isinstance(background, int) else background[top:bottom]
        image[top:bottom] = _render_band(truth, lattice, light, (top, bottom), behind)
    return SimulatedPhoto(image, truth)


def lambertian(normals: NDArray[np.float64], lights: tuple[Light, ...]) -> NDArray[np.float64]:
    """Sum of R_k D_k . N (N,) over the lights; light from behind the page adds nothing."""
    total = np.zeros(len(normals))
    for light in lights:
        direction = np.array(light.direction) / np.linalg.norm(light.direction)
        total += light.radiance * np.maximum(normals @ direction, 0.0)
    return total


def _light_lattice(truth: Truth, lattice: Lattice, lights: tuple[Light, ...]) -> Lattice:
    sheet = lattice.values.reshape(-1, 2)
    edge = np.array([1.0, truth.page.half_height_units])
    # Beside the sheet the light of its border goes on, so that interpolation has no edge to ring at.
    nearest = np.clip(np.nan_to_num(sheet), -edge, edge)
    bright = lambertian(truth.normals_on_sheet(nearest), lights)
    return Lattice(bright.reshape(*lattice.values.shape[:2], 1), lattice.width)


def _render_band(
    truth: Truth,
    lattice: Lattice,
    light: Lattice,
    rows: tuple[int, int],
    background: int | NDArray[np.uint8],
) -> NDArray[np.uint8]:
    page = truth.page
    top, bottom = rows
    # One row and column more than needed, for differences.
    sheet = lattice.upsampled(top, min(bottom + 1, truth.camera.height))
    step_x, step_y = _steps(sheet, bottom - top)
    sheet = sheet[: bottom - top]
    half = np.array([1.0, page.half_height_units], np.float32)
    edge = np.maximum(np.hypot(step_x, step_y), 1e-6)
    with np.errstate(invalid="ignore"):
        coverage = np.clip((half - np.abs(sheet)) / edge + 0.5, 0.0, 1.0).prod(axis=2)
    coverage = np.nan_to_num(coverage)
    seen = coverage > 0
    out = np.full((*sheet.shape[:2], 3), background, np.uint8) if isinstance(background, int) else background
    if not seen.any():
        return out
    # To page pixels; distances beyond the page are cut, where nothing but paper is found anyway.
    limit = 4.0 * float(half.max())
    place = np.nan_to_num(np.clip(sheet, -limit, limit))
    sampled = _area_sample(
        page,
        _page_pixels(truth, place, centred=True),
        _page_pixels(truth, np.nan_to_num(step_x), centred=False),
        _page_pixels(truth, np.nan_to_num(step_y), centred=False),
        seen,
    )
    ink = sampled * light.upsampled(top, bottom)
    mixed = ink * coverage[..., None] + out.astype(np.float32) * (1.0 - coverage[..., None])
    return np.asarray(np.clip(mixed + 0.5, 0, 255).astype(np.uint8))


def _steps(sheet: NDArray[np.float32], rows: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Change of the sheet coordinates per photo pixel to the right and down."""
    step_x = np.empty_like(sheet)
    step_x[:, :-1] = np.diff(sheet, axis=1)
    step_x[:, -1] = step_x[:, -2]
    step_y = np.empty_like(sheet)
    step_y[:-1] = np.diff(sheet, axis=0)
    step_y[-1] = step_y[-2]
    return step_x[:rows], step_y[:rows]


def _page_pixels(truth: Truth, sheet: NDArray[np.float32], *, centred: bool) -> NDArray[np.float32]:
    """Sheet points -> page pixels; without `centred`, sheet differences -> page differences."""
    page = truth.page
    c, s = np.cos(truth.skew_rad), np.sin(truth.skew_rad)
    turned = sheet @ np.array([[c, -s], [s, c]], np.float32) * np.float32(page.half_width_px)
    if centred:
        turned += np.array([(page.width - 1) / 2.0, (page.height - 1) / 2.0], np.float32)
    return np.asarray(turned, np.float32)


def _area_sample(
    page: Page,
    place: NDArray[np.float32],
    step_x: NDArray[np.float32],
    step_y: NDArray[np.float32],
    seen: NDArray[np.bool_],
) -> NDArray[np.float32]:
    """Mean of the page over each photo pixel, (h, w, C) float32.

    The pixel's footprint is sampled on a small grid. Its spread along each axis is sqrt(1 - 1/m^2) of the
    pixel, m page pixels being stepped over: nothing at 1:1, where one interpolated sample is the page
    itself, and the whole pixel where the page is much reduced.
    """
    spreads, counts = [], []
    for step in (step_x, step_y):
        length = np.hypot(step[..., 0], step[..., 1])
        spread = np.sqrt(np.maximum(1.0 - 1.0 / np.maximum(length, 1.0) ** 2, 0.0))
        spreads.append((step * spread[..., None]).astype(np.float32))
        widest = float((length * spread)[seen].max())
        counts.append(1 if widest < 0.05 else min(max(2, int(np.ceil(widest))), _MAX_SAMPLES))
    total: NDArray[np.float32] | None = None
    for i in range(counts[0]):
        for j in range(counts[1]):
            at = place
            if counts != [1, 1]:
                a, b = (i + 0.5) / counts[0] - 0.5, (j + 0.5) / counts[1] - 0.5
                at = place + np.float32(a) * spreads[0] + np.float32(b) * spreads[1]
            sample = cv2.remap(
                page.image,
                at,
                np.empty(0, np.float32),
                cv2.INTER_CUBIC,
                borderMode=cv2.BORDER_CONSTANT,
                borderValue=(page.paper,) * 3,
            ).astype(np.float32)
            total = sample if total is None else total + sample
    assert total is not None
    mean = total / np.float32(counts[0] * counts[1])
    return mean if mean.ndim == 3 else mean[..., None]


def frontal_scene(page: Page, camera: Camera | None = None) -> tuple[Plane, Pose, Camera]:
    """A flat page seen straight on at one photo pixel to the page pixel, filling the photo."""
    camera = camera or Camera(1.2 * page.width, page.width, page.height)
    distance = camera.focal_length_px / page.half_width_px
    return Plane(), Pose(translation=(0.0, 0.0, distance)), camera

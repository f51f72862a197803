"""The sheet's edge, point by point: searched along the normals of a curve that is near it."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import Floats, Points, RgbImage, Vector
from services.sheet.outline.closed_paths import find_closed_path


@dataclass(frozen=True, slots=True)
class EdgeParameters:
    """Lengths are pixels of the image that is searched unless told; colours are RGB levels."""

    spacing_px: float = 8.0
    """Between points when an edge is followed in the medium image."""
    reach_px: float = 9.0
    """To either side: three pixels of the reduced photo, where the curve comes from."""
    fine_points: int = 480
    """Round the whole outline, in the photo itself."""
    fine_reach: float = 1.0 / 500
    """Of the outline's diagonal, to either side."""
    fine_step: float = 1.0 / 4000
    """Of the outline's diagonal."""
    contrast: float = 12.0
    """An edge of this colour difference counts half."""
    straightness: float = 0.05
    """What a step of one sample from normal to normal costs, in full edges."""
    ground: tuple[float, float] = (0.25, 0.8)
    """Shares of the reach at which the ground at either side of an edge is told."""
    seen_contrast: float = 6.0
    """An edge counts as seen from this difference of colour on ..."""
    seen_ratio: float = 2.0
    """... and this many times the unrest of the ground beside it."""


@dataclass(frozen=True, slots=True, eq=False)
class EdgePoints:
    """A closed curve in photo pixels, clockwise, one row a point.

    `points` (N, 2); `normals` (N, 2) point outwards; `deviations` (N,) are standard deviations across the edge;
    `contrast` (N,) is the colour difference of both sides, RGB levels; `seen` (N,) tells where an edge is, `shown`
    (N,) where the curve is inside the photo.
    """

    points: Points
    normals: Points
    deviations: Vector
    contrast: Vector
    seen: NDArray[np.bool_]
    shown: NDArray[np.bool_]


def resample_closed(points: Points, count: int) -> Points:
    """`count` points at equal distances along the closed curve `points` (N, 2)."""
    closed = np.concatenate([points, points[:1]])
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(closed, axis=0), axis=1))])
    at = np.arange(count) * along[-1] / count
    return np.column_stack([np.interp(at, along, closed[:, k]) for k in range(2)])


def curve_length(points: Points) -> float:
    """Length of the closed curve `points` (N, 2)."""
    return float(np.linalg.norm(points - np.roll(points, 1, axis=0), axis=1).sum())


def smooth_closed(values: Floats, width: int) -> Floats:
    """Running means over `width` neighbours of a closed sequence (N, K)."""
    half = width // 2
    if half < 1:
        return values
    padded = np.concatenate([values[-half:], values, values[:half]])
    sums = np.cumsum(np.concatenate([np.zeros((1, values.shape[1])), padded]), axis=0)
    return np.asarray((sums[2 * half + 1 :] - sums[: -2 * half - 1]) / (2 * half + 1))


def outward_normals(points: Points, width: int) -> Points:
    """Unit normals (N, 2) of a clockwise closed curve, from its direction over `width` neighbours."""
    ahead = np.roll(points, -width, axis=0) - np.roll(points, width, axis=0)
    normal = np.column_stack([ahead[:, 1], -ahead[:, 0]])
    return np.asarray(normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-9))


def _profiles(
    image: RgbImage, points: Points, normals: Points, offsets: Vector, tangential: Vector
) -> Floats:
    """Colours (N, M, 3) at `offsets` (M,) along the normals, averaged over the `tangential` offsets."""
    along = np.column_stack([-normals[:, 1], normals[:, 0]])
    base = points[:, None, :] + offsets[None, :, None] * normals[:, None, :]
    total = np.zeros((*base.shape[:2], 3), np.float32)
    for offset in tangential:
        at = (base + offset * along[:, None, :]).astype(np.float32)
        total += cv2.remap(image, at[..., 0], at[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(total / len(tangential))


def _shown(points: Points, window: tuple[float, float, float, float], margin: float) -> NDArray[np.bool_]:
    x0, y0, x1, y1 = window
    return np.asarray(
        (points[..., 0] >= x0 + margin)
        & (points[..., 0] <= x1 - margin)
        & (points[..., 1] >= y0 + margin)
        & (points[..., 1] <= y1 - margin)
    )


def follow_edge(
    image: RgbImage,
    curve: Points,
    window: tuple[float, float, float, float],
    parameters: EdgeParameters | None = None,
) -> Points:
    """The curve (N, 2) moved onto the strongest closed edge within reach, in pixels of `image` (H, W, 3).

    `window` (x0, y0, x1, y1) is the part of the image that shows anything.
    """
    p = parameters or EdgeParameters()
    count = int(np.clip(curve_length(curve) / p.spacing_px, 60, 900))
    points = smooth_closed(resample_closed(curve, count), 3)
    normals = outward_normals(points, 3)
    offsets = np.arange(-p.reach_px, p.reach_px + 0.5, 1.0)
    wide = np.arange(offsets[0] - 2, offsets[-1] + 2.5, 1.0)
    colors = _profiles(image, points, normals, wide, np.array([-1.5, 0.0, 1.5]))
    difference = np.linalg.norm(
        0.5 * (colors[:, 3:-1] + colors[:, 4:]) - 0.5 * (colors[:, :-4] + colors[:, 1:-3]), axis=2
    )
    strength = difference**2 / (difference**2 + p.contrast**2)
    at = points[:, None] + offsets[None, :, None] * normals[:, None]
    shown = _shown(at, window, 0.0)
    score = np.where(shown, strength, -1.0)
    score -= 0.1 * (offsets / p.reach_px) ** 2
    path = find_closed_path(score, 2, p.straightness)
    return np.asarray(at[np.arange(count), path])


def measure_edge(
    photo: RgbImage,
    curve: Points,
    window: tuple[float, float, float, float],
    parameters: EdgeParameters | None = None,
) -> EdgePoints:
    """Sub-pixel points of the edge that `curve` (N, 2), photo pixels, clockwise, runs along.

    The step is where its derivative along the normal, in the direction from one side's colour to the other's, has
    its maximum (the vertex of a parabola through three samples).
    """
    p = parameters or EdgeParameters()
    low, high = curve.min(axis=0), curve.max(axis=0)
    diagonal = float(np.linalg.norm(high - low))
    step = max(p.fine_step * diagonal, 0.5)
    reach = max(p.fine_reach * diagonal, 3.0)
    points = smooth_closed(resample_closed(curve, p.fine_points), 3)
    normals = outward_normals(points, 2)
    half = int(np.ceil(2 * reach / step))
    offsets = step * np.arange(-half, half + 1)
    spacing = curve_length(points) / len(points)
    tangential = np.linspace(-0.4, 0.4, 5) * spacing
    colors = _profiles(photo, points, normals, offsets, tangential)
    inner = slice(half - int(p.ground[1] * half), half - int(p.ground[0] * half))
    outer = slice(half + int(p.ground[0] * half) + 1, half + int(p.ground[1] * half) + 1)
    difference = colors[:, outer].mean(axis=1) - colors[:, inner].mean(axis=1)
    contrast = np.linalg.norm(difference, axis=1)
    way = difference / np.maximum(contrast, 1e-6)[:, None]
    profile = np.einsum("nmk,nk->nm", colors, way)
    kernel = np.array([1.0, 4.0, 6.0, 4.0, 1.0]) / 16
    profile = np.asarray(cv2.sepFilter2D(profile, -1, kernel, np.ones(1)))
    slope = np.gradient(profile, step, axis=1)
    near = np.abs(offsets) <= reach
    first = int(np.argmax(near))
    windowed = slope[:, near] * (1 - 0.3 * (offsets[near] / reach) ** 2)
    path = find_closed_path(windowed / np.maximum(contrast, 1.0)[:, None] * 3 * step, 3, p.straightness)
    m = np.clip(path + first, 1, len(offsets) - 2)
    n = np.arange(len(points))
    before, here, after = slope[n, m - 1], slope[n, m], slope[n, m + 1]
    bend = before - 2 * here + after
    shift = np.where(bend < -1e-9, 0.5 * (before - after) / np.where(bend < -1e-9, bend, -1.0), 0.0)
    offset = offsets[m] + step * np.clip(shift, -1, 1)
    unrest = np.maximum(profile[:, inner].std(axis=1), profile[:, outer].std(axis=1))
    found = points + offset[:, None] * normals
    shown = _shown(found, window, 1.5)
    seen = shown & (contrast > p.seen_contrast) & (contrast > p.seen_ratio * unrest) & (here > 0)
    deviations = np.clip(unrest / np.maximum(here, 1e-6), 0.1, reach)
    return EdgePoints(found, normals, deviations, contrast, np.asarray(seen), shown)

"""The sheet's edge, point by point: searched along the normals of a curve that is near it."""

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import Floats, Points, RgbImage, Vector
from services.imaging.channels import length_of_channels
from services.kernels.library import address, find_kernels, image_of, is_packed
from services.sheet.outline.paths import find_closed_paths, find_open_paths
from services.sheet.outline.results import LEAST_POINTS, SIDE_POINTS

# Lengths are pixels of the image that is searched unless stated; colours are RGB levels.
SPACING_PX = 6.0
"""Between points when an edge is followed in the medium image."""
REACH_PX = 9.0
"""To either side: two pixels of the reduced photo, where the curve comes from, or more."""
MEASURED_POINTS = 120
"""On each side, in the photo itself."""
FINE_REACH = 1.0 / 250
"""Of the outline's diagonal, to either side."""
FINE_STEP = 1.0 / 4000
"""Of the outline's diagonal."""
CONTRAST = 12.0
"""An edge of this colour difference counts half."""
STRAIGHTNESS = 0.05
"""What a step of one sample from normal to normal costs, in full edges."""
GROUND = (2.0, 5.0)
"""The ground on either side of an edge is sampled at these distances, in units of the edge's usual width ..."""
EDGE_WIDTH = 1.0 / 1200
"""... which is this share of the outline's diagonal, or a pixel."""
SEEN_CONTRAST = 6.0
"""An edge counts as seen from this difference of colour on ..."""
SEEN_RATIO = 2.0
"""... and this many times the variation of the ground next to it."""


@dataclass(frozen=True, slots=True, eq=False)
class EdgePoints:
    """Points of an edge in pixels of the image that it was measured in, clockwise, one row a point.

    `points` (N, 2); `normals` (N, 2) point outwards; `deviations` (N,) are standard deviations across the edge;
    `strength` (N,) is how clear the edge is, 0-1; `seen` (N,) marks where an edge is, `shown`
    (N,) where the curve is inside the photo.
    """

    points: Points
    normals: Points
    deviations: Vector
    strength: Vector
    seen: NDArray[np.bool_]
    shown: NDArray[np.bool_]

    @property
    def support(self) -> float:
        """Mean strength of the edge, 0-1; it is 0 where no edge is seen."""
        return float(np.mean(self.strength * self.seen))


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


def edge_profiles(
    image: RgbImage, points: Points, normals: Points, offsets: Vector, tangential: Floats
) -> Floats:
    """Colours (N, M, 3) at `offsets` (M,) along the normals, averaged over the `tangential` offsets (N, T)."""
    if normals.shape != points.shape or len(tangential) != len(points) or not image.size:
        raise ValueError("points in pixels have normals and places beside them")
    kernels = find_kernels()
    if kernels is None or not is_packed(image):
        return edge_profiles_plain(image, points, normals, offsets, tangential)
    colors = np.empty((len(points), len(offsets), 3), np.float32)
    given = [np.ascontiguousarray(a, np.float64) for a in (points, normals, offsets, tangential)]
    at, across, steps, aside = map(address, given)
    kernels.sample_profiles(
        ctypes.byref(image_of(image)),
        *(at, across, len(points)),
        *(steps, len(offsets)),
        *(aside, tangential.shape[1]),
        address(colors),
    )
    return colors


def edge_profiles_plain(
    image: RgbImage, points: Points, normals: Points, offsets: Vector, tangential: Floats
) -> Floats:
    """`edge_profiles` without a kernel; each of the averaged colours is rounded."""
    along = np.column_stack([-normals[:, 1], normals[:, 0]])
    base = points[:, None, :] + offsets[None, :, None] * normals[:, None, :]
    total = np.zeros((*base.shape[:2], 3), np.float32)
    for offset in tangential.T:
        at = (base + (offset[:, None] * along)[:, None, :]).astype(np.float32)
        total += cv2.remap(image, at[..., 0], at[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(total / tangential.shape[1])


def steps_along(colors: Floats, sought: slice, ground: tuple[int, int]) -> tuple[Floats, Floats]:
    """The steps of colour in profiles `colors` (N, M, 3) at the `sought` ones of the M.

    Differences (N, S, 3) of the means of the `ground`, from its first to its last step on both sides; and how steeply
    the colours change there in the direction of these, levels in a step (N, S). Two steps and those of the ground lie
    on both sides of what is sought.
    """
    first, last = ground
    margin = max(last, 3)
    if not (0 <= first <= last and margin <= sought.start < sought.stop <= colors.shape[1] - margin):
        raise ValueError("profiles reach beyond what is sought in them")
    kernels = find_kernels()
    if kernels is None:
        return steps_along_plain(colors, sought, ground)
    colors = np.ascontiguousarray(colors, np.float32)
    count, steps, size = *colors.shape[:2], sought.stop - sought.start
    difference, along = np.empty((count, size, 3)), np.empty((count, size))
    where = count, steps, sought.start, size, first, last
    if not kernels.measure_steps(address(colors), *where, address(difference), address(along)):
        raise MemoryError
    return difference, along


def steps_along_plain(colors: Floats, sought: slice, ground: tuple[int, int]) -> tuple[Floats, Floats]:
    """`steps_along` without a kernel."""
    first, last = ground
    # Means on both sides of every sample, from running sums.
    sums = np.concatenate(
        [np.zeros((len(colors), 1, 3)), np.cumsum(colors, axis=1, dtype=np.float64)], axis=1
    )
    inside = np.arange(sought.start, sought.stop)
    inner = (sums[:, inside - first + 1] - sums[:, inside - last]) / (last - first + 1)
    outer = (sums[:, inside + last + 1] - sums[:, inside + first]) / (last - first + 1)
    difference = outer - inner
    blurred = np.asarray(cv2.sepFilter2D(colors, -1, np.array([1.0, 4.0, 6.0, 4.0, 1.0]) / 16, np.ones(1)))
    slope = np.gradient(blurred, axis=1)[:, inside]
    along = np.einsum("nmk,nmk->nm", slope, difference) / np.maximum(length_of_channels(difference), 1e-6)
    return difference, along


def _shown(points: Points, window: tuple[float, float, float, float], margin: float) -> NDArray[np.bool_]:
    x0, y0, x1, y1 = window
    return np.asarray(
        (points[..., 0] >= x0 + margin)
        & (points[..., 0] <= x1 - margin)
        & (points[..., 1] >= y0 + margin)
        & (points[..., 1] <= y1 - margin)
    )


def follow_edge(image: RgbImage, curve: Points, window: tuple[float, float, float, float]) -> Points:
    """The closed clockwise curve (N, 2) moved onto the strongest closed edge within reach, pixels of `image` (H, W, 3).

    `window` (x0, y0, x1, y1) is the part of the image that shows anything.
    """
    count = int(np.clip(curve_length(curve) / SPACING_PX, 60, 600))
    points = smooth_closed(resample_closed(curve, count), 3)
    normals = outward_normals(points, 3)
    offsets = np.arange(-REACH_PX, REACH_PX + 0.5, 1.0)
    wide = np.arange(offsets[0] - 2, offsets[-1] + 2.5, 1.0)
    colors = edge_profiles(image, points, normals, wide, np.tile([-2.0, 0.0, 2.0], (count, 1)))
    difference = length_of_channels(
        0.5 * (colors[:, 3:-1] + colors[:, 4:]) - 0.5 * (colors[:, :-4] + colors[:, 1:-3])
    )
    strength = difference**2 / (difference**2 + CONTRAST**2)
    at = points[:, None] + offsets[None, :, None] * normals[:, None]
    score = np.where(_shown(at, window, 0.0), strength, -1.0) - 0.1 * (offsets / REACH_PX) ** 2
    path = find_closed_paths(score[None], 2, STRAIGHTNESS)[0]
    return np.asarray(at[np.arange(count), path])


def measure_closed_edge(
    image: RgbImage, curve: Points, window: tuple[float, float, float, float]
) -> EdgePoints:
    """Sub-pixel points of the edge that a closed clockwise `curve` (N, 2), pixels of `image`, runs along."""
    points = smooth_closed(resample_closed(curve, len(curve)), 3)
    diagonal = float(np.linalg.norm(np.ptp(points, axis=0)))
    return _measure(image, points[None], outward_normals(points, 2)[None], diagonal, window, True)


def measure_sides(
    image: RgbImage, guides: Sequence[Points], diagonal: float, window: tuple[float, float, float, float]
) -> list[EdgePoints]:
    """Sub-pixel points of sides' edges, near `guides` (N, 2) that run clockwise from corner to corner.

    `diagonal` is the outline's.
    """
    places, normals = zip(*(normals_along(guide, MEASURED_POINTS) for guide in guides), strict=True)
    found = _measure(image, np.stack(places), np.stack(normals), diagonal, window, False)
    parts = [slice(k * MEASURED_POINTS, (k + 1) * MEASURED_POINTS) for k in range(len(guides))]
    return [
        EdgePoints(
            found.points[part],
            found.normals[part],
            found.deviations[part],
            found.strength[part],
            found.seen[part],
            found.shown[part],
        )
        for part in parts
    ]


def leave_out_strays(
    side: EdgePoints, diagonal: float, window: tuple[float, float, float, float]
) -> EdgePoints:
    """A measured `side` without what is seen where it runs along the photo's border and mostly is not seen.

    There the sheet has left the photo, and letters that the border cuts look like its edge.
    """
    # The curve is near the border there, and an edge near the curve.
    beside = ~_shown(side.points, window, 2.0 * _reach(diagonal))
    ends = np.flatnonzero(np.diff(np.concatenate([[False], beside, [False]]).astype(int)))
    seen = side.seen.copy()
    for first, last in ends.reshape(-1, 2):
        if side.seen[first:last].mean() < 0.5:
            seen[first:last] = False
    return replace(side, seen=seen)


def leave_out_border(
    side: EdgePoints, diagonal: float, window: tuple[float, float, float, float]
) -> EdgePoints:
    """A measured `side` as out of view, and on the photo's border, where it runs along that and is not seen.

    The curve of a sheet that goes on beyond the photo ends some pixels before the border, nearer than an edge is
    sought. A side that is seen in part, and is lost beside the border, is one that is not seen well.
    """
    inner = side.seen | _shown(side.points, window, _reach(diagonal))
    if side.seen.mean() * SIDE_POINTS >= LEAST_POINTS or inner.mean() > 0.5:
        return side
    low, high = np.array(window[:2]), np.array(window[2:])
    gaps = np.concatenate([side.points - low, high - side.points], axis=1)
    ends = np.concatenate([low, high])
    points, beside, nearest = side.points.copy(), np.flatnonzero(~inner), gaps.argmin(axis=1)[~inner]
    points[beside, nearest % 2] = ends[nearest]
    return replace(side, points=points, shown=side.shown & inner)


def _reach(diagonal: float) -> float:
    """Distance in pixels to either side of a curve in which its edge is sought, in an outline of this `diagonal`."""
    return max(FINE_REACH * diagonal, 3.0)


def normals_along(guide: Points, count: int) -> tuple[Points, Points]:
    """`count` points at equal distances along the curve `guide` (N, 2), and unit normals there."""
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(guide, axis=0), axis=1))])
    at = (np.arange(count) + 0.5) * along[-1] / count
    points = np.column_stack([np.interp(at, along, guide[:, k]) for k in range(2)])
    inner = points.copy()
    inner[1:-1] = (points[:-2] + points[1:-1] + points[2:]) / 3
    way = np.gradient(inner, axis=0)
    way[2:-2] = inner[4:] - inner[:-4]
    normal = np.column_stack([way[:, 1], -way[:, 0]])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-9)
    return inner, normal


def _measure(
    image: RgbImage,
    curves: Floats,
    curve_normals: Floats,
    diagonal: float,
    window: tuple[float, float, float, float],
    closed: bool,
) -> EdgePoints:
    """The edges of G curves (G, N, 2), which lie near them, as one sequence of G N points.

    An edge is the step along each normal (G, N, 2): where its derivative, in the direction from one side's colour to
    the other's, is greatest (the vertex of a parabola through three samples).
    """
    points, normals = curves.reshape(-1, 2), curve_normals.reshape(-1, 2)
    step = max(FINE_STEP * diagonal, 0.5)
    reach = _reach(diagonal)
    width = max(EDGE_WIDTH * diagonal, 1.0)
    near, far = (g * width for g in GROUND)
    half = int(np.ceil((reach + far) / step))
    offsets = step * np.arange(-half, half + 1)
    spacing = np.median(np.linalg.norm(np.diff(curves, axis=1), axis=2), axis=1)
    tangential = np.repeat(spacing, curves.shape[1])[:, None] * np.linspace(-0.4, 0.4, 5)
    colors = edge_profiles(image, points, normals, offsets, tangential)
    first, last = int(np.ceil(near / step)), int(np.ceil(far / step))
    inside = np.flatnonzero(np.abs(offsets) <= reach)
    difference, along = steps_along(colors, slice(inside[0], inside[-1] + 1), (first, last))
    contrast, along = length_of_channels(difference), along / step
    # A sharp step of contrast c has the slope c / width; a flat ramp has less.
    sharp = np.clip(along * width / np.maximum(contrast, SEEN_CONTRAST), 0, 1)
    strength = contrast**2 / (contrast**2 + CONTRAST**2) * sharp
    score = strength - 0.1 * (offsets[inside] / reach) ** 2
    find = find_closed_paths if closed else find_open_paths
    paths = find(score.reshape(*curves.shape[:2], -1), 3, STRAIGHTNESS).ravel()
    m = np.clip(paths, 1, len(inside) - 2)
    n = np.arange(len(points))
    before, here, after = along[n, m - 1], along[n, m], along[n, m + 1]
    bend = before - 2 * here + after
    shift = np.where(bend < -1e-9, 0.5 * (before - after) / np.where(bend < -1e-9, bend, -1.0), 0.0)
    found = points + (offsets[inside[m]] + step * np.clip(shift, -1, 1))[:, None] * normals
    contrast, way = contrast[n, m], difference[n, m] / np.maximum(contrast[n, m], 1e-6)[:, None]
    beside = inside[m][:, None] + np.concatenate([np.arange(-last, -first + 1), np.arange(first, last + 1)])
    ground = np.einsum("nmk,nk->nm", colors[n[:, None], beside], way)
    unrest = np.maximum(ground[:, : last - first + 1].std(axis=1), ground[:, last - first + 1 :].std(axis=1))
    shown = _shown(found, window, 1.5)
    seen = shown & (contrast > SEEN_CONTRAST) & (contrast > SEEN_RATIO * unrest) & (here > 0)
    # Variation of the ground shifts the steepest place by the ratio of its slope to that of the edge.
    deviations = np.clip(0.5 * unrest / np.maximum(here, 1e-6), 0.05, reach)
    return EdgePoints(found, normals, deviations, strength[n, m], np.asarray(seen), shown)

"""The outline of a sheet whose four corners are known: its sides are looked for near the straight ones.

A side that bends has an edge from corner to corner. A rule beside an edge that is not seen has none near the corners:
so a bent side is believed only where its edge is seen along all of it.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from services.arrays import Floats, Mask, Points, RgbImage, Vector
from services.geometry.homographies import from_resized, to_resized
from services.imaging.channels import length_of_channels
from services.imaging.grid_paths import SHIFT_COST
from services.imaging.reduction import Halves
from services.sheet.outline.edges import (
    CONTRAST,
    EdgePoints,
    edge_profiles,
    measure_sides,
    normals_along,
)
from services.sheet.outline.paths import find_open_paths
from services.sheet.outline.reduced_photo import medium_photo
from services.sheet.outline.results import LEAST_SEEN, SIDE_POINTS, SheetOutline, SheetSide

# Lengths are shares of a side's chord.
NORMALS = 96
"""Places along a side at which its edge is sought."""
MOST_BOW = 0.12
"""Of a side, to either side of the chord: sides of an opened book bow by up to 0.09."""
STEEPEST = 0.42
"""Of a side against its chord, as a slope: a fold in thirds has up to 0.3, the near end of a bent sheet seen
obliquely 0.4."""
STRAIGHT_BOW = 0.006
"""A side within it counts as straight: a corner that a person sets is a few pixels off."""
PARTS: tuple[float, ...] = (0.06, 0.2, 0.35, 0.5, 0.65, 0.8, 0.94)
"""Of the parts of a side between these places, ..."""
LEAST_STRENGTH = 0.25
"""... each must have an edge of this mean strength, or the side is not followed, ..."""
GAIN = 0.05
"""... and a bent side must exceed the straight one by this in its weakest part."""
UNSEEN = 0.003
"""Standard deviation of a side's place where no edge was seen and it is taken for straight, for want of better."""
CORNER = 0.0002
"""That of a corner: it is exact, to the pixels of a photo."""


def outline_between(photo: RgbImage | Halves, corners: Points) -> SheetOutline:
    """The outline through the `corners` (4, 2) of `photo` (H, W, 3), which are clockwise in it; they are not moved.

    A side has its corners, and the points where its edge is seen: where none is, the sheet may bend.
    """
    halves = Halves.of(photo)
    first = int(np.argmin(corners.sum(axis=1)))
    corners = np.roll(corners, -first, axis=0)
    medium, factor = medium_photo(halves)
    guides = []
    for k in range(4):
        start, end = to_resized(corners[[k, (k + 1) % 4]], factor)
        guides.append(from_resized(_guide(medium, start, end), factor))
    height, width = halves.image.shape[:2]
    diagonal = float(np.linalg.norm(np.ptp(corners, axis=0)))
    measured = measure_sides(halves.image, guides, diagonal, (0.0, 0.0, width - 1.0, height - 1.0))
    sides = [_side(edge, corners[k], corners[(k + 1) % 4]) for k, edge in enumerate(measured)]
    polygon = np.concatenate([side.points[:-1] for side in sides])
    polygon = np.clip(polygon, 0.0, [width - 1.0, height - 1.0])
    return SheetOutline(corners, (sides[0], sides[1], sides[2], sides[3]), 1.0, polygon)


def _guide(image: RgbImage, start: Points, end: Points) -> Points:
    """Curve (N, 2) from `start` to `end` (2,), pixels of `image`: along a bent edge, else straight."""
    straight = np.linspace(start, end, NORMALS)
    chord = float(np.linalg.norm(end - start))
    points, normals = normals_along(straight, NORMALS)
    step = max(MOST_BOW * chord / 60, 1.0)
    reach = max(int(np.ceil(MOST_BOW * chord / step)), 3)
    offsets = step * np.arange(-reach, reach + 1)
    strength = _edge_strength(image, points, normals, offsets, chord)
    place = (np.arange(NORMALS) + 0.5) / NORMALS
    room = chord * np.minimum(STEEPEST * np.minimum(place, 1 - place), MOST_BOW)
    most = max(int(np.ceil(STEEPEST * chord / NORMALS / step)), 1)
    near_chord = np.abs(offsets) <= max(STRAIGHT_BOW * chord, step)
    ends = np.round(np.array(PARTS) * NORMALS).astype(int)
    chosen, weakest = straight, 0.0
    # The straight side goes first: a bent one must have a clearer edge where it has the least.
    for allowed in (near_chord, np.abs(offsets) <= np.maximum(room, step)[:, None]):
        followed, path = _best_path(strength, allowed, most)
        least = min(float(part.mean()) for part in np.split(followed, ends))
        if least > max(weakest + GAIN, LEAST_STRENGTH):
            curve = points + offsets[path][:, None] * normals
            chosen, weakest = np.concatenate([start[None], curve, end[None]]), least
    return chosen


def _edge_strength(image: RgbImage, points: Points, normals: Points, offsets: Floats, chord: float) -> Floats:
    """Strength (N, M), 0-1, of an edge at `offsets` (M,) along the normals of `points` (N, 2): a step of colour."""
    step = offsets[1] - offsets[0]
    wide = np.concatenate(
        [offsets[0] + step * np.arange(-2, 0), offsets, offsets[-1] + step * np.arange(1, 3)]
    )
    along = chord / NORMALS * np.array([-0.4, 0.0, 0.4])
    colors = edge_profiles(image, points, normals, wide, np.tile(along, (len(points), 1)))
    difference = length_of_channels(
        0.5 * (colors[:, 3:-1] + colors[:, 4:]) - 0.5 * (colors[:, :-4] + colors[:, 1:-3])
    )
    height, width = image.shape[:2]
    at = points[:, None] + offsets[None, :, None] * normals[:, None]
    shown = ((at >= 1) & (at <= [width - 2, height - 2])).all(axis=2)
    return np.where(shown, difference**2 / (difference**2 + CONTRAST**2), 0.0)


def _best_path(strength: Floats, allowed: Mask, max_shift: int) -> tuple[Floats, NDArray[np.intp]]:
    """Strength (N,) along the best path through the `allowed` samples of (N, M), and its samples (N,)."""
    score = np.where(allowed, strength, -np.inf)
    path = find_open_paths(score[None], max_shift, SHIFT_COST)[0]
    return strength[np.arange(len(path)), path], path


def _side(edge: EdgePoints, start: Points, end: Points) -> SheetSide:
    """The side from `start` to `end` (2,): where its edge is seen, and its corners."""
    chord = float(np.linalg.norm(end - start))
    places = (edge.points - start) @ (end - start) / chord**2
    between = (places > 0) & (places < 1)
    kept = np.flatnonzero(between & edge.seen)[:: max(len(edge.points) // SIDE_POINTS, 1)]
    return _side_of(
        np.concatenate([start[None], edge.points[kept], end[None]]),
        np.concatenate([[CORNER * chord], edge.deviations[kept], [CORNER * chord]]),
        float(edge.seen[between].mean()) if between.any() else 0.0,
    )


def with_straight_sides(outline: SheetOutline) -> SheetOutline:
    """The outline with straight sides from corner to corner where their edge was hardly seen, for want of better."""
    sides = []
    for k, side in enumerate(outline.sides):
        if side.seen >= LEAST_SEEN:
            sides.append(side)
            continue
        ends = outline.corners[[k, (k + 1) % 4]]
        unseen = UNSEEN * float(np.linalg.norm(ends[1] - ends[0]))
        points = np.linspace(ends[0], ends[1], SIDE_POINTS)
        sides.append(_side_of(points, np.full(len(points), unseen), 1.0))
    return replace(outline, sides=(sides[0], sides[1], sides[2], sides[3]))


def _side_of(points: Points, deviations: Vector, seen: float) -> SheetSide:
    off = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)[1] / np.sqrt(len(points))
    return SheetSide(points, deviations, seen, float(off))

"""Whether photos are parts of one photo: whether similarities lay all of them on each other exactly.

Crops of one photo, and photos of a camera that did not move, differ by a similarity. A camera that moves or turns sees
in another perspective, so nothing else leaves hundreds of matches a tenth of a pixel apart.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import Homography, Points, Vector
from services.geometry.homographies import transform_points
from services.mosaic.flat_photo import FlatPhoto
from services.mosaic.photo_graph import connect_photos
from services.mosaic.registration.pair_registration import PairRegistration

EXACT_PX = 0.2
"""Median distance of a pair's matches, pixels of the views: 0.02 to 0.09 on 22 pairs of crops, turned, resized and
saved as JPEG of quality 90; 1.3 and more on four of six pairs of a newspaper seen
nearly from the front."""
NEAR_PX = 0.7
"""Distance of matches that a fit keeps in any case: 95 % were within 0.27 on these pairs of crops."""
FEWEST = 12
"""Matches of a pair."""
ALIKE = 0.0025
"""Distance, over the photo's diagonal, up to which a similarity and a homography of the matches agree in the corners of
a photo: 0.0001 to 0.0024 on pairs of crops, 0.012 to 0.058 on four of six pairs of the newspaper. Crops that overlap
little tell less (0.004 to 0.013), so pairs that agree must connect the photos, and all others be as exact."""
ROUNDS = 4
"""Fits, each without the matches that the one before leaves far apart."""

Complex = NDArray[np.complex128]


@dataclass(frozen=True, slots=True, eq=False)
class _Matches:
    """Matches (N,) of photos `a` and `b`, places in their order: photo pixels, complex.

    `corners` are those of photo b, `px` is a pixel of the view of photo a.
    """

    a: int
    b: int
    on_a: Complex
    on_b: Complex
    corners: Complex
    px: float


def fit_similarities(
    photos: Mapping[int, FlatPhoto], pairs: Sequence[PairRegistration]
) -> dict[int, Homography] | None:
    """Photo pixels -> pixels of the photo of which all `photos` are parts, for each by index; None where they are not.

    A pixel there is one of the finest photo. `pairs` connect the photos.
    """
    order = list(photos)
    matches = [_gather(photos, order, pair) for pair in pairs]
    areas = [photo.photo.shape[0] * photo.photo.shape[1] for photo in photos.values()]
    root = int(np.argmax(areas))
    kept = [np.ones(len(each.on_a), bool) for each in matches]
    for _ in range(ROUNDS):
        if min(np.count_nonzero(near) for near in kept) < FEWEST:
            return None
        scales, shifts = _solve(len(order), root, matches, kept)
        left = [_apart(each, scales, shifts) for each in matches]
        kept = [off <= max(3 * float(np.median(off)), NEAR_PX) for off in left]
    if any(float(np.median(off)) > EXACT_PX for off in left):
        return None
    sure = [
        (each.a, each.b)
        for each, near in zip(matches, kept, strict=True)
        if _corners_apart(each, near, scales, shifts) <= ALIKE
    ]
    if len(connect_photos(range(len(order)), sure)) > 1:
        return None
    finest = float(np.abs(scales).min())
    return {
        index: np.array([[s.real, -s.imag, t.real], [s.imag, s.real, t.imag], [0.0, 0.0, finest]]) / finest
        for index, s, t in zip(order, scales, shifts, strict=True)
    }


def _gather(photos: Mapping[int, FlatPhoto], order: Sequence[int], pair: PairRegistration) -> _Matches:
    ends = [
        photos[index].to_photo(points) for index, points in ((pair.a, pair.points_a), (pair.b, pair.points_b))
    ]
    known = np.isfinite(np.concatenate(ends, axis=1)).all(axis=1)
    on_a, on_b = (end[known] @ np.array([1.0, 1.0j]) for end in ends)
    height, width = photos[pair.b].photo.shape[:2]
    corners = np.array([0.0, width, width + 1.0j * height, 1.0j * height])
    px = 1.0 / photos[pair.a].native_scale
    return _Matches(order.index(pair.a), order.index(pair.b), on_a, on_b, corners, px)


def _solve(
    count: int, root: int, matches: Sequence[_Matches], kept: Sequence[NDArray[np.bool_]]
) -> tuple[Complex, Complex]:
    """Factors and shifts (count,), complex, that lay the kept matches on each other in the pixels of photo `root`."""
    total = sum(int(np.count_nonzero(near)) for near in kept)
    A, row = np.zeros((total, 2 * count), np.complex128), 0
    for each, near in zip(matches, kept, strict=True):
        rows = slice(row, row + int(np.count_nonzero(near)))
        A[rows, each.a], A[rows, count + each.a] = each.on_a[near], 1.0
        A[rows, each.b], A[rows, count + each.b] = -each.on_b[near], -1.0
        row = rows.stop
    free = np.array([k for k in range(2 * count) if k % count != root])
    found = np.linalg.lstsq(A[:, free], -A[:, root], rcond=None)[0]
    values = np.zeros(2 * count, np.complex128)
    values[root], values[free] = 1.0, found
    return values[:count], values[count:]


def _apart(each: _Matches, scales: Complex, shifts: Complex) -> Vector:
    """Distances (N,) of the matches, pixels of the view of photo `a`."""
    apart = scales[each.a] * each.on_a + shifts[each.a] - scales[each.b] * each.on_b - shifts[each.b]
    return np.asarray(np.abs(apart) / (np.abs(scales[each.a]) * each.px))


def _corners_apart(each: _Matches, near: NDArray[np.bool_], scales: Complex, shifts: Complex) -> float:
    """Distance of the corners of photo `b` by the similarities from those by a homography, over its diagonal."""
    seen, known = (_points(end[near]) for end in (each.on_b, each.on_a))
    H, _ = cv2.findHomography(seen, known)
    if H is None:
        return float("inf")
    by_matches = transform_points(np.asarray(H, np.float64), _points(each.corners)) @ np.array([1.0, 1.0j])
    laid = (scales[each.b] * each.corners + shifts[each.b] - shifts[each.a]) / scales[each.a]
    unit = float(np.abs(laid[2] - laid[0]))
    return float(np.abs(by_matches - laid).max()) / unit


def _points(places: Complex) -> Points:
    return np.column_stack([places.real, places.imag])

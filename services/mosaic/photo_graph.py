"""The graph of overlapping photos, and the choice of the part that becomes the page."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from services.arrays import Homography, Points
from services.errors import NotOverlapping
from services.geometry.homographies import transform_points
from services.mosaic.flat_photo import FlatPhoto


def connect_photos(indices: Iterable[int], pairs: Iterable[tuple[int, int]]) -> tuple[tuple[int, ...], ...]:
    """Connected components of the graph with nodes `indices` and edges `pairs`, each sorted."""
    part = {index: {index} for index in indices}
    for a, b in pairs:
        if part[a] is not part[b]:
            part[a] |= part[b]
            for index in part[b]:
                part[index] = part[a]
    return tuple(sorted({tuple(sorted(members)) for members in part.values()}))


def choose_part(
    parts: Sequence[tuple[int, ...]], photos: Mapping[int, FlatPhoto], base: int | None
) -> tuple[tuple[int, ...], int]:
    """The component that becomes the page, and its base photo, the one with most print.

    With `base` it is the component of that photo. Else it is the one with most photos, then with most print.

    Raises
    ------
    NotOverlapping
        When the component is a single photo.
    """

    def print_of(part: tuple[int, ...]) -> tuple[int, float]:
        return len(part), sum(photos[index].weight for index in part)

    chosen = max(parts, key=print_of) if base is None else next(part for part in parts if base in part)
    if len(chosen) < 2:
        names = ", ".join(f"images[{index}]" for index in sorted(photos))
        who = f"no two of {names} show" if base is None else f"images[{base}], the base, does not show"
        raise NotOverlapping(
            f"{who} the same part of a page. Photograph the page in pieces that overlap by a fifth or more, sharp "
            "enough to read."
        )
    return chosen, max(chosen, key=lambda index: photos[index].weight) if base is None else base


def overlap_fraction(a: FlatPhoto, b: FlatPhoto, H_a_b: Homography, points: int = 60) -> float:
    """Overlap area divided by the smaller of both shown areas, 0-1; `H_a_b` maps flat pixels of b to a."""
    return min(
        1.0, max(_share_within(b, a, H_a_b, points), _share_within(a, b, np.linalg.inv(H_a_b), points))
    )


def _share_within(of: FlatPhoto, other: FlatPhoto, H_other_of: Homography, points: int) -> float:
    seen = _shown_points(of, points)
    if len(seen) == 0:
        return 0.0
    return float(is_shown(other, transform_points(H_other_of, seen)).mean())


def is_shown(photo: FlatPhoto, flat: Points) -> NDArray[np.bool_]:
    """Which of the flat pixels (N, 2) the photo's view shows."""
    width, height = photo.size
    with np.errstate(invalid="ignore"):
        inside = (flat >= 0).all(axis=1) & (flat[:, 0] <= width - 1) & (flat[:, 1] <= height - 1)
    at = np.round(np.where(inside[:, None], flat, 0.0)).astype(int)
    return np.asarray(inside & photo.shown[at[:, 1], at[:, 0]])


def _shown_points(photo: FlatPhoto, points: int) -> Points:
    """Grid of flat pixels (N, 2) in the shown part of the view."""
    width, height = photo.size
    x, y = np.linspace(0, width - 1, points), np.linspace(0, height - 1, points)
    rows, columns = np.nonzero(photo.shown[np.ix_(np.round(y).astype(int), np.round(x).astype(int))])
    return np.stack([x[columns], y[rows]], axis=-1)

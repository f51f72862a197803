"""A bent page with straight sides: the bends of its sides that the surface leaves are removed from the margins.

Text determines a smooth surface where it is printed; in the margins the surface is extrapolated, and the sides of the
sheet show its error. A shift moves every side to its straight line and falls to zero towards the text.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from services.arrays import Floats, Points, Vector
from services.geometry.page_map import PageMap

INVERSE_STEPS = 4
"""The shift is small and smooth: v + shift(v) is inverted by iteration."""


@dataclass(frozen=True, slots=True)
class StraightSidesParameters:
    """Which sides are moved. Lengths are shares of the text's size."""

    min_points: int = 12
    bins: int = 16
    """Places along a side at which its bend is taken."""
    least_depth: float = 0.03
    """Depth within which the shift fades out where text is printed up to the side."""
    max_shift: float = 0.04
    """Sides that are bent further are those of another surface: nothing is moved."""
    max_slope: float = 0.035
    """Of a side against the page's axis: skewed print keeps the sides of its sheet skewed."""


@dataclass(frozen=True, slots=True, eq=False)
class SideShift:
    """How one side is moved: at places `along` it by `shift`, less towards the text, not at all beyond `depth`.

    `axis` is that of the shift (0: left and right sides, 1: top and bottom), `place` where the straight side lies,
    `inward` 1 or -1: the direction from it to the text.
    """

    axis: int
    place: float
    inward: float
    depth: float
    along: Vector
    shift: Vector

    def at(self, page: Points) -> Vector:
        """Shift (N,) along `axis` at page points (N, 2)."""
        away = self.inward * (page[:, self.axis] - self.place) / self.depth
        fade = np.clip(1 - away, 0.0, 1.0) ** 2
        return np.asarray(fade * np.interp(page[:, 1 - self.axis], self.along, self.shift))


@dataclass(frozen=True, slots=True, eq=False)
class StraightSidedPage:
    """A `PageMap`: `base`, then the shifts of its sides."""

    base: PageMap
    sides: tuple[SideShift, ...]

    def shift(self, page: Points) -> Points:
        """Shift (N, 2) of page points (N, 2) of the base."""
        total = np.zeros_like(page)
        for side in self.sides:
            total[:, side.axis] += side.at(page)
        return total

    def to_page(self, centred: Points) -> Points:
        """See `PageMap`."""
        page = self.base.to_page(centred)
        return np.asarray(page + self.shift(page))

    def to_photo(self, page: Points) -> Points:
        """See `PageMap`."""
        before = page.copy()
        for _ in range(INVERSE_STEPS):
            before = page - self.shift(before)
        return self.base.to_photo(before)

    def jacobians(self, centred: Points) -> Floats:
        """See `PageMap`."""
        page, J = self.base.to_page(centred), self.base.jacobians(centred)
        step = 1e-3 * min(side.depth for side in self.sides)
        rate = np.stack(
            [(self.shift(page + d) - self.shift(page - d)) / (2 * step) for d in step * np.eye(2)], axis=2
        )
        return np.asarray(J + rate @ J)


def straighten_sides(
    page_map: PageMap, sides: tuple[Points, Points, Points, Points], characters: Points
) -> PageMap:
    """`page_map` with straight `sides`; `page_map` itself where a side is too far off to be the sheet's.

    Parameters
    ----------
    sides
        Points (N, 2) of the sheet's four sides in any order, centred; empty where a side is not seen.
    characters
        (N, 2) centres of the printed characters, centred.
    """
    p = StraightSidesParameters()
    text = page_map.to_page(characters)
    text = text[np.isfinite(text).all(axis=1)]
    if len(text) < p.min_points:
        return page_map
    low, high = np.percentile(text, [1, 99], axis=0)
    size = float((high - low).max())
    found: list[SideShift] = []
    for points in sides:
        page = page_map.to_page(points)
        page = page[np.isfinite(page).all(axis=1)]
        if len(page) < p.min_points:
            continue
        side = _side_shift(page, low, high, size, p)
        if side is None:
            return page_map
        found.append(side)
    return StraightSidedPage(page_map, tuple(found)) if found else page_map


def _side_shift(
    page: Points, low: Vector, high: Vector, size: float, p: StraightSidesParameters
) -> SideShift | None:
    """The shift that straightens a side with the points `page` (N, 2), for text from `low` to `high` (u, v)."""
    middle = page.mean(axis=0)
    way = np.linalg.svd(page - middle, full_matrices=False)[2][0]
    axis = 0 if abs(way[1]) > abs(way[0]) else 1
    if abs(way[axis]) > p.max_slope * abs(way[1 - axis]):
        return None
    place = float(np.median(page[:, axis]))
    inward = 1.0 if place < (low[axis] + high[axis]) / 2 else -1.0
    edge = low[axis] if inward > 0 else high[axis]
    depth = max(inward * float(edge - place), p.least_depth * size)
    along, shift = _profile(page[:, 1 - axis], place - page[:, axis], p.bins)
    if np.abs(shift).max() > min(p.max_shift * size, depth / 3):
        return None
    return SideShift(axis, place, inward, depth, along, shift)


def _profile(along: Vector, values: Vector, bins: int) -> tuple[Vector, Vector]:
    """Medians of `values` (N,) in bins `along` a side, and where these lie."""
    edges = np.linspace(along.min(), along.max(), bins + 1)
    number: NDArray[np.intp] = np.clip(np.searchsorted(edges, along, "right") - 1, 0, bins - 1)
    held = np.unique(number)
    return (
        np.array([np.median(along[number == k]) for k in held]),
        np.array([np.median(values[number == k]) for k in held]),
    )

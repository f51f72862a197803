"""A small smooth field for the waves of text lines that a sheet's shape leaves: soaked paper, facets below its cells.

The points of the lines show by how much v must be shifted on the flat page. A smooth field through these shifts, small
by construction, is added to the map of the surface. Points are not moved along the lines: these show nothing of it.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve
from scipy.sparse import csr_array, hstack

from services.arrays import Floats, Points, Vector
from services.geometry.page_map import PageMap
from services.robust import cauchy_weights
from services.sheet.developable.observations import LineObservations

LEVEL_PRIOR = 1e-6
"""Keeps a line without points solvable."""


# Lengths are multiples of the text height.
DEVIATION = 0.06
"""Deviation of a line's point: a smaller shift is not needed."""
SIZE = 0.6
"""Deviation of the coefficients: the field is small, or the surface is wrong."""
MIN_POINTS = 60
ITERATIONS = 6


@dataclass(frozen=True, slots=True)
class ResidualParameters:
    """Lengths are multiples of the text height."""

    columns: int = 12
    rows: int = 10
    """Cubic B-splines over the text along u and v."""
    bend: float = 0.12
    """Deviation of the second differences of neighbouring coefficients."""
    max_shift: float = 1.5
    """Largest shift: more is not a crease but an error of the surface or of the lines, and the field is left out."""


@dataclass(frozen=True, slots=True, eq=False)
class MorphedPage:
    """A `PageMap`: `surface`, then v + shift(u, v) with the tensor-product spline `coefficients` (rows, columns).

    The field spans `low` to `high` (u, v) and is constant beyond.
    """

    surface: PageMap
    coefficients: Floats
    low: Points
    high: Points

    def shift(self, page: Points) -> Vector:
        """Shift (N,) of v at page points (N, 2) of the surface."""
        return self._down(self._across(page[:, 0]), page[:, 1])

    def _across(self, u: Vector) -> Floats:
        """Coefficients (N, rows) of the splines along v at each u (N,)."""
        first, values = _local_splines(u, float(self.low[0]), float(self.high[0]), self.coefficients.shape[1])
        by_column = np.ascontiguousarray(self.coefficients.T)
        found = values[0][:, None] * by_column[first]
        for k in (1, 2, 3):
            found += values[k][:, None] * by_column[first + k]
        return np.asarray(found)

    def _down(self, coefficients: Floats, v: Vector) -> Vector:
        """Shift (N,) at each v (N,), of which there are coefficients (N, rows)."""
        first, values = _local_splines(v, float(self.low[1]), float(self.high[1]), coefficients.shape[1])
        n = np.arange(len(v))
        return np.asarray(sum(values[k] * coefficients[n, first + k] for k in range(4)))

    def to_page(self, centred: Points) -> Points:
        """See `PageMap`."""
        page = self.surface.to_page(centred)
        return np.stack([page[:, 0], page[:, 1] + self.shift(page)], axis=1)

    def to_photo(self, page: Points) -> Points:
        """See `PageMap`. The shift is small and smooth, so v + shift(v) is inverted by iteration."""
        before, coefficients = page.copy(), self._across(page[:, 0])
        for _ in range(3):
            before[:, 1] = page[:, 1] - self._down(coefficients, before[:, 1])
        return self.surface.to_photo(before)

    def jacobians(self, centred: Points) -> Floats:
        """See `PageMap`."""
        page, J = self.surface.to_page(centred), self.surface.jacobians(centred)
        moved, step = J.copy(), 1e-4 * float(np.linalg.norm(self.high - self.low))
        for axis in (0, 1):
            d = step * np.eye(2)[axis]
            rate = (self.shift(page + d) - self.shift(page - d)) / (2 * step)
            moved[:, 1] += rate[:, None] * J[:, axis]
        return moved


def _local_splines(x: Vector, low: float, high: float, count: int) -> tuple[NDArray[np.intp], list[Vector]]:
    """Number (N,) of the first of the four cubic B-splines over [low, high] that are not zero at x, and their values.

    There are `count` of them, on equal spans and clamped at both ends; beyond the ends they are constant.
    """
    knots = np.concatenate([np.full(3, low), np.linspace(low, high, count - 2), np.full(3, high)])
    inside = np.clip(np.nan_to_num(x, nan=low), low, high)
    first = np.minimum(((inside - low) * ((count - 3) / (high - low))).astype(np.intp), count - 4)
    # De Boor's recursion, from the one spline of degree 0 to the four of degree 3.
    after = [knots[first + 3 + j] - inside for j in (1, 2, 3)]
    before = [inside - knots[first + 4 - j] for j in (1, 2, 3)]
    values: list[Vector] = [np.ones(len(inside))]
    for degree in (1, 2, 3):
        carried, raised = np.zeros(len(inside)), []
        for j in range(degree):
            share = values[j] / (after[j] + before[degree - 1 - j])
            raised.append(carried + after[j] * share)
            carried = before[degree - 1 - j] * share
        values = [*raised, carried]
    return first, values


def _field_terms(page: Points, low: Points, high: Points, p: ResidualParameters) -> csr_array:
    """Shares (N, rows * columns) of the coefficients in the shift at page points (N, 2)."""
    c, along = _local_splines(page[:, 0], float(low[0]), float(high[0]), p.columns)
    r, down = _local_splines(page[:, 1], float(low[1]), float(high[1]), p.rows)
    places = [(r + i) * p.columns + c + j for i in range(4) for j in range(4)]
    values = [down[i] * along[j] for i in range(4) for j in range(4)]
    ends = np.arange(0, 16 * len(page) + 1, 16)
    shape = (len(page), p.rows * p.columns)
    return csr_array((np.stack(values, axis=1).ravel(), np.stack(places, axis=1).ravel(), ends), shape=shape)


def morph_to_lines(
    surface: PageMap,
    lines: LineObservations,
    held: Points | None = None,
    parameters: ResidualParameters | None = None,
) -> PageMap:
    """The surface with the smooth residual of its `lines`; without it if they are few or it is too large.

    The field spans the lines, or the page points `held` (M, 2), which stay where they are.
    """
    p = parameters or ResidualParameters()
    if len(lines.points) < MIN_POINTS:
        return surface
    page = surface.to_page(lines.points)
    height = lines.text_height * float(
        np.median(np.linalg.norm(surface.jacobians(lines.points)[:, 1], axis=1))
    )
    spanned = page if held is None else held
    low, high = spanned.min(axis=0), spanned.max(axis=0)
    if not (np.isfinite(page).all() and np.isfinite(height)) or (high - low).min() < 2 * height:
        return surface
    # v + shift = level of the line, in text heights. The levels are free.
    field, count = _field_terms(page, low, high, p), p.rows * p.columns
    each = np.arange(len(page))
    levels = csr_array((np.full(len(page), -1.0), (each, lines.index)), shape=(len(page), lines.count))
    terms = hstack([field, levels], format="csr")
    penalty = np.zeros((terms.shape[1], terms.shape[1]))
    penalty[:count, :count] = _penalty(p) * (DEVIATION / p.bend) ** 2
    penalty[:count, :count] += np.eye(count) * (DEVIATION / SIZE) ** 2
    penalty[count:, count:] = np.eye(lines.count) * LEVEL_PRIOR
    if held is not None:
        rim = _field_terms(held, low, high, p)
        penalty[:count, :count] += (rim.T @ rim).toarray()
    usual = np.bincount(lines.index, page[:, 1], lines.count) / np.maximum(np.bincount(lines.index), 1)
    wanted = (usual[lines.index] - page[:, 1]) / height
    weight: Vector = np.ones(len(page))
    found = np.zeros(terms.shape[1])
    for _ in range(ITERATIONS):
        weighted = terms * weight[:, None]
        information = (weighted.T @ terms).toarray() + penalty
        found = np.asarray(solve(information, weighted.T @ wanted, assume_a="pos"))
        weight = cauchy_weights((wanted - terms @ found) / DEVIATION, 2.0)
    coefficients = found[:count]
    if np.abs(coefficients).max() > p.max_shift:
        return surface
    return MorphedPage(surface, height * coefficients.reshape(p.rows, p.columns), low, high)


def _penalty(p: ResidualParameters) -> Floats:
    """Second differences of the coefficients along both axes, squared."""
    along = np.diff(np.eye(p.columns), 2, axis=0)
    down = np.diff(np.eye(p.rows), 2, axis=0)
    return np.asarray(np.kron(np.eye(p.rows), along.T @ along) + np.kron(down.T @ down, np.eye(p.columns)))

"""A small smooth field for the waves of text lines that a developable sheet leaves (creases, soaked paper).

The points of the lines show by how much v must be shifted on the flat page. A smooth field through these shifts, small
by construction, is added to the map of the surface. Points are not moved along the lines: these show nothing of it.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from services.arrays import Floats, Points, Vector
from services.geometry.page_map import PageMap
from services.robust import cauchy_weights
from services.sheet.developable.observations import LineObservations
from services.sheet.developable.surface import DevelopableSurface


@dataclass(frozen=True, slots=True)
class ResidualParameters:
    """Lengths are multiples of the text height."""

    columns: int = 12
    rows: int = 10
    """Cubic B-splines over the text along u and v."""
    deviation: float = 0.06
    """Deviation of a line's point: a smaller shift is not needed."""
    bend: float = 0.12
    """Deviation of the second differences of neighbouring coefficients."""
    size: float = 0.6
    """Deviation of the coefficients: the field is small, or the surface is wrong."""
    max_shift: float = 1.5
    """Largest shift: more is not a crease but an error of the surface or of the lines, and the field is left out."""
    min_points: int = 60
    iterations: int = 6


@dataclass(frozen=True, slots=True, eq=False)
class MorphedPage:
    """A `PageMap`: `surface`, then v + shift(u, v) with the tensor-product spline `coefficients` (rows, columns).

    The field spans `low` to `high` (u, v) and is constant beyond.
    """

    surface: DevelopableSurface
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
        at = self.surface.unroll(centred)
        step = 1e-4 * float(np.linalg.norm(self.high - self.low))
        J = at.jacobians.copy()
        for axis in (0, 1):
            d = step * np.eye(2)[axis]
            rate = (self.shift(at.page + d) - self.shift(at.page - d)) / (2 * step)
            J[:, 1] += rate[:, None] * at.jacobians[:, axis]
        return J


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


def _splines(x: Vector, low: float, high: float, count: int) -> Floats:
    """Cubic B-splines (N, count) over [low, high], constant beyond."""
    first, values = _local_splines(x, low, high, count)
    dense = np.zeros((len(x), count))
    for k in range(4):
        dense[np.arange(len(x)), first + k] = values[k]
    return dense


def morph_to_lines(surface: DevelopableSurface, lines: LineObservations) -> PageMap:
    """The surface with the smooth residual of its `lines`; without it if they are few or it is too large."""
    p = ResidualParameters()
    if len(lines.points) < p.min_points:
        return surface
    at = surface.unroll(lines.points)
    height = lines.text_height * float(np.median(np.linalg.norm(at.jacobians[:, 1], axis=1)))
    low, high = at.page.min(axis=0), at.page.max(axis=0)
    if not np.isfinite(low).all() or (high - low).min() < 2 * height:
        return surface
    across = _splines(at.page[:, 0], float(low[0]), float(high[0]), p.columns)
    down = _splines(at.page[:, 1], float(low[1]), float(high[1]), p.rows)
    design = np.einsum("nr,nc->nrc", down, across).reshape(len(down), -1)
    # The level of each line is free: averages over its points are subtracted on both sides.
    count = np.maximum(np.bincount(lines.index, minlength=lines.count), 1)

    def without_level(values: Floats, weight: Vector) -> Floats:
        total = np.maximum(np.bincount(lines.index, weight, minlength=lines.count), 1e-12)
        sums = np.zeros((lines.count, values.shape[1]))
        np.add.at(sums, lines.index, values * weight[:, None])
        return np.asarray(values - (sums / total[:, None])[lines.index])

    v = at.page[:, 1]
    level = (np.bincount(lines.index, v, minlength=lines.count) / count)[lines.index]
    weight: Vector = np.ones(len(v))
    penalty = _penalty(p) * (p.deviation / p.bend) ** 2
    penalty += np.eye(design.shape[1]) * (p.deviation / p.size) ** 2
    coefficients = np.zeros(design.shape[1])
    for _ in range(p.iterations):
        A = without_level(design, weight)
        b = -without_level((v - level)[:, None], weight)[:, 0] / height
        coefficients = np.linalg.solve((A * weight[:, None]).T @ A + penalty, (A * weight[:, None]).T @ b)
        rest = (b - A @ coefficients) / p.deviation
        weight = cauchy_weights(rest, 2.0)
    if np.abs(coefficients).max() > p.max_shift:
        return surface
    return MorphedPage(surface, height * coefficients.reshape(p.rows, p.columns), low, high)


def _penalty(p: ResidualParameters) -> Floats:
    """Second differences of the coefficients along both axes, squared."""
    along = np.diff(np.eye(p.columns), 2, axis=0)
    down = np.diff(np.eye(p.rows), 2, axis=0)
    return np.asarray(np.kron(np.eye(p.rows), along.T @ along) + np.kron(down.T @ down, np.eye(p.columns)))

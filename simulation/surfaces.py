"""Developable surfaces that a sheet can take: each an isometry sheet (s, t) -> (X, Y, Z), and its inverse.

The unit of length is half of the page's width. The surface frame has X right, Y down and Z away from the
viewer; the sheet's centre is placed at (or touches) the origin. A negative Z comes towards the viewer.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline

from simulation.flat_page import Points

Points3 = NDArray[np.float64]
"""(N, 3) float64."""

_DIRECTRIX_REACH = 1.1
"""The polynomial is followed a little beyond the sheet's edge, then continued along its tangent."""


class Shape(Protocol):
    """What the renderer and the truth need of a surface."""

    def place(self, sheet: Points) -> Points3:
        """Surface points of sheet points (N, 2)."""
        ...

    def tangents(self, sheet: Points) -> tuple[Points3, Points3]:
        """Orthonormal U, V (N, 3): where the sheet's axes s and t go. U x V is the normal N."""
        ...

    def rulings(self, sheet: Points) -> Points3:
        """Unit direction (N, 3) of the ruling through each point, pointing down the page."""
        ...

    def meet(self, origin: Points3, directions: Points3) -> Points:
        """Sheet points (N, 2) where rays from `origin` (3,) meet the front side; NaN where they miss it."""
        ...


@dataclass(frozen=True, slots=True)
class Plane:
    """The flat sheet (a cylinder with S = 0); its rulings are taken parallel to Y."""

    def place(self, sheet: Points) -> Points3:
        """See `Shape`."""
        return np.column_stack([sheet, np.zeros(len(sheet))])

    def tangents(self, sheet: Points) -> tuple[Points3, Points3]:
        """See `Shape`."""
        return _repeat((1.0, 0.0, 0.0), len(sheet)), _repeat((0.0, 1.0, 0.0), len(sheet))

    def rulings(self, sheet: Points) -> Points3:
        """See `Shape`."""
        return _repeat((0.0, 1.0, 0.0), len(sheet))

    def meet(self, origin: Points3, directions: Points3) -> Points:
        """See `Shape`."""
        with np.errstate(divide="ignore", invalid="ignore"):
            reach = -origin[2] / directions[:, 2]
            met: Points = origin[:2] + reach[:, None] * directions[:, :2]
        met[~((reach > 0) & (directions[:, 2] > 0))] = np.nan
        return met


@dataclass(frozen=True, slots=True)
class Cylinder:
    """Generatrix parallel to Y, directrix Z(X) = sum s_i X^i (Appendix A, Figure A.2).

    `directrix` holds s_0, s_1, ..., s_n with X and Z in half page widths. Arc length is signed, and counted
    from X = 0, so the sheet's middle stays over the origin.
    """

    directrix: tuple[float, ...]

    def place(self, sheet: Points) -> Points3:
        """See `Shape`."""
        x, z, _ = _directrix(self.directrix).at_arc(sheet[:, 0])
        return np.column_stack([x, sheet[:, 1], z])

    def tangents(self, sheet: Points) -> tuple[Points3, Points3]:
        """See `Shape`. U is the appendix' (1, 0, dZ/dX) made unit."""
        _, _, slope = _directrix(self.directrix).at_arc(sheet[:, 0])
        unit = 1.0 / np.hypot(1.0, slope)
        return np.column_stack([unit, np.zeros(len(sheet)), slope * unit]), _repeat(
            (0.0, 1.0, 0.0), len(sheet)
        )

    def rulings(self, sheet: Points) -> Points3:
        """See `Shape`."""
        return _repeat((0.0, 1.0, 0.0), len(sheet))

    def meet(self, origin: Points3, directions: Points3) -> Points:
        """See `Shape`. The generatrix drops out of the search: it is one root in the Z-X plane."""
        curve = _directrix(self.directrix)
        x = curve.seen_at(origin[0], origin[2], directions[:, 0], directions[:, 2])
        z, slope = curve.height(x)
        dx, dz = directions[:, 0], directions[:, 2]
        reach = ((x - origin[0]) * dx + (z - origin[2]) * dz) / (dx**2 + dz**2)
        met = np.column_stack([curve.arc(x), origin[1] + reach * directions[:, 1]])
        front = dz - slope * dx > 0
        met[~((reach > 0) & front)] = np.nan
        return met


class _Directrix:
    """A polynomial curve on the Z-X plane with its arc length, continued straight beyond its reach."""

    def __init__(self, coefficients: tuple[float, ...]) -> None:
        self._polynomial = np.polynomial.Polynomial(coefficients or (0.0,))
        self._slope = self._polynomial.deriv()
        self._bend = self._slope.deriv()
        # 5-point Gauss-Legendre on each of 1000 spans: exact far below a thousandth of a pixel.
        knots = np.linspace(-_DIRECTRIX_REACH, _DIRECTRIX_REACH, 1001)
        nodes, weights = np.polynomial.legendre.leggauss(5)
        middle, half = (knots[1:] + knots[:-1]) / 2, (knots[1:] - knots[:-1]) / 2
        speeds = np.hypot(1.0, self._slope(middle[:, None] + half[:, None] * nodes))
        arcs = np.concatenate([[0.0], np.cumsum(half * (speeds @ weights))])
        arcs -= arcs[len(knots) // 2]
        speed_at_knots = np.hypot(1.0, self._slope(knots))
        self._knots, self._arcs = knots, arcs
        self._x_of_arc = CubicHermiteSpline(arcs, knots, 1.0 / speed_at_knots)
        self._arc_of_x = CubicHermiteSpline(knots, arcs, speed_at_knots)

    def height(self, x: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Z and dZ/dX."""
        inside = np.clip(x, -_DIRECTRIX_REACH, _DIRECTRIX_REACH)
        slope = self._slope(inside)
        return self._polynomial(inside) + slope * (x - inside), slope

    def arc(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Signed arc length from X = 0."""
        inside = np.clip(x, -_DIRECTRIX_REACH, _DIRECTRIX_REACH)
        arc: NDArray[np.float64] = self._arc_of_x(inside) + np.hypot(1.0, self._slope(inside)) * (x - inside)
        return arc

    def at_arc(
        self, arc: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """X, Z and dZ/dX at signed arc lengths (the reverse look-up of the appendix)."""
        inside = np.clip(arc, self._arcs[0], self._arcs[-1])
        x = self._x_of_arc(inside)
        x = x + (arc - inside) / np.hypot(1.0, self._slope(np.clip(x, -_DIRECTRIX_REACH, _DIRECTRIX_REACH)))
        return x, *self.height(x)

    def seen_at(
        self, origin_x: float, origin_z: float, dx: NDArray[np.float64], dz: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """X where rays meet the curve: bearings interpolated for a start, then Newton's method."""
        far = np.array([-100.0, 100.0])
        x_table = np.concatenate([far[:1], self._knots, far[1:]])
        z_table, _ = self.height(x_table)
        bearing = np.unwrap(np.arctan2(x_table - origin_x, z_table - origin_z))
        # A page that does not hide itself has rising bearings; `maximum` keeps the rest searchable.
        x: NDArray[np.float64] = np.interp(np.arctan2(dx, dz), np.maximum.accumulate(bearing), x_table)
        for _ in range(4):
            z, slope = self.height(x)
            miss = (x - origin_x) * dz - (z - origin_z) * dx
            rate = dz - slope * dx
            x = x - np.divide(miss, rate, out=np.zeros_like(x), where=np.abs(rate) > 1e-9)
        return x


@lru_cache(maxsize=64)
def _directrix(coefficients: tuple[float, ...]) -> _Directrix:
    return _Directrix(coefficients)


def _repeat(vector: tuple[float, float, float], count: int) -> Points3:
    return np.tile(np.array(vector), (count, 1))

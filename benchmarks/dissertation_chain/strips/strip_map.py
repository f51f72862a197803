"""The way between the flat page and the photo by a lattice of control points."""

from dataclasses import dataclass, field

import numpy as np
from scipy.interpolate import RectBivariateSpline
from scipy.spatial import cKDTree

from services.arrays import Floats, Points, Vector

_ITERATIONS = 12
_TOLERANCE = 1e-8
_ACCEPTED = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class StripMap:
    """A `PageMap` by bicubic splines through `photo` (rows, columns, 2), centred unit coordinates.

    Node (r, c) is page point (`u` (columns,), `v` (rows,)), both increasing. The model ends with the lattice.
    """

    u: Vector
    v: Vector
    photo: Floats
    _splines: tuple[RectBivariateSpline, RectBivariateSpline] = field(init=False)

    def __post_init__(self) -> None:
        x, y = (RectBivariateSpline(self.v, self.u, self.photo[..., k]) for k in (0, 1))
        object.__setattr__(self, "_splines", (x, y))

    def to_photo(self, page: Points) -> Points:
        """Photo points (N, 2) of page points (N, 2); NaN beyond the lattice."""
        page = np.asarray(page, np.float64)
        inside = self._inside(page)
        seen = self._evaluate(page)
        return np.where(inside[:, None], seen, np.nan)

    def to_page(self, centred: Points) -> Points:
        """Page points (N, 2) of photo points (N, 2), by Newton's method from the nearest node; NaN beyond."""
        centred = np.asarray(centred, np.float64)
        if len(centred) == 0:
            return np.zeros((0, 2))
        known = np.all(np.isfinite(centred), axis=1)
        goal = np.where(known[:, None], centred, 0.0)
        grid_v, grid_u = np.meshgrid(self.v, self.u, indexing="ij")
        nodes = np.column_stack([grid_u.ravel(), grid_v.ravel()])
        _, nearest = cKDTree(self.photo.reshape(-1, 2)).query(goal)
        page = nodes[nearest]
        low, high = np.array([self.u[0], self.v[0]]), np.array([self.u[-1], self.v[-1]])
        for _ in range(_ITERATIONS):
            missing = goal - self._evaluate(page)
            if np.max(np.abs(missing)) < _TOLERANCE:
                break
            page = np.clip(page + _solve(self._derivatives(page), missing), low, high)
        reached = np.max(np.abs(goal - self._evaluate(page)), axis=1) < _ACCEPTED
        return np.where((reached & known)[:, None], page, np.nan)

    def jacobians(self, centred: Points) -> Floats:
        """Derivatives (N, 2, 2) d page / d photo at photo points (N, 2); NaN beyond the lattice."""
        page = self.to_page(centred)
        found = np.all(np.isfinite(page), axis=1)
        forward = self._derivatives(np.where(found[:, None], page, [self.u[0], self.v[0]]))
        determinant = np.linalg.det(forward)
        found &= np.abs(determinant) > 1e-12
        inverse = np.linalg.inv(np.where(found[:, None, None], forward, np.eye(2)))
        return np.where(found[:, None, None], inverse, np.nan)

    def _inside(self, page: Points) -> Floats:
        x, y = page[:, 0], page[:, 1]
        return np.asarray((x >= self.u[0]) & (x <= self.u[-1]) & (y >= self.v[0]) & (y <= self.v[-1]))

    def _evaluate(self, page: Points) -> Points:
        return np.column_stack([spline.ev(page[:, 1], page[:, 0]) for spline in self._splines])

    def _derivatives(self, page: Points) -> Floats:
        """d photo / d page (N, 2, 2)."""
        rows = [
            [spline.ev(page[:, 1], page[:, 0], dx=0, dy=1), spline.ev(page[:, 1], page[:, 0], dx=1, dy=0)]
            for spline in self._splines
        ]
        return np.moveaxis(np.array(rows), -1, 0)


def _solve(matrices: Floats, right: Floats) -> Floats:
    """Solutions (N, 2) of 2 x 2 systems; no step where one is singular."""
    (a, b), (c, d) = np.moveaxis(matrices, 0, -1)
    determinant = a * d - b * c
    safe = np.where(np.abs(determinant) > 1e-12, determinant, np.inf)
    x, y = right[:, 0], right[:, 1]
    return np.column_stack([(d * x - b * y) / safe, (a * y - c * x) / safe])

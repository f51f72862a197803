"""A sheet of paper as a mesh in space, seen by a pin-hole camera.

The flat sheet is a regular grid of `rows` x `columns` nodes; node (r, c) lies at X[r, c] in the camera frame (centred
unit coordinates: x right, y down, z forward, a point X is seen at f X / Z). Between nodes the sheet is bilinear. Grid
coordinates (c, r) and page coordinates (u, v) differ by the mesh's step, its aspect, and the page's origin.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from services.arrays import Floats, Points, Vector
from services.kernels.library import MeshNodes, Search, address, find_kernels

NEWTON_STEPS = 8
LONGEST_STEP = 2.0
"""Longest step of Newton's method in cells: beyond it the linear model is not valid."""
FOUND = 1e-8
"""Newton's method ends if the residuals of all points are smaller, in photo units: a thousandth of the deviation of an
observation."""
LOCATED = 1e-3
"""Photo units within which a point counts as found."""
LEAST_ROWS = 5
"""Least number of rows of nodes."""
MOST = 0.8
"""Share of the points, below which Newton's method goes on with those alone that are not found yet."""
REACH = 0.75
"""Cells by which the sheet is continued, straight, beyond its border."""


@dataclass(frozen=True, slots=True, eq=False)
class PlacedPoints:
    """Points of a mesh of so many `columns` at grid coordinates (N, 2).

    `first` (N,) is the number of each cell's first node, `across` and `down` (N,) the place in the cell, 0-1; `X`,
    `X_c`, `X_r` (N, 3) are the point in space and its derivatives by column and row. The points come last in memory:
    a fit places thousands of them at every step, and loops over three coordinates are slow.
    """

    columns: int
    first: NDArray[np.intp]
    across: Vector
    down: Vector
    X: Floats
    X_c: Floats
    X_r: Floats

    @property
    def nodes(self) -> NDArray[np.intp]:
        """Numbers (N, 4) of the cells' nodes."""
        return np.asarray(self.first[:, None] + np.array([0, 1, self.columns, self.columns + 1]))

    @property
    def weights(self) -> Floats:
        """Shares (N, 4) that these nodes have in the points."""
        s, t = self.across, self.down
        return np.stack([(1 - s) * (1 - t), s * (1 - t), (1 - s) * t, s * t], axis=1)


@dataclass(frozen=True, slots=True, eq=False)
class SheetMesh:
    """A `PageMap`: the mesh `nodes` (rows, columns, 3), seen with `focal`.

    Columns are `step` page units apart, rows `step` times `aspect`; `origin` is the page point (u, v) of node (0, 0).
    """

    nodes: Floats
    focal: float
    step: float
    aspect: float
    origin: tuple[float, float]

    @property
    def rows(self) -> int:
        """Number of rows of nodes."""
        return int(self.nodes.shape[0])

    @property
    def columns(self) -> int:
        """Number of columns of nodes."""
        return int(self.nodes.shape[1])

    @property
    def size(self) -> tuple[float, float]:
        """Width and height of the sheet in page units."""
        return (self.columns - 1) * self.step, (self.rows - 1) * self.step * self.aspect

    @property
    def aspect_ratio(self) -> float:
        """Width over height of the sheet."""
        width, height = self.size
        return width / height

    def resampled(self, columns: int) -> "SheetMesh":
        """The same sheet with `columns` columns of nodes, and rows in proportion: nodes between nodes, bilinear."""
        if columns == self.columns:
            return self
        rows = max(round((self.rows - 1) * (columns - 1) / (self.columns - 1)), LEAST_ROWS - 1) + 1
        c, r = np.linspace(0, self.columns - 1, columns), np.linspace(0, self.rows - 1, rows)
        X = self.place(np.stack(np.meshgrid(c, r), axis=-1).reshape(-1, 2)).X
        width, height = self.size
        step = width / (columns - 1)
        aspect = height / (rows - 1) / step
        return SheetMesh(X.reshape(rows, columns, 3), self.focal, step, aspect, self.origin)

    def for_kernels(self) -> tuple[MeshNodes, Floats]:
        """The mesh as kernels take it, and the array that holds its nodes."""
        nodes = np.ascontiguousarray(self.nodes, np.float64)
        return MeshNodes(address(nodes), self.rows, self.columns, self.focal), nodes

    def deepened(self, factor: float) -> "SheetMesh":
        """The sheet with `factor` times its depth, seen in the same place with as much longer a focal length."""
        return replace(self, nodes=self.nodes * np.array([1.0, 1.0, factor]), focal=self.focal * factor)

    def _steps(self) -> Vector:
        return np.array([self.step, self.step * self.aspect])

    def grid_of_page(self, page: Points) -> Points:
        """Grid coordinates (c, r) of page points (u, v), (N, 2) each."""
        return np.asarray((page - self.origin) / self._steps())

    def page_of_grid(self, grid: Points) -> Points:
        """Page points (u, v) of grid coordinates (c, r), (N, 2) each."""
        return np.asarray(grid * self._steps() + self.origin)

    def border(self) -> Points:
        """Page points (N, 2) of the border's nodes."""
        r, c = np.divmod(np.arange(self.rows * self.columns), self.columns)
        rim = (r == 0) | (r == self.rows - 1) | (c == 0) | (c == self.columns - 1)
        return self.page_of_grid(np.stack([c, r], axis=1)[rim].astype(np.float64))

    def place(self, grid: Points) -> PlacedPoints:
        """Points of the mesh at grid coordinates (N, 2); the border cells are continued beyond the mesh."""
        columns, rows = self.columns, self.rows
        c0 = np.clip(np.floor(grid[:, 0]), 0, columns - 2)
        r0 = np.clip(np.floor(grid[:, 1]), 0, rows - 2)
        s, t = grid[:, 0] - c0, grid[:, 1] - r0
        first = (r0 * columns + c0).astype(np.intp)
        X = np.ascontiguousarray(self.nodes.reshape(-1, 3).T)
        corner = X.take(first, axis=1)
        across, down = X.take(first + 1, axis=1) - corner, X.take(first + columns, axis=1) - corner
        twist = X.take(first + columns + 1, axis=1) - corner - across - down
        X_c, X_r = across + t * twist, down + s * twist
        return PlacedPoints(columns, first, s, t, (corner + s * X_c + t * down).T, X_c.T, X_r.T)

    def project(self, X: Floats) -> Points:
        """Photo points (N, 2) of points in space (N, 3)."""
        with np.errstate(divide="ignore", invalid="ignore"):
            seen = self.focal * X[:, :2] / X[:, 2:]
        seen[X[:, 2] <= 1e-6] = np.nan
        return np.asarray(seen)

    def derivatives(self, placed: PlacedPoints) -> Floats:
        """Derivatives (N, 2, 2) d photo / d grid; the points come last in memory."""
        X = placed.X.T
        seen = self.focal * X[:2] / X[2]
        found = np.empty((2, 2, X.shape[1]))
        for k, moved in enumerate((placed.X_c.T, placed.X_r.T)):
            found[:, k] = (self.focal * moved[:2] - seen * moved[2]) / X[2]
        return found.transpose(2, 0, 1)

    def locate(self, centred: Points, start: Points | None = None) -> Points:
        """Grid coordinates (N, 2) of photo points (N, 2), by Newton's method from `start`, or from the nearest node.

        NaN where the mesh is not seen within its reach.
        """
        if start is None:
            seen = self.project(self.nodes.reshape(-1, 3))
            known = np.flatnonzero(np.isfinite(seen).all(axis=1))
            _, nearest = cKDTree(seen[known]).query(np.nan_to_num(centred))
            start = np.stack(np.divmod(known[nearest], self.columns)[::-1], axis=1).astype(np.float64)
        kernels = find_kernels()
        if kernels is None:
            return self.locate_plain(centred, start)
        photo = np.ascontiguousarray(centred, np.float64)
        grid = np.array(np.broadcast_to(start, photo.shape), np.float64, order="C")
        mesh, _held = self.for_kernels()
        search = Search(NEWTON_STEPS, LONGEST_STEP, FOUND, MOST, 3 * REACH, LOCATED)
        if not kernels.locate_points(mesh, search, address(photo), len(photo), address(grid)):
            raise MemoryError
        return grid

    def locate_plain(self, centred: Points, start: Points) -> Points:
        """`locate` without a kernel."""
        limit = np.array([self.columns - 1, self.rows - 1]) + 3 * REACH
        grid, miss = start.copy(), np.full(len(centred), np.inf)
        # Most points are found after two steps; the few that the mesh does not show take all of them.
        sought = np.arange(len(centred))
        for number in range(NEWTON_STEPS + 1):
            placed = self.place(grid[sought])
            rest = centred[sought] - self.project(placed.X)
            miss[sought] = np.linalg.norm(rest, axis=1)
            far = ~(miss[sought] < FOUND)
            if number == NEWTON_STEPS or not far.any():
                break
            G = self.derivatives(placed)
            if far.sum() < MOST * len(far):
                sought, rest, G = sought[far], rest[far], G[far]
            step = solve_2x2(G, rest)
            length = np.linalg.norm(step, axis=1, keepdims=True)
            with np.errstate(invalid="ignore"):
                step *= np.minimum(1.0, LONGEST_STEP / np.maximum(length, 1e-12))
            grid[sought] = np.clip(grid[sought] + np.nan_to_num(step), -3 * REACH, limit)
        with np.errstate(invalid="ignore"):
            grid[~(miss < LOCATED)] = np.nan
        return np.asarray(grid)

    def to_page(self, centred: Points) -> Points:
        """See `PageMap`."""
        return self.page_of_grid(self.locate(centred))

    def to_photo(self, page: Points) -> Points:
        """See `PageMap`."""
        grid = self.grid_of_page(page)
        placed = self.place(np.nan_to_num(grid))
        seen = self.project(placed.X)
        limit = np.array([self.columns - 1, self.rows - 1]) + REACH
        with np.errstate(invalid="ignore"):
            known = ((grid >= -REACH) & (grid <= limit)).all(axis=1)
        facing = np.einsum("ni,ni->n", np.cross(placed.X_c, placed.X_r), placed.X) > 0
        seen[~(known & facing)] = np.nan
        return seen

    def jacobians(self, centred: Points) -> Floats:
        """See `PageMap`."""
        grid = self.locate(centred)
        G = self.derivatives(self.place(np.nan_to_num(grid)))
        J = np.linalg.inv(np.where(np.isfinite(G), G, np.eye(2))) * self._steps()[None, :, None]
        J[~np.isfinite(grid).all(axis=1)] = np.nan
        return np.asarray(J)


def solve_2x2(A: Floats, b: Floats) -> Floats:
    """Solutions (N, 2) of the systems A (N, 2, 2) x = b (N, 2); a singular one's is large, not an error."""
    det = A[:, 0, 0] * A[:, 1, 1] - A[:, 0, 1] * A[:, 1, 0]
    det = np.where(np.abs(det) < 1e-12, 1e-12, det)
    x = (A[:, 1, 1] * b[:, 0] - A[:, 0, 1] * b[:, 1]) / det
    return np.stack([x, (A[:, 0, 0] * b[:, 1] - A[:, 1, 0] * b[:, 0]) / det]).T


def invert_2x2(G: Floats) -> Floats:
    """Inverses (N, 2, 2); of a nearly singular matrix a large one."""
    det = G[:, 0, 0] * G[:, 1, 1] - G[:, 0, 1] * G[:, 1, 0]
    det = np.where(np.abs(det) < 1e-9, np.where(det < 0, -1e-9, 1e-9), det)
    swapped = np.stack([G[:, 1, 1], -G[:, 0, 1], -G[:, 1, 0], G[:, 0, 0]], axis=1).reshape(-1, 2, 2)
    return np.asarray(swapped / det[:, None, None])

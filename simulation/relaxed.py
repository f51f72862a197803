"""Sheets without a closed form: a height that is wanted, relaxed until the paper is hardly stretched."""

from collections.abc import Hashable
from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import LinearNDInterpolator, RectBivariateSpline
from scipy.linalg import solveh_banded
from scipy.sparse import csr_array, eye_array, kron, vstack

from simulation.flat_page import Points
from simulation.surfaces import Points3

_BEYOND = 0.16
"""Half page widths by which the relaxed sheet is larger than the page: what lies beside it is its continuation."""
_NEWTON_STEPS = 8
_PRECISION = 1e-10


class Heights(Hashable, Protocol):
    """What a sheet would look like if paper stretched; hashable."""

    @property
    def half_height(self) -> float:
        """Of the page, in half page widths."""
        ...

    def wanted(self, sheet: Points) -> NDArray[np.float64]:
        """Z (N,) of sheet points, half page widths."""
        ...


@dataclass(frozen=True, slots=True)
class Relaxation:
    """Weights of the relaxation, relative to those of stretch.

    cell: of the mesh, half page widths. Creases are about as soft, 6 mm on an A4 sheet; less would take
        seconds.
    pull: of the wanted height, at first; it falls by `fade` a step, so that what is left is nearly isometric.
    stiffness: against bending (second differences over the cell) where the sheet is nearly flat; it is given up
        where the sheet turns by more than `ridge_rad` over a cell: few sharp ridges, rather than many soft ones.
    softness: stiffness that ridges keep. Without it the paper is stretched at the corners of facets, by 20 %.
    steps: of the Gauss-Newton method. What is made is then stretched by 0.2 % RMS, 2.5 % at most.
    """

    cell: float = 0.06
    pull: float = 0.05
    fade: float = 0.5
    stiffness: float = 1e-3
    ridge_rad: float = 0.04
    softness: float = 5e-5
    steps: int = 7


CRUMPLED_PAPER = Relaxation()
"""Keeps facets of 10 degrees."""
FOLDED_PAPER = Relaxation(stiffness=1e-2, softness=2e-4)
"""Flat between its creases."""


@dataclass(frozen=True, slots=True)
class Relaxed:
    """A sheet as near to the wanted heights as paper allows; isometric but for the stretch that `stretch` tells."""

    heights: Heights
    relaxation: Relaxation = Relaxation()

    def place(self, sheet: Points) -> Points3:
        """See `Shape`."""
        return self._surface().at(sheet)

    def tangents(self, sheet: Points) -> tuple[Points3, Points3]:
        """See `Shape`. Where the paper is stretched, the pair of orthonormal vectors nearest to the derivatives."""
        across, down = self._surface().derivatives(sheet)
        normal = np.cross(across, down)
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        # Both are turned by half of the angle that they miss.
        a, b = (v / np.linalg.norm(v, axis=1, keepdims=True) for v in (across, down))
        between, beside = a + b, a - b
        between /= np.linalg.norm(between, axis=1, keepdims=True)
        beside /= np.linalg.norm(beside, axis=1, keepdims=True)
        return (between + beside) / np.sqrt(2), (between - beside) / np.sqrt(2)

    def rulings(self, sheet: Points) -> Points3:
        """See `Shape`: NaN, the sheet has none in common with its neighbourhood."""
        return np.full((len(sheet), 3), np.nan)

    def meet(self, origin: Points3, directions: Points3) -> Points:
        """See `Shape`. NaN also where a ray meets what is not relaxed, far beside the page."""
        return self._surface().seen_from(origin, directions)

    def stretch(self, sheet: Points) -> NDArray[np.float64]:
        """Principal strains (N, 2) of the paper: 0.01 is one percent longer than it should be."""
        across, down = self._surface().derivatives(sheet)
        e, f, g = (np.einsum("ij,ij->i", a, b) for a, b in ((across, across), (across, down), (down, down)))
        middle, spread = (e + g) / 2, np.hypot((e - g) / 2, f)
        strains: NDArray[np.float64] = np.sqrt(np.column_stack([middle - spread, middle + spread])) - 1.0
        return strains

    def _surface(self) -> "_Surface":
        return _relaxed(self.heights, self.relaxation)


class _Surface:
    """A bicubic spline through the nodes of a grid: sheet -> space."""

    def __init__(self, s: NDArray[np.float64], t: NDArray[np.float64], nodes: NDArray[np.float64]) -> None:
        self._low, self._high = np.array([s[0], t[0]]), np.array([s[-1], t[-1]])
        self._splines = [RectBivariateSpline(s, t, nodes[:, :, axis].T) for axis in range(3)]
        self._sheet = np.stack(np.meshgrid(s, t), axis=-1).reshape(-1, 2)
        self._nodes = nodes.reshape(-1, 3)

    def at(self, sheet: Points, ds: int = 0, dt: int = 0) -> Points3:
        """Surface points (N, 3), or their derivatives; straight on beyond the nodes."""
        inside = np.clip(sheet, self._low, self._high)
        points = self._raw(inside, ds, dt)
        if (ds, dt) == (0, 0):
            beyond = sheet - inside
            if np.any(beyond):
                points = points + beyond[:, :1] * self._raw(inside, 1, 0)
                points = points + beyond[:, 1:] * self._raw(inside, 0, 1)
        return points

    def derivatives(self, sheet: Points) -> tuple[Points3, Points3]:
        """Along s and along t."""
        return self.at(sheet, ds=1), self.at(sheet, dt=1)

    def _raw(self, sheet: Points, ds: int, dt: int) -> Points3:
        values = [spline.ev(sheet[:, 0], sheet[:, 1], dx=ds, dy=dt) for spline in self._splines]
        return np.column_stack(values)

    def seen_from(self, origin: Points3, directions: Points3) -> Points:
        """Where rays meet the front side: nodes as seen from the origin for a start, then Newton's method."""
        axis = self._nodes.mean(axis=0) - origin
        axis /= np.linalg.norm(axis)
        right = np.cross([0.0, 1.0, 0.0], axis)
        right /= np.linalg.norm(right)
        frame = np.stack([right, np.cross(axis, right), axis])
        seen, rays = (self._nodes - origin) @ frame.T, directions @ frame.T
        met = np.full((len(rays), 2), np.nan)
        ahead = rays[:, 2] > 0
        if np.any(seen[:, 2] <= 0):
            return met
        start = LinearNDInterpolator(seen[:, :2] / seen[:, 2:], self._sheet)
        wanted = rays[ahead, :2] / rays[ahead, 2:]
        found = np.asarray(start(wanted), np.float64)
        inside = np.isfinite(found[:, 0])
        found[inside] = self._refined(found[inside], wanted[inside], origin, frame)
        met[ahead] = found
        return met

    def _refined(self, sheet: Points, wanted: Points, origin: Points3, frame: NDArray[np.float64]) -> Points:
        busy = np.arange(len(sheet))
        sheet = sheet.copy()
        for _ in range(_NEWTON_STEPS):
            at = (self.at(sheet[busy]) - origin) @ frame.T
            along_s, along_t = (d @ frame.T for d in self.derivatives(sheet[busy]))
            image = at[:, :2] / at[:, 2:]
            # Columns of the projection's Jacobian, times depth.
            js, jt = (d[:, :2] - image * d[:, 2:] for d in (along_s, along_t))
            miss = (wanted[busy] - image) * at[:, 2:]
            det = js[:, 0] * jt[:, 1] - js[:, 1] * jt[:, 0]
            step = (
                np.column_stack(
                    [
                        miss[:, 0] * jt[:, 1] - miss[:, 1] * jt[:, 0],
                        js[:, 0] * miss[:, 1] - js[:, 1] * miss[:, 0],
                    ]
                )
                / det[:, None]
            )
            # A quarter of a fifth of the page at most: creases are not jumped over.
            sheet[busy] += np.clip(step, -0.05, 0.05)
            busy = busy[np.abs(step).max(axis=1) > _PRECISION]
            if not len(busy):
                break
        return sheet


@lru_cache(maxsize=64)
def _relaxed(heights: Heights, relaxation: Relaxation) -> _Surface:
    """Gauss-Newton on the mesh of the enlarged sheet."""
    edge = np.array([1.0, heights.half_height]) + _BEYOND
    columns, rows = (2 * int(np.ceil(length / relaxation.cell)) + 1 for length in edge)
    s, t = np.linspace(-edge[0], edge[0], columns), np.linspace(-edge[1], edge[1], rows)
    flat = np.stack(np.meshgrid(s, t), axis=-1).reshape(-1, 2)
    target = np.column_stack([flat, heights.wanted(flat)])
    target[:, 2] -= target[:, 2].mean()
    springs, bending = _springs(columns, rows), _bending(columns, rows)
    rest = np.linalg.norm(springs @ flat, axis=1)
    nodes, pull = target.copy(), relaxation.pull
    for _ in range(relaxation.steps):
        # Few sharp ridges rather than many soft ones: what turns much is hardly held (Geman-McClure).
        turns = np.linalg.norm(bending @ nodes, axis=1) / relaxation.cell
        weights = (
            relaxation.stiffness / (1.0 + (turns / relaxation.ridge_rad) ** 2) ** 2 + relaxation.softness
        )
        stiff = bending.T @ bending.multiply(weights[:, None]).tocsr() / relaxation.cell**2
        nodes = _step(nodes, target, springs, rest, stiff, pull)
        pull *= relaxation.fade
    return _Surface(s, t, nodes.reshape(rows, columns, 3))


def _step(
    nodes: NDArray[np.float64],
    target: NDArray[np.float64],
    springs: csr_array,
    rest: NDArray[np.float64],
    stiff: csr_array,
    pull: float,
) -> NDArray[np.float64]:
    """One Gauss-Newton step: spring (|d|^2 / l^2 - 1) / 2, bending and pull as they are (linear)."""
    vectors = springs @ nodes
    miss = (np.einsum("ij,ij->i", vectors, vectors) / rest**2 - 1.0) / 2.0
    parts = [springs.multiply((vectors[:, axis] / rest**2)[:, None]).tocsr() for axis in range(3)]
    jacobian = _interleaved(parts)
    # Sideways the pull only holds the sheet in its place.
    weights = pull * np.array([1e-3, 1e-3, 1.0])
    normal = jacobian.T @ jacobian
    normal = normal + kron(stiff, eye_array(3)) + kron(eye_array(len(nodes)), np.diag(weights))
    right = -(jacobian.T @ miss) - (stiff @ nodes).ravel() - ((nodes - target) * weights).ravel()
    moved: NDArray[np.float64] = nodes + _solved(normal, right).reshape(-1, 3)
    return moved


def _solved(normal: csr_array, right: NDArray[np.float64]) -> NDArray[np.float64]:
    """Banded Cholesky: rows of nodes are short, so that it is quicker than a sparse factorization."""
    entries = normal.tocoo()
    below = entries.row - entries.col
    kept = below >= 0
    banded = np.zeros((int(below.max()) + 1, len(right)))
    banded[below[kept], entries.col[kept]] = entries.data[kept]
    return np.asarray(solveh_banded(banded, right, overwrite_ab=True, lower=True, check_finite=False))


def _interleaved(parts: list[csr_array]) -> csr_array:
    """Columns of three matrices (M, N) side by side: x, y, z of every node together (M, 3 N)."""
    total: csr_array | None = None
    for axis, part in enumerate(parts):
        spread = kron(part, np.eye(3)[axis : axis + 1]).tocsr()
        total = spread if total is None else total + spread
    assert total is not None
    return total


def _difference(count: int, first: NDArray[np.intp], last: NDArray[np.intp]) -> csr_array:
    rows = np.arange(len(first))
    values = np.concatenate([np.ones(len(first)), -np.ones(len(first))])
    return csr_array(
        (values, (np.concatenate([rows, rows]), np.concatenate([last, first]))), shape=(len(first), count)
    )


def _springs(columns: int, rows: int) -> csr_array:
    """Edges and both diagonals of every cell, as differences of nodes."""
    index = np.arange(columns * rows).reshape(rows, columns)
    pairs = [
        (index[:, :-1], index[:, 1:]),
        (index[:-1], index[1:]),
        (index[:-1, :-1], index[1:, 1:]),
        (index[:-1, 1:], index[1:, :-1]),
    ]
    parts = [_difference(index.size, a.ravel(), b.ravel()) for a, b in pairs]
    return csr_array(vstack(parts))


def _bending(columns: int, rows: int) -> csr_array:
    """Second differences along both axes."""
    index = np.arange(columns * rows).reshape(rows, columns)
    parts = []
    for a, b, c in (
        (index[:, :-2], index[:, 1:-1], index[:, 2:]),
        (index[:-2], index[1:-1], index[2:]),
    ):
        parts.append(
            _difference(index.size, b.ravel(), c.ravel()) - _difference(index.size, a.ravel(), b.ravel())
        )
    return csr_array(vstack(parts))

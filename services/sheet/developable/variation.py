"""How the unrolled page moves at fixed photo points when the surface's parameters change: the fit's Jacobian.

A change of parameters turns the frame at s by d phi(s) and shifts the a-axis by dP(s),

    d phi' = R dk + A k dw,    dP' = d phi x A,    dX = dP + t (d phi x R + A dw)    at fixed (s, t),

which moves the image by dx = (f dX - x dX_z) / Z. At a fixed photo point the page moves the other way, by the
derivative of the page by the photo: d(u, v) = -J dx + what (u, v) change at fixed (s, t).
"""

import numpy as np

from services.arrays import Floats, Vector
from services.kernels.library import address, find_kernels
from services.sheet.developable.surface import DevelopableSurface, Unrolled, cross

TURN, LOG_FOCAL, SKEW, SLOPES = slice(0, 3), 3, 4, slice(5, 7)
"""Places among the parameters: a turn about the camera's axes, log focal length, skew, slopes of the rulings."""
GLOBAL = SLOPES.stop
"""Parameters before the bends (and before the type's slant, which moves nothing)."""


def vary_page(
    surface: DevelopableSurface, at: Unrolled, turn: Floats | None = None, still: int = 0, room: int = 0
) -> Floats:
    """Derivatives (N, 2, 7 + `still` + K + `room`) of the page points by turn, log focal length, skew, slopes, bends.

    The turn's three numbers are about the columns of `turn` (3, 3), the camera's axes unless given. Before the bends
    come `still` columns of zeros, for parameters that move nothing; after them come `room` columns for the caller.
    """
    kernels = find_kernels()
    if kernels is None:
        return vary_page_plain(surface, at, turn, still, room)
    splines = np.ascontiguousarray(surface.basis.values, np.float64)
    bend, axes = splines @ surface.bends, _axes(surface, turn)
    moved = np.empty((len(at.sheet), 2, GLOBAL + still + len(surface.bends) + room))
    (points, _held), tables = at.for_kernels(), (address(axes), address(bend), address(splines))
    sizes = still, len(surface.bends), address(moved), moved.shape[2]
    if not kernels.vary_points(surface.for_kernels(), points, *tables, *sizes):
        raise MemoryError
    return moved


def vary_page_plain(
    surface: DevelopableSurface, at: Unrolled, turn: Floats | None = None, still: int = 0, room: int = 0
) -> Floats:
    """`vary_page` without a kernel."""
    s, t = np.ascontiguousarray(at.sheet.T)
    X, A, R, centred = at.X.T, at.A.T, at.R.T, at.centred.T
    bends = GLOBAL + still + np.arange(len(surface.bends))
    moved = np.zeros((len(s), 2, GLOBAL + still + len(bends) + room))
    # A point that moves by dX moves on the page by G dX = -J (f dX - x dX_z) / Z.
    J = at.jacobians.transpose(1, 2, 0) / X[2]
    G = np.empty((2, 3, len(s)))
    G[:, :2] = -surface.focal * J
    G[:, 2] = J[:, 0] * centred[0] + J[:, 1] * centred[1]
    # Where the frame turns by d phi, dX = d phi x arm, so that G dX = d phi (arm x G).
    arm = X - np.array([*surface.anchor, surface.focal])[:, None]
    turned = cross(arm, G)
    by_axes = turned.transpose(2, 0, 1) @ _axes(surface, turn)
    moved[:, :, TURN], moved[:, :, SKEW] = by_axes[..., :3], by_axes[..., 3]
    # A longer focal length also moves the image itself.
    moved[:, :, LOG_FOCAL] = (surface.focal * G[:, 2] - X[2] * G[:, 2]).T
    moved[:, 0, SKEW] += at.page[:, 1]
    moved[:, 1, SKEW] -= at.page[:, 0]
    of_tables = _sum_tables(surface, s, np.concatenate([cross(t * R, G), G], axis=1))
    moved[:, :, SLOPES], moved[:, :, bends] = of_tables[..., :2], of_tables[..., 2:]
    along = (G[:, 0] * A[0] + G[:, 1] * A[1] + G[:, 2] * A[2]).T
    along += np.array([np.cos(surface.skew_rad), -np.sin(surface.skew_rad)])
    moved[:, :, SLOPES.start] += along * (t * s)[:, None]
    moved[:, :, SLOPES.start + 1] += along * (t * s * s)[:, None]
    return moved


def _axes(surface: DevelopableSurface, turn: Floats | None) -> Floats:
    """Axes (3, 4) that a frame turns about by the three numbers of a turn, and by the skew."""
    return np.column_stack([np.eye(3) if turn is None else turn, -surface.rotation[:, 2]])


def _sum_tables(surface: DevelopableSurface, s: Vector, factors: Floats) -> Floats:
    """Sums (N, 2, 2 + K) of d phi and dP at `s` (N,), of slopes and bends, times their `factors` (2, 6, N).

    Between two nodes they are parabolas whose slopes at the nodes are their rates: the directions of flows are
    differences within a span, and linear interpolation would have errors of some percent. Points between the same two
    nodes need the same part of the tables, and make one product of matrices.
    """
    nodes = surface.basis.nodes
    step = float(nodes[1] - nodes[0])
    left = np.clip(((s - nodes[0]) / step).astype(int), 0, len(nodes) - 2)
    order = np.argsort(left, kind="stable")
    x = ((s - nodes[left]) / step)[order]
    rise = 0.5 * step * np.maximum(x * (1 - x), 0.0)  # straight beyond the table
    shares = np.stack([np.ones_like(x), x, rise], axis=1)
    ordered = np.ascontiguousarray(factors.take(order, axis=2).transpose(2, 0, 1))
    weights = (shares[:, None, :, None] * ordered[:, :, None]).reshape(-1, 18)
    values, rates = _tables(surface)
    spans = np.empty((len(nodes) - 1, 18, values.shape[2]))
    spans[:, :6] = values[:-1]
    np.subtract(values[1:], values[:-1], out=spans[:, 6:12])
    np.subtract(rates[:-1], rates[1:], out=spans[:, 12:])
    sums = np.empty((len(weights), values.shape[2]))
    begin = 0
    for span, end in zip(spans, 2 * np.cumsum(np.bincount(left, minlength=len(spans))), strict=True):
        if end > begin:
            np.dot(weights[begin:end], span, out=sums[begin:end])
            begin = end
    places = np.empty_like(order)
    places[order] = np.arange(len(order))
    return sums.reshape(len(s), 2, -1).take(places, axis=0)


def _tables(surface: DevelopableSurface) -> tuple[Floats, Floats]:
    """d phi and dP (n, 6, 2 + K) at the nodes for the slopes and bends, zero at s = 0, and their rates in s."""
    basis = surface.basis
    s = basis.nodes
    bend = basis.values @ surface.bends
    rates = np.empty((len(s), 6, 2 + len(surface.bends)))
    rates[:, :3, :2] = (bend[:, None] * surface.A)[:, :, None] * np.stack([s, s * s], axis=1)[:, None]
    rates[:, :3, 2:] = surface.R[:, :, None] * basis.values[:, None]
    values = np.empty_like(rates)
    values[:, :3] = _integrate(rates[:, :3], s)
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        rates[:, 3 + i] = values[:, j] * surface.A[:, k, None] - values[:, k] * surface.A[:, j, None]
    values[:, 3:] = _integrate(rates[:, 3:], s)
    return values, rates


def _integrate(rates: Floats, s: Vector) -> Floats:
    """Integral (n, 3, M) over s of `rates` (n, 3, M) by the trapezoidal rule, from s = 0."""
    step = float(s[1] - s[0])
    origin = int(np.argmin(np.abs(s)))
    total = np.zeros_like(rates)
    np.cumsum(0.5 * step * (rates[1:] + rates[:-1]), axis=0, out=total[1:])
    return np.asarray(total - (total[origin] - s[origin] * rates[origin]))

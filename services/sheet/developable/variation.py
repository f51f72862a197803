"""How the unrolled page moves at fixed photo points when the surface's parameters change: the fit's Jacobian.

A change of parameters turns the frame at s by d phi(s) and shifts the a-axis by dP(s),

    d phi' = R dk + A k dw,    dP' = d phi x A,    dX = dP + t (d phi x R + A dw)    at fixed (s, t),

which moves the image by dx = (f dX - x dX_z) / Z. At a fixed photo point the page moves the other way, by the
derivative of the page by the photo: d(u, v) = -J dx + what (u, v) change at fixed (s, t).
"""

import numpy as np

from services.arrays import Floats, Vector
from services.sheet.developable.surface import DevelopableSurface, Unrolled

GLOBAL = 7
"""Parameters before the bends: a turn about the camera's axes (3), log focal length, skew, two slopes."""


def vary_page(surface: DevelopableSurface, at: Unrolled) -> Floats:
    """Derivatives (N, 2, 7 + K) of the page points by turn, log focal length, skew, slopes and bends."""
    s, t = at.sheet.T
    n, count = len(s), len(surface.bends)
    anchor = np.array([*surface.anchor, surface.focal])
    dX = np.empty((GLOBAL + count, n, 3))
    arm = at.X - anchor
    for axis in range(3):
        dX[axis] = np.cross(np.eye(3)[axis], arm)
    dX[3] = [0.0, 0.0, surface.focal]
    origin = int(np.argmin(np.abs(surface.basis.nodes)))
    dX[4] = np.cross(-surface.rotation[:, 2], arm)
    turns, shifts = _tables(surface, origin)
    slopes = (s, s * s)
    dphi, dP = _at(surface, s, *turns), _at(surface, s, *shifts)
    dX[5:] = dP + t[:, None] * _cross(dphi, at.R)
    for j in (0, 1):
        dX[5 + j] += (t * slopes[j])[:, None] * at.A
    dx = (surface.focal * dX[..., :2] - at.centred * dX[..., 2:]) / at.X[:, 2:]
    dx[3] += at.centred
    moved = -np.einsum("nij,mnj->nim", at.jacobians, dx)
    u, v = at.page.T
    moved[:, 0, 4] += v
    moved[:, 1, 4] -= u
    c, d = np.cos(surface.skew_rad), np.sin(surface.skew_rad)
    for j in (0, 1):
        moved[:, 0, 5 + j] += c * t * slopes[j]
        moved[:, 1, 5 + j] -= d * t * slopes[j]
    return np.asarray(moved)


def _tables(surface: DevelopableSurface, origin: int) -> tuple[tuple[Floats, Floats], tuple[Floats, Floats]]:
    """d phi and dP (2 + K, n, 3) at the nodes for the slopes and bends, zero at s = 0, each with its rate in s."""
    basis = surface.basis
    s = basis.nodes
    k = basis.values @ surface.bends
    rates = [surface.A * (k * w)[:, None] for w in (s, s * s)]
    rates += [surface.R * value[:, None] for value in basis.values.T]
    turning = np.stack(rates)
    turns = _integrate(turning, s, origin)
    shifting = _cross(turns, surface.A)
    return (turns, turning), (_integrate(shifting, s, origin), shifting)


def _integrate(rates: Floats, s: Vector, origin: int) -> Floats:
    """Integral (M, n, 3) over s of `rates` (M, n, 3) by the trapezoidal rule, from s = 0."""
    step = float(s[1] - s[0])
    total = np.zeros_like(rates)
    np.cumsum(0.5 * step * (rates[:, 1:] + rates[:, :-1]), axis=1, out=total[:, 1:])
    at_zero = total[:, origin] - s[origin] * rates[:, origin]
    return np.asarray(total - at_zero[:, None])


def _at(surface: DevelopableSurface, s: Vector, table: Floats, rates: Floats) -> Floats:
    """Values (M, N, 3) of a table (M, n, 3) at s (N,).

    Parabolas whose slopes at the nodes are the `rates`: the directions of flows are differences within a span, and
    linear interpolation would have errors of some percent.
    """
    nodes = surface.basis.nodes
    step = float(nodes[1] - nodes[0])
    left = np.clip(((s - nodes[0]) / step).astype(int), 0, len(nodes) - 2)
    x = ((s - nodes[left]) / step)[:, None]
    bow = 0.5 * step * (rates[:, :-1] - rates[:, 1:])
    rise = np.maximum(x * (1 - x), 0.0)  # straight beyond the table
    return np.asarray(table[:, left] * (1 - x) + table[:, left + 1] * x + rise * bow[:, left])


def _cross(a: Floats, b: Floats) -> Floats:
    """Cross product of (..., 3) and (..., 3), broadcast; numpy's own copies far more."""
    out = np.empty(np.broadcast_shapes(a.shape, b.shape))
    out[..., 0] = a[..., 1] * b[..., 2] - a[..., 2] * b[..., 1]
    out[..., 1] = a[..., 2] * b[..., 0] - a[..., 0] * b[..., 2]
    out[..., 2] = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return out

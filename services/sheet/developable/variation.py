"""How the unrolled page moves at fixed photo points when the surface's parameters change: the fit's Jacobian.

A change of parameters turns the frame at s by d phi(s) and shifts the a-axis by dP(s),

    d phi' = R dk + A k dw,    dP' = d phi x A,    dX = dP + t (d phi x R + A dw)    at fixed (s, t),

which moves the image by dx = (f dX - x dX_z) / Z. At a fixed photo point the page moves the other way, by the
derivative of the page by the photo: d(u, v) = -J dx + what (u, v) change at fixed (s, t).
"""

import numpy as np

from services.arrays import Floats, Vector
from services.sheet.developable.surface import DevelopableSurface, Unrolled, cross

TURN, LOG_FOCAL, SKEW, SLOPES = slice(0, 3), 3, 4, slice(5, 7)
"""Places among the parameters: a turn about the camera's axes, log focal length, skew, slopes of the rulings."""
GLOBAL = SLOPES.stop
"""Parameters before the bends (and before the type's slant, which moves nothing)."""


def vary_page(surface: DevelopableSurface, at: Unrolled, turn: Floats | None = None) -> Floats:
    """Derivatives (N, 2, 7 + K) of the page points by turn, log focal length, skew, slopes and bends.

    The turn's three numbers are about the columns of `turn` (3, 3), the camera's axes unless given. In memory the
    points come last, so that the residuals' sums run along it.
    """
    s, t = np.ascontiguousarray(at.sheet.T)
    X, A, R, centred = at.X.T, at.A.T, at.R.T, at.centred.T
    n, count = len(s), len(surface.bends)
    dX = np.empty((GLOBAL + count, 3, n))
    arm = X - np.array([*surface.anchor, surface.focal])[:, None]
    axes = np.eye(3) if turn is None else turn
    dX[TURN] = cross(axes.T[:, :, None], arm)
    dX[LOG_FOCAL] = np.array([0.0, 0.0, surface.focal])[:, None]
    origin = int(np.argmin(np.abs(surface.basis.nodes)))
    dX[SKEW] = cross(-surface.rotation[:, 2:], arm)
    turns, shifts = _tables(surface, origin)
    dphi, dP = _at(surface, s, *turns), _at(surface, s, *shifts)
    dX[SLOPES.start :] = dP
    dX[SLOPES.start :] += cross(dphi, t * R)
    slopes = (s, s * s)
    for j in (0, 1):
        dX[SLOPES.start + j] += t * slopes[j] * A
    # moved = -J (f dX - x dX_z) / Z
    J = at.jacobians.transpose(1, 2, 0) / X[2]
    moved = np.empty((GLOBAL + count, 2, n))
    for i in (0, 1):
        np.multiply(dX[:, 0], -surface.focal * J[i, 0], out=moved[:, i])
        moved[:, i] -= dX[:, 1] * (surface.focal * J[i, 1])
        moved[:, i] += dX[:, 2] * (J[i, 0] * centred[0] + J[i, 1] * centred[1])
    # A longer focal length also moves the image itself.
    moved[LOG_FOCAL] -= np.einsum("ijn,jn->in", J, X[2] * centred)
    u, v = at.page.T
    moved[SKEW, 0] += v
    moved[SKEW, 1] -= u
    c, d = np.cos(surface.skew_rad), np.sin(surface.skew_rad)
    for j in (0, 1):
        moved[SLOPES.start + j, 0] += c * t * slopes[j]
        moved[SLOPES.start + j, 1] -= d * t * slopes[j]
    return moved.transpose(2, 1, 0)


def _tables(surface: DevelopableSurface, origin: int) -> tuple[tuple[Floats, Floats], tuple[Floats, Floats]]:
    """d phi and dP (2 + K, 3, n) at the nodes for the slopes and bends, zero at s = 0, each with its rate in s."""
    basis = surface.basis
    s = basis.nodes
    k = basis.values @ surface.bends
    A = np.ascontiguousarray(surface.A.T)
    turning = np.concatenate(
        [A * (k * np.stack([s, s * s]))[:, None], surface.R.T * np.ascontiguousarray(basis.values.T)[:, None]]
    )
    turns = _integrate(turning, s, origin)
    shifting = cross(turns, A)
    return (turns, turning), (_integrate(shifting, s, origin), shifting)


def _integrate(rates: Floats, s: Vector, origin: int) -> Floats:
    """Integral (M, 3, n) over s of `rates` (M, 3, n) by the trapezoidal rule, from s = 0."""
    step = float(s[1] - s[0])
    total = np.zeros_like(rates)
    np.cumsum(0.5 * step * (rates[..., 1:] + rates[..., :-1]), axis=-1, out=total[..., 1:])
    at_zero = total[..., origin] - s[origin] * rates[..., origin]
    return np.asarray(total - at_zero[..., None])


def _at(surface: DevelopableSurface, s: Vector, table: Floats, rates: Floats) -> Floats:
    """Values (M, 3, N) of a table (M, 3, n) at s (N,).

    Parabolas whose slopes at the nodes are the `rates`: the directions of flows are differences within a span, and
    linear interpolation would have errors of some percent.
    """
    nodes = surface.basis.nodes
    step = float(nodes[1] - nodes[0])
    left = np.clip(((s - nodes[0]) / step).astype(int), 0, len(nodes) - 2)
    x = (s - nodes[left]) / step
    rise = np.maximum(x * (1 - x), 0.0)  # straight beyond the table
    found = np.diff(table, axis=-1).take(left, axis=-1)
    found *= x
    found += table.take(left, axis=-1)
    found += rise * (0.5 * step * (rates[..., :-1] - rates[..., 1:])).take(left, axis=-1)
    return np.asarray(found)

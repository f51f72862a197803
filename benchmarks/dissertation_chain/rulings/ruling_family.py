"""One low-order family of rulings over the whole page, fitted to both flows (after dissertation 3.3.3).

Convergence alone places a ruling only to second order: a line turned by e crosses neighbouring rulings whose text
has another slope, and the part of this change that is linear along the line looks like another vanishing point.
What the vanishing points do from ruling to ruling settles it. Text lines are geodesics, so their unit direction T
in space changes along the surface normal alone, and the ruling is orthogonal to the normal:

    R . dT = 0.

T_i follows from the convergence along ruling i (and the focal length). The rulings of a cylinder or a cone project
to lines through one point A, and R_i ~ A - m z_i p_i for the rays A and p_i, where z_i is the depth of the
reference point, the middle one's being 1: m = 0 for a cylinder (A is the vanishing point), m > 0 for a cone (A
is the apex). The depths follow from the normals N = T x R, as N is orthogonal to z_i p_i - z_k p_k for neighbours.
So four numbers - A, m, the focal length - must make R . dT vanish across the page, keep every line convergent, and
put the other flow, N x T, where it is seen.

All of this holds for the minor flow as well, whose lines are geodesics too. Where the skew is so large that text
lines run along the rulings, T says little and the strokes must be the witness: the flows change their parts.
"""

from dataclasses import dataclass

import numpy as np

from benchmarks.dissertation_chain.rulings.convergence import (
    Convergence,
    Directions,
    Weights,
    measure_convergence,
)
from services.arrays import Floats, Points, Vector
from services.texture_flow.field import angle_difference

_STEP = 1e-3


@dataclass(frozen=True, slots=True)
class FamilyParameters:
    """Deviations of the evidence; lengths are in centred unit coordinates."""

    focal: float = 1.3
    focal_deviation: float = 0.25
    """Of the logarithm: main cameras of phones."""
    apex_deviation: float = 0.6
    """Of m: pages are more often cylinders than cones."""
    floor_rad: float = np.deg2rad(0.4)
    """Error of T along the page that does not fall with the length of the ruling."""
    correlation: float = 0.15
    """Length over which the errors of the dense fields hold."""
    saturation: float = 3.0
    """Residuals count linearly beyond this many deviations (Huber)."""
    iterations: int = 12
    start_range_rad: float = np.deg2rad(18.0)
    start_steps: int = 7
    """Turns of the first and of the last ruling are tried on a grid (cylinders of the prior's focal length)."""
    starts: int = 2
    """The best trials that the search then starts from."""


@dataclass(frozen=True, slots=True, eq=False)
class RulingFamily:
    """The family found: `angles` (N,) rad of the rulings in the photo, `directions` (N, 3) of the rulings in space.

    `common_point` (3,) is A, homogeneous in centred unit coordinates; `apex_share` is m; `focal` in units;
    `cost` is half the sum of squared residuals over their deviations.
    """

    angles: Vector
    directions: Floats
    common_point: Vector
    apex_share: float
    focal: float
    cost: float


@dataclass(frozen=True, slots=True, eq=False)
class FamilyEvidence:
    """What a family is held against: reference `points` (N, 2), the `first` direction (rad), flows and text.

    `places` (M,) are where the lines are sampled. The `witness` is the flow that crosses the rulings, usually the
    major; `other` the one orthogonal to it on the page.
    """

    points: Points
    first: float
    places: Vector
    weight_at: Weights
    witness: "FlowWitness"
    other: "FlowWitness | None"


@dataclass(frozen=True, slots=True)
class FlowWitness:
    """A flow with the deviation of its directions."""

    at: Directions
    noise_rad: float


@dataclass(frozen=True, slots=True, eq=False)
class _Rays:
    """J trial families over N rulings: `angles` (J, N), `along` and `seen` (J, N, 3) rays, `common` (J, 3) ray of A."""

    angles: Floats
    along: Floats
    seen: Floats
    common: Floats
    common_points: Floats
    focal: Floats


def fit_ruling_family(evidence: FamilyEvidence, parameters: FamilyParameters | None = None) -> RulingFamily:
    """Robust least squares by Levenberg and Marquardt, from several starts; finite for any fields."""
    p = parameters or FamilyParameters()
    turns = np.linspace(-p.start_range_rad, p.start_range_rad, p.start_steps)
    first, last = (turn.ravel() for turn in np.meshgrid(turns, turns))
    trials = np.stack([first, last, np.zeros_like(first), np.full_like(first, np.log(p.focal))], axis=1)
    costs = np.sum(_residuals(trials, evidence, p) ** 2, axis=1)
    descents = [_descend(trials[k], evidence, p) for k in np.argsort(costs)[: p.starts]]
    cost, x = min(descents, key=lambda found: found[0])
    rays = _place_rays(x[None], evidence)
    found = _converge(rays, evidence)
    T, _ = _witness_directions(rays, found)
    R = _ruling_directions(x[None], rays, T)
    return RulingFamily(
        rays.angles[0] % np.pi, R[0], rays.common_points[0], float(x[2]), float(np.exp(x[3])), cost
    )


def _descend(x: Vector, evidence: FamilyEvidence, p: FamilyParameters) -> tuple[float, Vector]:
    """Least cost from the start `x` (4,), and where it is. One call measures a point and its four derivatives."""
    steps = np.vstack([np.zeros(4), _STEP * np.eye(4)])
    r = _residuals(x + steps, evidence, p)
    cost, damping = float(r[0] @ r[0]), 1e-2
    for _ in range(p.iterations):
        jacobian = ((r[1:] - r[0]) / _STEP).T
        normal = jacobian.T @ jacobian
        change = -np.linalg.solve(normal + np.diag(damping * np.diag(normal) + 1e-6), jacobian.T @ r[0])
        trial = x + np.clip(change, -0.2, 0.2)
        r_trial = _residuals(trial + steps, evidence, p)
        cost_trial = float(r_trial[0] @ r_trial[0])
        if cost_trial < cost:
            settled = cost - cost_trial < 1e-3 * cost
            x, r, cost, damping = trial, r_trial, cost_trial, max(damping / 5, 1e-6)
            if settled:
                break
        else:
            damping *= 5
    return 0.5 * cost, x


def _place_rays(x: Floats, evidence: FamilyEvidence) -> _Rays:
    """The families of parameters `x` (J, 4): turns of the first and last ruling, m, log of the focal length."""
    points, first = evidence.points, evidence.first
    A = _unit(np.cross(_line(points[0], first + x[:, 0]), _line(points[-1], first + x[:, 1])))
    towards = A[:, None, :2] - A[:, None, 2:] * points
    angles = first + angle_difference(np.arctan2(towards[..., 1], towards[..., 0]), first)
    focal = np.exp(x[:, 3])
    along = np.stack([np.cos(angles), np.sin(angles), np.zeros_like(angles)], axis=-1)
    depth = np.broadcast_to(focal[:, None, None], (*angles.shape, 1))
    seen = np.concatenate([np.broadcast_to(points, (*angles.shape, 2)), depth], axis=-1)
    common = _unit(A * np.stack([np.ones_like(focal), np.ones_like(focal), focal], axis=-1))
    common *= np.where(np.einsum("jnx,jx->j", along, common) < 0, -1.0, 1.0)[:, None]
    return _Rays(angles, along, seen, common, A, focal)


def _converge(rays: _Rays, evidence: FamilyEvidence) -> Convergence:
    """Convergence (N, J) of the witness along the trial rulings."""
    return measure_convergence(
        evidence.witness.at, evidence.weight_at, evidence.points, rays.angles.T, evidence.places
    )


def _witness_directions(rays: _Rays, found: Convergence) -> tuple[Floats, Floats]:
    """Unit T_i (J, N, 3) in space, and the lengths (J, N, 1) before they were made unit (see `Convergence`).

    All are signed like the normals of their lines in the photo, hence alike.
    """
    normal = np.stack([-rays.along[..., 1], rays.along[..., 0], rays.along[..., 2]], axis=-1)
    V = found.a.T[..., None] * rays.along + normal - found.b.T[..., None] * rays.seen
    length = np.maximum(np.linalg.norm(V, axis=-1, keepdims=True), 1e-9)
    return V / length, length


def _ruling_directions(x: Floats, rays: _Rays, T: Floats) -> Floats:
    """Unit R_i (J, N, 3), from m = `x`[:, 2] and the depths that the tangent planes T x R give."""
    p = rays.seen / rays.focal[:, None, None]
    depth: Floats = np.ones((len(x), p.shape[1]))
    middle = p.shape[1] // 2
    for _ in range(2):
        R = _unit(rays.common[:, None, :] - (x[:, 2, None] * depth)[..., None] * p)
        N = np.cross(T, R)
        N = N[:, 1:] + N[:, :-1]
        ahead, behind = (np.einsum("jnx,jnx->jn", N, q) for q in (p[:, :-1], p[:, 1:]))
        safe = np.where(np.abs(behind) > 1e-6, behind, 1.0)
        ratio = np.clip(np.where(np.abs(behind) > 1e-6, ahead / safe, 1.0), 0.8, 1.25)
        depth = np.pad(np.cumprod(ratio, axis=1), ((0, 0), (1, 0)), constant_values=1.0)
        depth = np.clip(depth / depth[:, middle : middle + 1], 0.3, 3.0)
    return _unit(rays.common[:, None, :] - (x[:, 2, None] * depth)[..., None] * p)


def _residuals(x: Floats, evidence: FamilyEvidence, p: FamilyParameters) -> Floats:
    """Residuals (J, ...) over their deviations of the families `x` (J, 4), with Huber's loss inside."""
    noise = evidence.witness.noise_rad
    rays = _place_rays(x, evidence)
    found = _converge(rays, evidence)
    text = found.weight.T
    converge = np.sqrt(found.mean_square.T * text / p.correlation) / noise
    T, length = _witness_directions(rays, found)
    R = _ruling_directions(x, rays, T)
    # R . dT, summed up along the page: constant but for the errors of the T_i, each on its own.
    between = _unit(R[:, 1:] + R[:, :-1])
    drift = np.cumsum(np.einsum("jnx,jnx->jn", between, np.diff(T, axis=1)), axis=1)
    drift = np.pad(drift, ((0, 0), (1, 0)))
    off = (R - np.einsum("jnx,jnx->jn", R, T)[..., None] * T) / length
    gradient = np.stack(
        [np.einsum("jnx,jnx->jn", off, rays.along), -np.einsum("jnx,jnx->jn", off, rays.seen)], axis=-1
    )
    variance = np.einsum("jnx,njxy,jny->jn", gradient, found.inverse, gradient)
    variance = variance * noise**2 * p.correlation + p.floor_rad**2
    weight = (text > 1e-3) / variance
    mean = (drift * weight).sum(axis=1, keepdims=True) / np.maximum(weight.sum(axis=1, keepdims=True), 1e-12)
    parts = [converge, (drift - mean) * np.sqrt(weight)]
    if evidence.other is not None:
        parts.append(_other_residuals(rays, R, T, evidence.other, evidence, p.correlation))
    r = np.concatenate(parts, axis=1)
    size = np.abs(r)
    r = np.sign(r) * np.sqrt(np.where(size > p.saturation, p.saturation * (2 * size - p.saturation), r**2))
    prior = np.stack([x[:, 2] / p.apex_deviation, (x[:, 3] - np.log(p.focal)) / p.focal_deviation], axis=1)
    return np.concatenate([r, prior], axis=1)


def _other_residuals(
    rays: _Rays, R: Floats, T: Floats, other: FlowWitness, evidence: FamilyEvidence, correlation: float
) -> Floats:
    """Angles (J, N * K), over their deviation, from the image of N x T to the `other` flow as it is seen."""
    B = R - np.einsum("jnx,jnx->jn", R, T)[..., None] * T
    places = evidence.places[1::4]
    X = evidence.points[:, None] + rays.along[:, :, None, :2] * places[:, None]
    w = evidence.weight_at(X.reshape(-1, 2)).reshape(X.shape[:-1])
    seen = other.at(X.reshape(-1, 2)).reshape(w.shape)
    w = np.where(np.isfinite(seen), w, 0.0)
    seen = np.where(np.isfinite(seen), seen, 0.0)
    B, f = B[:, :, None, :], rays.focal[:, None, None]
    predicted = np.arctan2(B[..., 1] * f - B[..., 2] * X[..., 1], B[..., 0] * f - B[..., 2] * X[..., 0])
    independent = float(places[1] - places[0]) / correlation
    r = angle_difference(seen, predicted) / other.noise_rad * np.sqrt(w * min(independent, 1.0))
    return np.asarray(r.reshape(len(r), -1))


def _unit(vectors: Floats) -> Floats:
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12))


def _line(point: Points, angles: Vector) -> Floats:
    """Homogeneous lines (J, 3) through `point` (2,) at `angles` (J,)."""
    return np.stack(
        [-np.sin(angles), np.cos(angles), point[0] * np.sin(angles) - point[1] * np.cos(angles)], axis=-1
    )

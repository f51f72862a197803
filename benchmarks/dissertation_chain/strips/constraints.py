"""The constraints of 3.3.5 on strip normals and focal length, as residuals with their derivatives.

N_i (L, 3) are the strips' normals, away from the viewer; f the focal length; V a line of sight (x, y, f). Every
residual is already divided by what it may deviate, so that a term's weight alpha is one over its variance.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.dissertation_chain.strips.evidence import StripEvidence
from services.arrays import Floats, Vector


@dataclass(frozen=True, slots=True)
class Deviations:
    """What each term of the objective may deviate (one over the square root of alpha_i of 3.3.5).

    Chosen on simulated photos with flows, rulings and vanishing points as measured; half or twice any of them moves
    mean normals by 0.03 degrees at most.
    """

    developability: float = 2e-3
    """mu_1; the wrong ruling's share of the turn between two strips."""
    parallelism: float = 2.5e-2
    """mu_2, one sample."""
    geodesic: float = 1e-3
    """mu_3."""
    orthogonality: float = 2e-2
    """mu_4, one sample: the minor flow's error leads."""
    smoothness: float = 0.2
    """mu_5."""
    vanishing: float = 2e-2
    """Least error of a ruling's vanishing point, rad: that of the projected ruling is in it."""


@dataclass(frozen=True, slots=True, eq=False)
class Tangents:
    """Unit vectors `T` (..., 3) in a plane, their derivatives by its normal (..., 3, 3) and by f (..., 3)."""

    T: Floats
    by_normal: Floats
    by_focal: Floats


def lines_of_sight(points: Floats, focal: float) -> Floats:
    """V (..., 3) through photo points (..., 2), not of unit length."""
    return np.concatenate([points, np.full((*points.shape[:-1], 1), focal)], axis=-1)


def unit(vectors: Floats) -> Floats:
    """eta(.) of Equation 3.8."""
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12))


def tangents(directions: Floats, points: Floats, normals: Floats, focal: float) -> Floats:
    """Equation 3.8: the vector (..., 3) in the plane of `normals` that is seen in `directions` (..., 2) at `points`.

    eta(N x (t x V)), the sign that gives it the side of t.
    """
    return unit(np.cross(normals, _planes_of_sight(directions, points, focal)))


def tangents_with_derivatives(directions: Floats, points: Floats, normals: Floats, focal: float) -> Tangents:
    """As `tangents`."""
    plane = _planes_of_sight(directions, points, focal)
    w = np.cross(normals, plane)
    length = np.maximum(np.linalg.norm(w, axis=-1, keepdims=True), 1e-12)
    T = w / length
    # d(N x n) = dN x n = -[n]x dN; d eta(w) = (I - T T') dw / |w|
    projector = (np.eye(3) - T[..., :, None] * T[..., None, :]) / length[..., None]
    zero = np.zeros(plane.shape[:-1])
    x, y, z = np.moveaxis(plane, -1, 0)
    cross = np.stack([zero, z, -y, -z, zero, x, y, -x, zero], axis=-1).reshape(*plane.shape, 3)
    turned = np.stack([directions[..., 1], -directions[..., 0], zero], axis=-1)
    by_focal = np.einsum("...ab,...b->...a", projector, np.cross(normals, turned))
    return Tangents(T, projector @ cross, by_focal)


def _planes_of_sight(directions: Floats, points: Floats, focal: float) -> Floats:
    """Normals t x V (..., 3) of the planes through eye and tangent line."""
    t_x, t_y = directions[..., 0], directions[..., 1]
    x, y = points[..., 0], points[..., 1]
    return np.stack([t_y * focal, -t_x * focal, t_x * y - t_y * x], axis=-1)


@dataclass(frozen=True, slots=True, eq=False)
class Term:
    """Residuals (R,) of a constraint, each of S neighbouring `strips` (R, S).

    `by_normals` (R, S, 3) are the derivatives by these strips' normals, `by_focal` (R,) that by f.
    """

    residuals: Vector
    strips: NDArray[np.intp]
    by_normals: Floats
    by_focal: Vector


@dataclass(frozen=True, slots=True, eq=False)
class StripVectors:
    """The vectors of Equation 3.8 at some normals and focal length, with derivatives.

    `major` T_ij and `minor` B_ij (L, J, 3); `mean` the averages of T_ij in each strip (L, 3); `rulings` R_i of the
    L - 1 inner rulings, whose derivatives are by N_{i-1} + N_i.
    """

    normals: Floats
    focal: float
    major: Tangents
    minor: Tangents
    mean: Tangents
    rulings: Tangents


def strip_vectors(evidence: StripEvidence, normals: Floats, focal: float) -> StripVectors:
    """Equation 3.8 for all strips, samples and inner rulings."""
    per_sample = normals[:, None, :]
    major = tangents_with_derivatives(evidence.major, evidence.points, per_sample, focal)
    minor = tangents_with_derivatives(evidence.minor, evidence.points, per_sample, focal)
    share = sample_shares(evidence)
    mean = Tangents(
        np.einsum("lj,lja->la", share, major.T),
        np.einsum("lj,ljab->lab", share, major.by_normal),
        np.einsum("lj,lja->la", share, major.by_focal),
    )
    inner = slice(1, -1)
    rulings = tangents_with_derivatives(
        evidence.rulings[inner], evidence.reference_points[inner], normals[1:] + normals[:-1], focal
    )
    return StripVectors(normals, focal, major, minor, mean, rulings)


def sample_shares(evidence: StripEvidence) -> Floats:
    """Weights (L, J) of the averages over a strip's samples; all alike in a strip without text."""
    weights = evidence.major_weights
    total = weights.sum(axis=1, keepdims=True)
    return np.asarray(np.where(total > 0, weights / np.where(total > 0, total, 1.0), 1.0 / weights.shape[1]))


def developability(vectors: StripVectors, deviation: float) -> Term:
    """mu_1: (N_i - N_{i-1}) . R_i = 0, neighbouring strips turn about their ruling."""
    R = vectors.rulings
    turn = np.diff(vectors.normals, axis=0)
    leaning = np.einsum("la,lab->lb", turn, R.by_normal)
    residuals, by_focal = _dot(turn, R.T), _dot(turn, R.by_focal)
    return _between_strips(residuals, leaning - R.T, leaning + R.T, by_focal, 1.0 / deviation)


def parallelism(vectors: StripVectors, weights: Floats, deviation: float) -> Term:
    """mu_2: T_ij is the average T_i of its strip."""
    major, mean = vectors.major, vectors.mean
    scale = np.sqrt(weights)[..., None] / deviation
    residuals = scale * (major.T - mean.T[:, None])
    by_normal = scale[..., None] * (major.by_normal - mean.by_normal[:, None])
    by_focal = scale * (major.by_focal - mean.by_focal[:, None])
    strips = np.repeat(np.arange(len(weights)), 3 * weights.shape[1])[:, None]
    return Term(residuals.ravel(), strips, by_normal.reshape(-1, 1, 3), by_focal.ravel())


def geodesic(vectors: StripVectors, weights: Vector, deviation: float) -> Term:
    """mu_3: (T_i - T_{i-1}) . R_i = 0, text lines cross a ruling straight; `weights` (L - 1,)."""
    R, mean = vectors.rulings, vectors.mean
    turn = np.diff(mean.T, axis=0)
    leaning = np.einsum("la,lab->lb", turn, R.by_normal)
    by_left = leaning - np.einsum("la,lab->lb", R.T, mean.by_normal[:-1])
    by_right = leaning + np.einsum("la,lab->lb", R.T, mean.by_normal[1:])
    by_focal = _dot(turn, R.by_focal) + _dot(np.diff(mean.by_focal, axis=0), R.T)
    return _between_strips(_dot(turn, R.T), by_left, by_right, by_focal, np.sqrt(weights) / deviation)


def orthogonality(vectors: StripVectors, weights: Floats, deviation: float) -> Term:
    """mu_4: T_ij . B_ij = 0, strokes stand upright on their lines."""
    T, B = vectors.major, vectors.minor
    scale = np.sqrt(weights) / deviation
    by_normal = np.einsum("lja,ljab->ljb", T.T, B.by_normal) + np.einsum("lja,ljab->ljb", B.T, T.by_normal)
    by_focal = scale * (_dot(T.T, B.by_focal) + _dot(B.T, T.by_focal))
    strips = np.repeat(np.arange(len(weights)), weights.shape[1])[:, None]
    by_normals = (scale[..., None] * by_normal).reshape(-1, 1, 3)
    return Term((scale * _dot(T.T, B.T)).ravel(), strips, by_normals, by_focal.ravel())


def smoothness(vectors: StripVectors, deviation: float) -> Term:
    """mu_5: N_i - N_{i-1} is small."""
    turn = np.diff(vectors.normals, axis=0)
    strips = np.repeat(np.arange(len(turn)), 3)[:, None] + np.arange(2)
    identity = np.tile(np.eye(3), (len(turn), 1)) / deviation
    return Term(
        turn.ravel() / deviation, strips, np.stack([-identity, identity], axis=1), np.zeros(turn.size)
    )


def unit_length(vectors: StripVectors, deviation: float) -> Term:
    """mu_6: |N_i| = 1."""
    length = np.linalg.norm(vectors.normals, axis=1)
    strips = np.arange(len(length))[:, None]
    by_normals = (vectors.normals / length[:, None] / deviation)[:, None]
    return Term((length - 1) / deviation, strips, by_normals, np.zeros(len(length)))


def vanishing(vectors: StripVectors, evidence: StripEvidence, deviation: float) -> Term:
    """Beyond 3.3.5: (N_{i-1} + N_i) / 2 is orthogonal to the direction of the ruling's vanishing point.

    The dissertation takes the vanishing points for the initial normals only; here they stay evidence.
    """
    v, focal = evidence.vanishing_points, vectors.focal
    D = np.column_stack([v[:, :2], focal * v[:, 2]])
    length = np.maximum(np.linalg.norm(D, axis=1, keepdims=True), 1e-12)
    D = D / length
    D_by_focal = (np.eye(3)[2] - D * D[:, 2:]) * v[:, 2:] / length
    scale = 1 / np.hypot(evidence.vanishing_deviations, deviation)
    right = np.minimum(np.arange(len(v)), len(v) - 2)
    left = np.maximum(np.arange(len(v)) - 1, 0)
    middle = (vectors.normals[left] + vectors.normals[right]) / 2
    halves = np.repeat((scale[:, None] * D / 2)[:, None], 2, axis=1)
    strips = np.stack([left, right], axis=1)
    return Term(scale * _dot(middle, D), strips, halves, scale * _dot(middle, D_by_focal))


def _between_strips(
    residuals: Vector, by_left: Floats, by_right: Floats, by_focal: Vector, scale: Vector | float
) -> Term:
    factor = np.broadcast_to(scale, residuals.shape)
    strips = np.arange(len(residuals))[:, None] + np.arange(2)
    by_normals = factor[:, None, None] * np.stack([by_left, by_right], axis=1)
    return Term(factor * residuals, strips, by_normals, factor * by_focal)


def _dot(a: Floats, b: Floats) -> Floats:
    return np.asarray(np.einsum("...a,...a->...", a, b))

"""Robust fit of a homography between two rectified views to matches, some of which are false."""

from dataclasses import dataclass

import numpy as np

from services.arrays import Floats, Homography, Points, Vector
from services.geometry.homographies import jacobians, scaling, transform_points, translation
from services.robust import geman_mcclure_weights

# Prior on the difference of two views of one page, and limits of the robust fit.
STEPS = 12
"""Number of reweighted fits; the loss width decreases in the first half of them."""


@dataclass(frozen=True, slots=True)
class FitParameters:
    """Prior on the difference of two views of one page, and limits of the robust fit."""

    linear_deviation: float = 0.03
    """Remaining rotation, shear and change of aspect: 1-2 degrees or per cent at most, in real and simulated sets."""
    scale_deviation: float = 0.15
    """Deviation of the logarithm of scale from the initial scale, which is a measurement."""
    projective_deviation: float = 0.03
    """Remaining change of scale over the span of the matches."""
    largest_stretch: float = 1.35
    """Largest factor, or its inverse, by which any direction is stretched relative to the initial scale."""


USUAL = FitParameters()


def fit_homography(
    points_a: Points,
    points_b: Points,
    weights: Vector,
    H_initial: Homography,
    first_loss_px: float,
    last_loss_px: float,
    parameters: FitParameters = USUAL,
) -> tuple[Homography, Vector]:
    """The homography a <- b close to `H_initial` with which most of the weighted matches (N, 2) agree.

    Least squares with Geman-McClure weights. The prior on the difference of two rectified views determines what the
    matches of a narrow overlap leave free.

    Parameters
    ----------
    points_a, points_b
        (N, 2) matched points.
    weights
        (N,) weights of the matches.
    H_initial
        Initial homography.
    first_loss_px, last_loss_px
        Range of the loss width, pixels of a.
    parameters
        The prior and limits.

    Returns
    -------
    The homography, and the final weights (N,), 0-1 times the given ones.
    """
    H_similar = nearest_similarity(H_initial, np.average(points_b, axis=0, weights=weights))
    similar = transform_points(H_similar, points_b)
    middle = np.average(similar, axis=0, weights=weights)
    span = max(float(np.sqrt(np.average(np.sum((similar - middle) ** 2, axis=1), weights=weights))), 1.0)
    # In normalized pixels of a, I + E maps points q (those of b after the similarity) to the targets.
    q, target = (similar - middle) / span, (points_a - middle) / span
    # Rows of the equations of all x, then of all y, with their right sides in the last column.
    rows = np.zeros((2, len(q), 9))
    rows[0, :, :2] = rows[1, :, 3:5] = q
    rows[0, :, 2] = rows[1, :, 5] = 1.0
    for axis in (0, 1):
        rows[axis, :, 6:8] = -target[:, axis, None] * q
        rows[axis, :, 8] = target[:, axis] - q[:, axis]
    equations = rows.reshape(-1, 9)
    prior = _prior(parameters) * (last_loss_px / span) ** 2
    residual = (points_a - transform_points(H_initial, points_b)) / span
    E: Vector = np.zeros(8)
    current = weights
    narrowing = STEPS // 2
    for loss in [
        *np.geomspace(first_loss_px, last_loss_px, narrowing),
        *[last_loss_px] * (STEPS - narrowing),
    ]:
        squared = np.sum(residual**2, axis=1) * span**2
        current = weights * geman_mcclure_weights(np.sqrt(squared), loss)
        normal = (rows * current[:, None]).reshape(-1, 9)[:, :8].T @ equations
        E = np.linalg.solve(normal[:, :8] + prior, normal[:, 8])
        residual = target - transform_points(_moving(E), q)
    N = scaling(1 / span) @ translation(-middle[0], -middle[1])
    H = np.linalg.inv(N) @ _moving(E) @ N @ H_similar
    return H / H[2, 2], current


def nearest_similarity(H: Homography, middle: Vector) -> Homography:
    """Shift, scale and quarter turn that approximate `H` at `middle` (2,)."""
    J = jacobians(H, middle[None])[0]
    scale = np.sqrt(max(abs(float(np.linalg.det(J))), 1e-12))
    turns = round(float(np.arctan2(J[1, 0] - J[0, 1], J[0, 0] + J[1, 1])) / (np.pi / 2)) % 4
    cosine, sine = ((1, 0), (0, 1), (-1, 0), (0, -1))[turns]
    S = np.eye(3)
    S[:2, :2] = scale * np.array([[cosine, -sine], [sine, cosine]])
    S[:2, 2] = transform_points(H, middle[None])[0] - S[:2, :2] @ middle
    return S


def _prior(p: FitParameters) -> Floats:
    """Inverse covariance (8, 8) of E. A shift is free; a change of scale is almost free."""
    aspect, shear, turn, scale = (np.zeros(8) for _ in range(4))
    aspect[[0, 4]], scale[[0, 4]] = (1, -1), (1, 1)
    shear[[1, 3]], turn[[1, 3]] = (1, 1), (1, -1)
    linear = sum(np.outer(row, row) for row in (aspect, shear, turn)) / (2 * p.linear_deviation**2)
    free = np.outer(scale, scale) / (2 * p.scale_deviation**2)
    projective = np.diag([0, 0, 0, 0, 0, 0, 1, 1]) / p.projective_deviation**2
    return np.asarray(linear + free + projective + 1e-9 * np.eye(8))


def is_sane(H_a_b: Homography, corners_b: Points, scale: float, parameters: FitParameters = USUAL) -> bool:
    """Whether `H_a_b` has no reflection, and keeps scale and angles of the view with `corners_b` within limits."""
    w = corners_b @ H_a_b[2, :2] + H_a_b[2, 2]
    if not np.all(np.isfinite(H_a_b)) or not np.all(w * w[0] > 0):
        return False
    J = jacobians(H_a_b, corners_b)
    stretches = np.linalg.svd(J, compute_uv=False) / scale
    return bool(
        np.all(np.linalg.det(J) > 0)
        and np.all(np.abs(np.log(stretches)) < np.log(parameters.largest_stretch))
    )


def _moving(E: Vector) -> Homography:
    return np.array([[1 + E[0], E[1], E[2]], [E[3], 1 + E[4], E[5]], [E[6], E[7], 1.0]])

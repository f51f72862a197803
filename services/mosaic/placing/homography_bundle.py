"""Bundle of homographies: robust least squares over the matches of many pairs of views."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from services.arrays import Floats, Homography, Points, Vector
from services.geometry.homographies import jacobians, transform_points
from services.mosaic.placing.frontal_frame import departures_from_similarity
from services.mosaic.registration.pair_registration import PairRegistration
from services.robust import CAUCHY_WIDTH, MEDIAN_LENGTH, cauchy_weights

FREE = [(0, 0), (0, 1), (0, 2), (1, 0), (1, 1), (1, 2), (2, 0), (2, 1)]
"""Entries of a homography near the identity, in the order of the parameters; the last entry, (2, 2), is fixed."""

ENTRIES = [3 * i + j for i, j in [*FREE, (2, 2)]]
"""Places of these entries, and of the last one, in a matrix that is written row by row."""

PRIOR_POINTS = np.stack(np.meshgrid(np.linspace(-0.7, 0.7, 7), np.linspace(-0.7, 0.7, 7)), axis=-1).reshape(
    -1, 2
)
"""Points (N, 2) that represent a normalised view."""
BEHIND = 1e3
"""Distance, in half diagonals, of a point beyond the vanishing line: far larger than any true residual."""
PRIOR_PRECISION = 4 * 0.5 / (0.5 * CAUCHY_WIDTH**2)
"""Weight of the prior: four independent errors with the probability of a match's error, in units of its loss."""


# Lengths are relative to the views' diagonals, or pixels of a common resolution (the views' geometric mean).
LEAST_DEVIATION_PX = 0.02
"""Accuracy of block matching on print."""
GREATEST_DEVIATION = 0.003
"""Largest deviation on gently curved pages, relative to the diagonal. A larger one is a contradiction."""
ANNEALING = 0.4
"""Factor of the loss width per step, from the largest disagreement of a pair to the matches' own spread."""
MOST_STEPS = 80
"""Enough for 20 halvings and 20 steps that each gain a digit or two."""
STEP_PX = 1e-6
"""Convergence: no corner of a view moves more than this."""


@dataclass(frozen=True, slots=True, eq=False)
class BundleSolution:
    """Maps (n, 3, 3) normalised view -> world; for each pair the mean weight and the median distance, common pixels."""

    maps: Floats
    deviation_px: float
    weights: tuple[float, ...]
    medians: tuple[float, ...]
    converged: bool


@dataclass(frozen=True, slots=True, eq=False)
class _Half:
    """One direction of a pair: matches (N, 2) of photos `source` and `target`, normalised."""

    source: int
    target: int
    x: Points
    y: Points


@dataclass(frozen=True, slots=True, eq=False)
class Bundle:
    """The matches of all pairs, normalised (Hartley): a view's centre is 0 and half its diagonal 1."""

    normalisations: tuple[Homography, ...]
    halves: tuple[tuple[_Half, _Half], ...]
    """Both directions of each pair."""
    confidences: tuple[Vector, ...]
    initial: tuple[Homography, ...]
    """Normalised `H_a_b` of each pair."""
    units: Vector
    """Pixels of the common resolution per normalised unit, for each photo."""
    evidence: Vector
    diagonal: float
    """Mean diagonal of the views, in pixels of the common resolution."""

    @staticmethod
    def of(
        photos: list[int],
        sizes: Mapping[int, tuple[int, int]],
        pairs: Sequence[PairRegistration],
    ) -> "Bundle":
        """The bundle of `pairs`; photos are numbered by their index in `photos`."""
        place = {photo: k for k, photo in enumerate(photos)}
        ends = [(place[pair.a], place[pair.b]) for pair in pairs]
        half_diagonals = np.array([0.5 * np.hypot(*sizes[photo]) for photo in photos])
        normalisations = []
        for photo, half in zip(photos, half_diagonals, strict=True):
            width, height = sizes[photo]
            normalisations.append(
                np.array([[1, 0, -(width - 1) / 2], [0, 1, -(height - 1) / 2], [0, 0, half]]) / half
            )
        resolutions = _resolutions(len(photos), ends, pairs)
        halves, initial = [], []
        for (a, b), pair in zip(ends, pairs, strict=True):
            x_a = transform_points(normalisations[a], pair.points_a)
            x_b = transform_points(normalisations[b], pair.points_b)
            halves.append((_Half(b, a, x_b, x_a), _Half(a, b, x_a, x_b)))
            initial.append(normalisations[a] @ pair.H_a_b @ np.linalg.inv(normalisations[b]))
        units = half_diagonals / resolutions
        return Bundle(
            tuple(normalisations),
            tuple(halves),
            tuple(np.asarray(pair.weights, np.float64) for pair in pairs),
            tuple(initial),
            units,
            np.array([float(pair.weights.sum()) * pair.agreement for pair in pairs]),
            float(2 * units.mean()),
        )


@dataclass(frozen=True, slots=True, eq=False)
class FrontalPrior:
    """Prior on the views: each is a similarity of the frontal frame, except for its rectification error.

    `deviations` (n,) are the expected RMS departures relative to half a view's diagonal, infinite for a view without a
    prior. With a prior the world is the frontal frame.
    """

    deviations: Vector

    def departures(self, maps: Floats) -> tuple[Floats, Floats]:
        """Departures (n, 2 N) of points of each view from its best similarity, and their derivatives (n, 2 N, 8)."""
        z = _complex(transform_points(maps, PRIOR_POINTS))
        motions = _complex(
            np.moveaxis(jacobians(maps, PRIOR_POINTS) @ _motions(PRIOR_POINTS)[..., :8], 2, -1)
        )
        here = np.broadcast_to(_complex(PRIOR_POINTS), z.shape)
        _, r, J = departures_from_similarity(z, here, motions)
        share = np.sqrt(len(PRIOR_POINTS))
        return (
            np.concatenate([r.real, r.imag], axis=1) / share,
            np.concatenate([J.real, J.imag], axis=1) / share,
        )

    def precisions(self) -> Vector:
        """Weights (n,) of squared departures relative to the matches' Cauchy loss; a view has four parameters."""
        return PRIOR_PRECISION / self.deviations**2


def solve_bundle(
    bundle: Bundle,
    start: Floats,
    own: Vector,
    left_out: frozenset[int] = frozenset(),
    prior: FrontalPrior | None = None,
    *,
    step_px: float = STEP_PX,
    most_steps: int = MOST_STEPS,
) -> BundleSolution:
    """Solution by Gauss-Newton on reweighted squares (Cauchy loss).

    The loss width starts where all pairs count and decreases to the matches' own spread (graduated non-convexity).
    Therefore neither a pair that contradicts the others nor the initial tree affects the result.

    Parameters
    ----------
    bundle
        The matches.
    start
        (n, 3, 3) initial maps.
    own
        Deviation of each pair about its own homography: the lower limit of its loss width, common pixels.
    left_out
        Indices of pairs without effect.
    prior
        Prior on the views, if any.
    step_px, most_steps
        The search ends when no corner of a view moves farther, or after so many steps.
    """
    count = len(bundle.halves)
    counted = [k for k in range(count) if k not in left_out]
    confidences = [c if k not in left_out else 0 * c for k, c in enumerate(bundle.confidences)]
    bundle = replace(bundle, confidences=tuple(confidences))
    least, most = LEAST_DEVIATION_PX, max(GREATEST_DEVIATION * bundle.diagonal, LEAST_DEVIATION_PX)
    maps, damping, converged = start, 1e-9, False
    distances = transfer_distances(bundle, maps)
    width = CAUCHY_WIDTH * max([least, *(float(np.median(distances[k])) for k in counted)])
    deviation = least
    robust: list[Vector] = [np.ones(len(d)) for d in distances]
    for _ in range(most_steps):
        middle = float(np.median(np.concatenate([distances[k] for k in counted]))) / MEDIAN_LENGTH
        deviation = float(np.clip(middle, least, most))
        settled = width * ANNEALING <= CAUCHY_WIDTH * deviation
        width = CAUCHY_WIDTH * deviation if settled else width * ANNEALING
        widths = np.maximum(width, CAUCHY_WIDTH * np.minimum(own, most))
        robust = [cauchy_weights(d, w) for d, w in zip(distances, widths, strict=True)]
        A, g = _normal_equations(bundle, maps, robust, widths, prior)
        cost = _cost(bundle, distances, widths, maps, prior)
        for _ in range(8):
            step = _step(A, g, damping)
            moved = _moved(maps, step)
            distances_moved = transfer_distances(bundle, moved)
            if _cost(bundle, distances_moved, widths, moved, prior) <= cost * (1 + 1e-12):
                break
            damping = max(damping * 100, 1e-6)
        else:
            converged = settled
            break
        maps, distances, damping = moved, distances_moved, max(damping * 0.1, 1e-12)
        if settled and np.abs(step).sum(axis=1).max() * bundle.units.max() < step_px:
            converged = True
            break
    return BundleSolution(
        maps,
        deviation,
        tuple(float(r.mean()) for r in robust),
        tuple(float(np.median(d)) for d in distances),
        converged,
    )


def _cost(
    bundle: Bundle, distances: Sequence[Vector], widths: Vector, maps: Floats, prior: FrontalPrior | None
) -> float:
    """Cauchy's loss of all matches, and the prior's squares."""
    losses = zip(bundle.confidences, distances, widths, strict=True)
    total = sum(float((c * np.log1p((d / w) ** 2)).sum()) for c, d, w in losses)
    if prior is not None:
        total += float((prior.precisions() * (prior.departures(maps)[0] ** 2).sum(axis=1)).sum())
    return total


def transfer_distances(bundle: Bundle, maps: Floats) -> list[Vector]:
    """Distances (N,) of each pair's matches, common pixels: root mean square of both directions."""
    distances = []
    for halves in bundle.halves:
        squares = [
            (_residuals(half, maps, float(bundle.units[half.target]))[0] ** 2).sum(axis=1) for half in halves
        ]
        distances.append(np.asarray(np.sqrt(0.5 * (squares[0] + squares[1]))))
    return distances


def _residuals(half: _Half, maps: Floats, unit: float) -> tuple[Vector, Vector, Homography]:
    """Residuals (N, 2), common pixels; mapped source points (N, 2), normalised; and the map."""
    M = np.linalg.solve(maps[half.target], maps[half.source])
    there = transform_points(M, half.x)
    behind = (half.x @ M[2, :2] + M[2, 2]) * M[2, 2] <= 0
    there[behind] = half.y[behind] + BEHIND
    return (half.y - there) * unit, there, M


def _normal_equations(
    bundle: Bundle, maps: Floats, robust: Sequence[Vector], widths: Vector, prior: FrontalPrior | None
) -> tuple[Floats, Vector]:
    """Matrix (8 n, 8 n) and right side of the normal equations; each map changes in its own view."""
    size = 8 * len(maps)
    A, g = np.zeros((size, size)), np.zeros(size)
    for k, halves in enumerate(bundle.halves):
        root = np.sqrt(bundle.confidences[k] * robust[k]) / widths[k]
        for half in halves:
            unit = float(bundle.units[half.target])
            r, there, M = _residuals(half, maps, unit)
            # M = A_t^-1 A_s becomes (I - D_t) M (I + D_s), which is (I - D_t) (I + M D_s M^-1) M.
            B = (_motions(there) * (unit * root)[:, None, None]).reshape(-1, 9)
            inverse = np.linalg.inv(M)
            moves = (M[:, None, :, None] * inverse.T[None, :, None, :]).reshape(9, 9)  # of D, row by row
            change = np.hstack([np.eye(9)[:, :8], -moves[ENTRIES][:, ENTRIES[:8]]])
            both = np.r_[8 * half.target : 8 * half.target + 8, 8 * half.source : 8 * half.source + 8]
            A[np.ix_(both, both)] += change.T @ (B.T @ B) @ change
            g[both] -= change.T @ (B.T @ (r * root[:, None]).ravel())
    if prior is not None:
        departures, derivatives = prior.departures(maps)
        for k, (r, J, precision) in enumerate(zip(departures, derivatives, prior.precisions(), strict=True)):
            own = slice(8 * k, 8 * k + 8)
            # Each match counts in both directions, so the prior counts twice.
            A[own, own] += 2 * precision * J.T @ J
            g[own] -= 2 * precision * J.T @ r
    return A, g


def _step(A: Floats, g: Vector, damping: float) -> Floats:
    """Changes (n, 8) of all maps.

    The world's own homography is undetermined. Damping, relative to each parameter's weight, keeps it constant.
    """
    scale = np.sqrt(np.maximum(np.diag(A), 1e-12 * max(float(np.diag(A).max()), 1e-300)))
    scaled = A / np.outer(scale, scale) + damping * np.eye(len(A))
    step = np.linalg.lstsq(scaled, g / scale, rcond=1e-11)[0] / scale
    return np.asarray(step.reshape(-1, 8))


def _moved(maps: Floats, step: Floats) -> Floats:
    """Maps after a change by I + D of each in its own view."""
    D = np.zeros_like(maps)
    for column, (i, j) in enumerate(FREE):
        D[:, i, j] = step[:, column]
    moved = maps @ (np.eye(3) + D)
    return np.asarray(moved / np.linalg.norm(moved, axis=(1, 2), keepdims=True))


def _resolutions(count: int, ends: Sequence[tuple[int, int]], pairs: Sequence[PairRegistration]) -> Vector:
    """Flat pixels of each photo per common pixel, by least squares on the logarithms of the pairs' scales."""
    rows, right = np.zeros((len(pairs), count)), np.zeros(len(pairs))
    for k, ((a, b), pair) in enumerate(zip(ends, pairs, strict=True)):
        middle = np.median(pair.points_b, axis=0)[None]
        rows[k, a], rows[k, b] = 1.0, -1.0
        right[k] = 0.5 * np.log(abs(np.linalg.det(jacobians(pair.H_a_b, middle)[0])))
    # The minimum-norm solution has geometric mean 1, independent of the photos' order.
    return np.asarray(np.exp(np.linalg.lstsq(rows, right, rcond=None)[0]))


def _complex(vectors: Floats) -> NDArray[np.complex128]:
    """x + i y of (..., 2)."""
    return np.asarray(vectors[..., 0] + 1j * vectors[..., 1])


def _motions(points: Points) -> Floats:
    """Derivatives (N, 2, 9) of `points` (N, 2) under I + D by the entries `FREE` of D and the last one, for small D."""
    x, y = points.T
    motions = np.zeros((len(points), 2, 9))
    motions[:, 0, 0] = motions[:, 1, 3] = x
    motions[:, 0, 1] = motions[:, 1, 4] = y
    motions[:, 0, 2] = motions[:, 1, 5] = 1.0
    motions[:, 0, 6], motions[:, 1, 7] = -x * x, -y * y
    motions[:, 0, 7] = motions[:, 1, 6] = -x * y
    motions[:, :, 8] = -points
    return motions

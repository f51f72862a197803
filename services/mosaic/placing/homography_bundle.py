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
class Bundle:
    """The matches of all pairs (K), normalised (Hartley): a view's centre is 0 and half its diagonal 1.

    Attributes
    ----------
    normalisations : of each photo, flat pixels -> normalised.
    ends : (K, 2) photos a and b of each pair.
    starts : (K + 1,) where the matches of each pair begin; the last one is their number N.
    points : (2, N, 2) matches on a, and on b.
    confidences : (N,) of the matches.
    initial : normalised `H_a_b` of each pair.
    units : pixels of the common resolution per normalised unit, for each photo.
    evidence : (K,) of the pairs.
    diagonal : mean diagonal of the views, in pixels of the common resolution.
    """

    normalisations: tuple[Homography, ...]
    ends: NDArray[np.intp]
    starts: NDArray[np.intp]
    points: Floats
    confidences: Vector
    initial: tuple[Homography, ...]
    units: Vector
    evidence: Vector
    diagonal: float

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
        points, initial = [], []
        for (a, b), pair in zip(ends, pairs, strict=True):
            on_a = transform_points(normalisations[a], pair.points_a)
            points.append(np.stack([on_a, transform_points(normalisations[b], pair.points_b)]))
            initial.append(normalisations[a] @ pair.H_a_b @ np.linalg.inv(normalisations[b]))
        units = half_diagonals / resolutions
        return Bundle(
            tuple(normalisations),
            np.array(ends, np.intp),
            np.cumsum([0, *(len(pair.weights) for pair in pairs)]),
            np.concatenate(points, axis=1),
            np.concatenate([np.asarray(pair.weights, np.float64) for pair in pairs]),
            tuple(initial),
            units,
            np.array([float(pair.weights.sum()) * pair.agreement for pair in pairs]),
            float(2 * units.mean()),
        )

    @property
    def pair(self) -> NDArray[np.intp]:
        """Pair (N,) of each match."""
        return np.repeat(np.arange(len(self.ends)), np.diff(self.starts))

    def of_pairs(self, values: Vector) -> list[Vector]:
        """Those of `values` (N,) that belong to each pair."""
        return np.split(values, self.starts[1:-1])

    def only(self, k: int) -> "Bundle":
        """The bundle of pair `k` alone."""
        own = slice(self.starts[k], self.starts[k + 1])
        return replace(
            self,
            ends=self.ends[k : k + 1],
            starts=self.starts[k : k + 2] - self.starts[k],
            points=self.points[:, own],
            confidences=self.confidences[own],
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
    pair = bundle.pair
    counted = ~np.isin(pair, list(left_out))
    bundle = replace(bundle, confidences=np.where(counted, bundle.confidences, 0.0))
    least, most = LEAST_DEVIATION_PX, max(GREATEST_DEVIATION * bundle.diagonal, LEAST_DEVIATION_PX)
    maps, damping, converged = start, 1e-9, False
    distances = transfer_distances(bundle, maps)
    medians = [float(np.median(each)) for each in bundle.of_pairs(distances)]
    width = CAUCHY_WIDTH * max([least, *(m for k, m in enumerate(medians) if k not in left_out)])
    deviation = least
    robust: Vector = np.ones(len(distances))
    for _ in range(most_steps):
        deviation = float(np.clip(np.median(distances[counted]) / MEDIAN_LENGTH, least, most))
        settled = width * ANNEALING <= CAUCHY_WIDTH * deviation
        width = CAUCHY_WIDTH * deviation if settled else width * ANNEALING
        widths = np.maximum(width, CAUCHY_WIDTH * np.minimum(own, most))[pair]
        robust = cauchy_weights(distances, widths)
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
        tuple(float(each.mean()) for each in bundle.of_pairs(robust)),
        tuple(float(np.median(each)) for each in bundle.of_pairs(distances)),
        converged,
    )


def _cost(
    bundle: Bundle, distances: Vector, widths: Vector, maps: Floats, prior: FrontalPrior | None
) -> float:
    """Cauchy's loss of all matches, and the prior's squares."""
    total = float((bundle.confidences * np.log1p((distances / widths) ** 2)).sum())
    if prior is not None:
        total += float((prior.precisions() * (prior.departures(maps)[0] ** 2).sum(axis=1)).sum())
    return total


def transfer_distances(bundle: Bundle, maps: Floats) -> Vector:
    """Distances (N,) of the matches, common pixels: root mean square of both directions."""
    residuals = _residuals(bundle, maps)[0]
    squares = residuals[..., 0] ** 2 + residuals[..., 1] ** 2
    return np.asarray(np.sqrt(0.5 * (squares[0] + squares[1])))


def _residuals(bundle: Bundle, maps: Floats) -> tuple[Floats, Floats, Floats]:
    """Of both directions, to a and to b: residuals (2, N, 2), common pixels; mapped source points (2, N, 2),
    normalised; and the maps (2, K, 3, 3)."""
    target = bundle.ends.T
    M = np.linalg.solve(maps[target], maps[target[::-1]])
    h = np.repeat(M.reshape(*M.shape[:2], 9), np.diff(bundle.starts), axis=1)
    x, y = bundle.points[::-1, :, 0], bundle.points[::-1, :, 1]
    with np.errstate(divide="ignore", invalid="ignore"):
        w = x * h[..., 6] + y * h[..., 7] + h[..., 8]
        rows = [x * h[..., k] + y * h[..., k + 1] + h[..., k + 2] for k in (0, 3)]
        there = np.stack([row / w for row in rows], axis=-1)
    behind = w * h[..., 8] <= 0
    there[behind] = bundle.points[behind] + BEHIND
    units = np.repeat(bundle.units[target], np.diff(bundle.starts), axis=1)
    return (bundle.points - there) * units[..., None], there, M


def _normal_equations(
    bundle: Bundle, maps: Floats, robust: Vector, widths: Vector, prior: FrontalPrior | None
) -> tuple[Floats, Vector]:
    """Matrix (8 n, 8 n) and right side of the normal equations; each map changes in its own view."""
    size = 8 * len(maps)
    A, g = np.zeros((size, size)), np.zeros(size)
    root = np.sqrt(bundle.confidences * robust) / widths
    r, there, M = _residuals(bundle, maps)
    units = np.repeat(bundle.units[bundle.ends.T], np.diff(bundle.starts), axis=1)
    # The derivatives of both coordinates, and in the last column the residuals.
    B = np.empty((*r.shape, 10))
    B[..., :9] = _motions(there.reshape(-1, 2)).reshape(*r.shape, 9) * (units * root)[..., None, None]
    B[..., 9] = r * root[:, None]
    parts = [
        of_direction[start:end].reshape(-1, 10)
        for of_direction in B
        for start, end in zip(bundle.starts[:-1], bundle.starts[1:], strict=True)
    ]
    products = np.stack([part[:, :9].T @ part for part in parts])
    # M = A_t^-1 A_s becomes (I - D_t) M (I + D_s), which is (I - D_t) (I + M D_s M^-1) M.
    M = M.reshape(-1, 3, 3)
    turned = np.linalg.inv(M).swapaxes(1, 2)
    moves = (M[:, :, None, :, None] * turned[:, None, :, None, :]).reshape(-1, 9, 9)  # of D, row by row
    change = np.empty((len(M), 9, 16))
    change[..., :8] = np.eye(9)[:, :8]
    change[..., 8:] = -moves[:, ENTRIES][..., ENTRIES[:8]]
    left = change.swapaxes(1, 2)
    target = bundle.ends.T
    photos = np.stack([target, target[::-1]], axis=-1).reshape(-1, 2)
    both = (8 * photos[..., None] + np.arange(8)).reshape(-1, 16)
    np.add.at(A, (both[:, :, None], both[:, None, :]), left @ products[..., :9] @ change)
    np.subtract.at(g, both, (left @ products[..., 9:])[..., 0])
    if prior is not None:
        departures, derivatives = prior.departures(maps)
        for k, (off, J, precision) in enumerate(
            zip(departures, derivatives, prior.precisions(), strict=True)
        ):
            own = slice(8 * k, 8 * k + 8)
            # Each match counts in both directions, so the prior counts twice.
            A[own, own] += 2 * precision * J.T @ J
            g[own] -= 2 * precision * J.T @ off
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

"""Initial normals by dynamic programming over rotation angles, initial focal length by a cubic fit (3.3.5)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.dissertation_chain.strips.constraints import (
    Deviations,
    lines_of_sight,
    sample_shares,
    tangents,
    unit,
)
from benchmarks.dissertation_chain.strips.evidence import StripEvidence
from services.arrays import Floats, Vector

_CHANGE, _UNSTEADINESS = 0.4, 0.6
"""Ruling directions turn by this much over a page, rad, and their turning changes by this much."""
_RULING_RAD = 0.02
"""Error of a projected ruling."""
_SLANT_RAD = 0.7
"""Nothing known of a ruling's vanishing point, the ruling is taken to be seen from the front, give or take this."""


COARSE_DEVIATIONS = Deviations(developability=6e-3, parallelism=1e-2, geodesic=4e-3)
"""What the steps of the angles leave of the constraints between strips."""


@dataclass(frozen=True, slots=True)
class FocalKnowledge:
    """What is known of the focal length beforehand: its logarithm (unit: half the diagonal) and the deviation of that.

    `fixed` takes it as it is.
    """

    log_focal: float
    deviation: float
    fixed: bool = False


@dataclass(frozen=True, slots=True)
class InitialParameters:
    """Grids of the search."""

    shortest_focal: float = 0.75
    longest_focal: float = 4.5
    """Physical lenses, 16 to 100 mm equivalent, over half the diagonal."""
    focal_lengths: int = 9
    coarse_step_rad: float = float(np.radians(4.0))
    fine_steps: int = 4
    """Fine grid: this many steps on either side of the coarse angle, to just short of its neighbours."""
    max_slant_rad: float = float(np.radians(80.0))
    """Largest angle between a strip's normal and the line of sight that it is looked for at."""
    slant_rad: float = 0.3
    """The vanishing points together tell the rulings' slant to the image when their deviation is less."""
    slants_rad: tuple[float, ...] = (-0.8, -0.4, 0.0, 0.4, 0.8)
    """Slants to try where they do not."""


@dataclass(frozen=True, slots=True, eq=False)
class InitialShape:
    """Normals N0 (L, 3) and focal length f0; the trial focal lengths (F,) with the objective at each (F,)."""

    normals: Floats
    focal: float
    trial_focals: Vector
    objective: Vector


def estimate_initial_shape(
    evidence: StripEvidence,
    knowledge: FocalKnowledge,
) -> InitialShape:
    """Best normals for every trial focal length, and the focal length where a cubic through the objective is least."""
    d, p = COARSE_DEVIATIONS, InitialParameters()
    known = float(np.exp(knowledge.log_focal))
    if knowledge.fixed:
        found = [search_normals(evidence, known, d, p, slant) for slant in _slants(evidence, p)]
        normals, cost = min(found, key=lambda one: one[1])
        return InitialShape(normals, known, np.array([known]), np.array([cost]))
    trials = np.geomspace(p.shortest_focal, p.longest_focal, p.focal_lengths)
    slants = _slants(evidence, p)
    costs = [[search_normals(evidence, float(f), d, p, slant)[1] for slant in slants] for f in trials]
    prior = ((np.log(trials) - knowledge.log_focal) / knowledge.deviation) ** 2
    objective = np.array(costs) + prior[:, None]
    best = slants[int(np.argmin(objective.min(axis=0)))]
    objective = objective.min(axis=1)
    focal = float(np.exp(least_of_cubic(np.log(trials), objective)))
    normals, _ = search_normals(evidence, focal, d, p, best)
    return InitialShape(normals, focal, trials, objective)


def _slants(evidence: StripEvidence, p: InitialParameters) -> tuple[float, ...]:
    """Common slants of the rulings to try: several where their vanishing points do not tell it."""
    told = np.sum(1 / (p.slant_rad**2 + evidence.vanishing_deviations**2))
    return (0.0,) if told * p.slant_rad**2 > 1 else p.slants_rad


def least_of_cubic(x: Vector, y: Vector, reach: int = 2) -> float:
    """Place of the minimum of the third-order polynomial fitted to `y` (N,) around its least value, N > 2 `reach`.

    The fit takes `reach` values of `x` (N,), in order, on either side, and its minimum is looked for among them:
    far from the minimum the objective levels off, which no cubic follows.
    """
    first = int(np.clip(np.argmin(y) - reach, 0, len(x) - 2 * reach - 1))
    x, y = x[first : first + 2 * reach + 1], y[first : first + 2 * reach + 1]
    cubic = np.polynomial.Polynomial.fit(x, y, 3)
    turning = cubic.deriv().roots()
    inside = np.real(turning[np.abs(np.imag(turning)) < 1e-9])
    candidates = np.concatenate([inside[(inside > x[0]) & (inside < x[-1])], x[[0, -1]]])
    return float(candidates[np.argmin(cubic(candidates))])


def ruling_directions(
    evidence: StripEvidence, focal: float, deviations: Deviations, slant_rad: float = 0.0
) -> Floats:
    """Unit directions (L + 1, 3) of the rulings in space, pointing down the page.

    A vanishing point gives the direction with its own deviation. Where there is none, or a poor one, neighbours
    do: directions change little and steadily across a developable surface. All lie in their ruling's plane of sight.
    Where none has any, all go away from the viewer by `slant_rad`, downwards.
    """
    count = len(evidence.rulings)
    v = evidence.vanishing_points
    seen = unit(np.column_stack([v[:, :2], focal * v[:, 2]]))
    flat = np.column_stack([evidence.rulings, np.zeros(count)])
    # The end of the ruling that is "down": D = mu r + nu V, the sign of mu.
    sight = unit(lines_of_sight(evidence.reference_points, focal))
    planes = unit(np.cross(flat, sight))
    downwards = np.einsum("la,la->l", np.cross(seen, sight), planes)
    seen = seen * np.where(downwards < 0, -1.0, 1.0)[:, None]
    weight = 1 / (deviations.vanishing**2 + evidence.vanishing_deviations**2)
    weak = 1 / _SLANT_RAD**2
    frontal = flat - sight * np.einsum("la,la->l", flat, sight)[:, None]
    # Least squares in all directions at once: data, planes of sight, small and steady changes over the page.
    change, steady = np.diff(np.eye(count), axis=0), np.diff(np.eye(count), 2, axis=0)
    steps = count - 1.0
    smooth = change.T @ change * (steps / _CHANGE**2) + steady.T @ steady * (steps**3 / _UNSTEADINESS**2)
    matrix = np.zeros((count, 3, count, 3))
    index = np.arange(count)
    for axis in range(3):
        matrix[:, axis, :, axis] = smooth
        matrix[index, axis, index, axis] += weight + weak
    matrix[index, :, index, :] += planes[:, :, None] * planes[:, None, :] / _RULING_RAD**2
    slanted = np.cos(slant_rad) * unit(frontal) + np.sin(slant_rad) * sight
    right = weight[:, None] * seen + weak * slanted
    solved = np.linalg.solve(matrix.reshape(3 * count, -1), right.ravel()).reshape(count, 3)
    return unit(solved)


def search_normals(
    evidence: StripEvidence,
    focal: float,
    deviations: Deviations,
    parameters: InitialParameters,
    slant_rad: float = 0.0,
) -> tuple[Floats, float]:
    """Normals (L, 3) orthogonal to the rulings that minimise the objective, and its value, by dynamic programming."""
    R = ruling_directions(evidence, focal, deviations, slant_rad)
    across = unit(R[1:] + R[:-1])
    middles = evidence.points.mean(axis=1)
    sight = unit(lines_of_sight(middles, focal))
    ahead = unit(sight - across * np.einsum("la,la->l", sight, across)[:, None])
    aside = np.cross(across, ahead)

    steps = int(parameters.max_slant_rad / parameters.coarse_step_rad)
    coarse = np.broadcast_to(
        np.arange(-steps, steps + 1) * parameters.coarse_step_rad, (evidence.count, 2 * steps + 1)
    )
    fine = np.arange(-parameters.fine_steps, parameters.fine_steps + 1) / (parameters.fine_steps + 1)
    best = np.zeros(evidence.count)
    normals, cost = ahead, np.inf
    for grid in (coarse, fine[None] * parameters.coarse_step_rad):
        angles = grid + best[:, None]
        candidates = np.cos(angles)[..., None] * ahead[:, None] + np.sin(angles)[..., None] * aside[:, None]
        unary, pairwise = cost_tables(evidence, candidates, R[1:-1], focal, deviations)
        path, cost = least_path(unary, pairwise)
        best = np.take_along_axis(angles, path[:, None], axis=1)[:, 0]
        normals = np.take_along_axis(candidates, path[:, None, None], axis=1)[:, 0]
    return normals, cost


def cost_tables(
    evidence: StripEvidence, candidates: Floats, rulings: Floats, focal: float, deviations: Deviations
) -> tuple[Floats, Floats]:
    """Objective of candidate normals (L, K, 3): of each alone (L, K), and of neighbours (L - 1, K, K).

    Alone: mu_2, mu_4; together: mu_1, mu_3, mu_5 with the inner `rulings` (L - 1, 3) in space.
    """
    per_candidate = candidates[:, :, None, :]
    T = tangents(evidence.major[:, None], evidence.points[:, None], per_candidate, focal)
    B = tangents(evidence.minor[:, None], evidence.points[:, None], per_candidate, focal)
    mean = np.einsum("lj,lkja->lka", sample_shares(evidence), T)
    apart = np.sum((T - mean[:, :, None]) ** 2, axis=-1) / deviations.parallelism**2
    slanted = np.einsum("lkja,lkja->lkj", T, B) ** 2 / deviations.orthogonality**2
    unary = np.einsum("lj,lkj->lk", evidence.major_weights, soft(apart))
    unary += np.einsum("lj,lkj->lk", evidence.minor_weights, soft(slanted))

    def difference(vectors: Floats) -> Floats:
        left = np.einsum("lka,la->lk", vectors[:-1], rulings)
        right = np.einsum("lka,la->lk", vectors[1:], rulings)
        return np.asarray(right[:, None, :] - left[:, :, None])

    together = np.minimum(evidence.major_weights[1:].mean(axis=1), evidence.major_weights[:-1].mean(axis=1))
    pairwise = (difference(candidates) / deviations.developability) ** 2
    pairwise += together[:, None, None] * (difference(mean) / deviations.geodesic) ** 2
    turn = 2 - 2 * np.einsum("lka,lma->lkm", candidates[:-1], candidates[1:])
    pairwise += turn / deviations.smoothness**2
    return unary, pairwise


def soft(squares: Floats) -> Floats:
    """Soft L1 loss of squared residuals: 2 (sqrt(1 + z) - 1)."""
    return np.asarray(2 * (np.sqrt(1 + squares) - 1))


def least_path(unary: Floats, pairwise: Floats) -> tuple[NDArray[np.intp], float]:
    """Choice (L,) of one of K at each of L places with the least sum of costs (L, K) and (L - 1, K, K), and the sum."""
    count, choices = unary.shape
    cost = unary[0]
    came_from = np.zeros((count, choices), np.intp)
    for place in range(1, count):
        ways = cost[:, None] + pairwise[place - 1]
        came_from[place] = np.argmin(ways, axis=0)
        cost = np.min(ways, axis=0) + unary[place]
    path = np.zeros(count, np.intp)
    path[-1] = np.argmin(cost)
    for place in range(count - 1, 0, -1):
        path[place - 1] = came_from[place, path[place]]
    return path, float(np.min(cost))

"""Projected rulings by dynamic programming over their directions (dissertation 3.3.3, Appendix B)."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from benchmarks.dissertation_chain.rulings.convergence import Directions, Weights, measure_convergence
from benchmarks.dissertation_chain.rulings.reference_points import (
    choose_reference_points,
    follow_in_order,
    keep_dense_text,
)
from benchmarks.dissertation_chain.rulings.results import ProjectedRulings
from benchmarks.dissertation_chain.rulings.ruling_family import (
    FamilyEvidence,
    FamilyParameters,
    FlowWitness,
    RulingFamily,
    fit_ruling_family,
)
from benchmarks.dissertation_chain.rulings.text_density import measure_text_density
from services.arrays import Floats, Points, Vector
from services.geometry.hulls import text_hull
from services.texture_flow.field import angle_difference


@dataclass(frozen=True, slots=True)
class RulingParameters:
    """Lengths are in centred unit coordinates (half the photo's diagonal)."""

    count: int = 26
    """Reference points, the two outside of the text included."""
    samples: int = 41
    """Samples along every line."""
    density_spacing: float = 0.03
    first_step_rad: float = np.deg2rad(6.0)
    first_lines: int = 12
    """Parallel lines, over the whole text, that tell the first direction."""
    first_candidates: int = 3
    first_excess: float = 6.0
    """Candidates may converge this much worse (mean square) than the best."""
    coarse_step_rad: float = np.deg2rad(2.5)
    coarse_range_rad: float = np.deg2rad(50.0)
    fine_step_rad: float = np.deg2rad(0.4)
    fine_range_rad: float = np.deg2rad(6.0)
    major_noise_rad: float = np.deg2rad(0.35)
    """Errors of the dense fields; they are smooth, hence the length over which they hold."""
    minor_noise_rad: float = np.deg2rad(1.2)
    correlation: float = 0.15
    saturation: float = 3.0
    """Misfits grow linearly beyond this many deviations."""
    family_rad: float = np.deg2rad(1.0)
    """Deviation of a ruling from the family of all."""
    turn_rad: float = np.deg2rad(0.5)
    """Deviation of the change of that from a ruling to its neighbour."""
    least_crossing_rad: float = np.deg2rad(35.0)
    """Where the major flow meets the rulings at less, the minor flow is the witness."""
    family: FamilyParameters = field(default_factory=FamilyParameters)
    curved_rad: float = np.deg2rad(3.0)
    """A ruling is seen where its own evidence places it within this."""


def detect_projected_rulings(
    major_at: Directions,
    text_points: Points,
    minor_at: Directions | None = None,
    trust_at: Weights | None = None,
) -> ProjectedRulings:
    """Rulings of the page whose characters are at `text_points` (N, 2), all in centred unit coordinates.

    `major_at` and `minor_at` tell the directions (M,) of both flows at points (M, 2); `trust_at` how far (0-1) they
    are to be trusted there: at the border of the text they are extrapolated. Finite for any input: where the flows
    are uniform or there is no text, the rulings mean nothing, and none is `curved`.

    First one family of rulings is fitted to the whole page, then dynamic programming lets each ruling leave it for
    its own evidence, coarsely over the half circle and finely around that, never crossing its neighbour.
    """
    p = RulingParameters()
    scene = _look(major_at, text_points, minor_at, trust_at, p)
    trials = []
    for first in _first_directions(scene, p):
        points = choose_reference_points(scene.hull, scene.centre, first, p.count)
        trials.append(_fit_family(scene, points, first, p))
    return _search(scene, *min(trials, key=lambda trial: trial[1].cost), p)


@dataclass(frozen=True, slots=True, eq=False)
class _Scene:
    """Flows and text; `places` (M,) where lines are sampled."""

    flows: list[FlowWitness]
    weight_at: Weights
    hull: Points
    centre: Points
    places: Vector


def _look(
    major_at: Directions,
    text_points: Points,
    minor_at: Directions | None,
    trust_at: Weights | None,
    p: RulingParameters,
) -> _Scene:
    text = keep_dense_text(np.asarray(text_points, np.float64).reshape(-1, 2), 4 * p.density_spacing)
    text = text if len(text) else np.zeros((1, 2))
    flows = [FlowWitness(major_at, p.major_noise_rad)]
    if minor_at is not None:
        flows.append(FlowWitness(minor_at, p.minor_noise_rad))
    density = measure_text_density(text, p.density_spacing)

    def weight_at(points: Points) -> Vector:
        weight = density.at(points)
        return weight if trust_at is None else weight * trust_at(points)

    hull = text_hull(text)
    centre = text.mean(axis=0)
    reach = 1.1 * float(np.linalg.norm(hull - centre, axis=1).max())
    return _Scene(flows, weight_at, hull, centre, np.linspace(-reach, reach, p.samples))


def _fit_family(
    scene: _Scene, points: Points, first: float, p: RulingParameters
) -> tuple[FamilyEvidence, RulingFamily]:
    witness, other = _choose_witness(scene, points, first, p)
    evidence = FamilyEvidence(points, first, scene.places, scene.weight_at, witness, other)
    return evidence, fit_ruling_family(evidence, p.family)


def _search(
    scene: _Scene, evidence: FamilyEvidence, family: RulingFamily, p: RulingParameters
) -> ProjectedRulings:
    """Dynamic programming round the `family`, coarsely and then finely."""
    points, rows = evidence.points, np.arange(len(evidence.points))

    def search(angles: Floats) -> tuple[Vector, Vector, NDArray[np.bool_]]:
        costs, squares = measure_costs(scene.flows, scene.weight_at, points, angles, scene.places, p)
        off = angle_difference(angles, family.angles[:, None])
        chosen = search_in_order(
            costs + 0.5 * (off / p.family_rad) ** 2,
            off,
            p.turn_rad,
            follow_in_order(scene.hull, points, angles),
        )
        located = _locates(costs, angles, chosen, p.curved_rad)
        return angles[rows, chosen], squares[rows, chosen], located

    coarse = np.arange(-p.coarse_range_rad, p.coarse_range_rad + 1e-9, p.coarse_step_rad)
    fine = np.arange(-p.fine_range_rad, p.fine_range_rad + 1e-9, p.fine_step_rad)
    # All rulings share the coarse directions, so that parallel ones can always be chosen.
    angles, _, _ = search(np.tile(evidence.first + coarse, (len(points), 1)))
    angles, squares, curved = search(angles[:, None] + fine)
    return ProjectedRulings(points, angles % np.pi, np.sqrt(squares), curved)


def _first_directions(scene: _Scene, p: RulingParameters) -> Vector:
    """Candidates for the rulings' common direction, best first: where parallel lines over the whole text converge.

    The appendix looks at the ruling through the centre alone; there one straight text line would do as well. Even
    all lines together can have several minima (along the text of a page that is hardly bent), so that the family
    of rulings must decide.
    """
    angles = np.arange(0.0, np.pi - 1e-9, p.first_step_rad)
    points = np.concatenate(
        [choose_reference_points(scene.hull, scene.centre, a, p.first_lines) for a in angles]
    )
    each = np.repeat(angles, p.first_lines)[:, None]
    costs = np.zeros(len(angles))
    for flow in scene.flows:
        found = measure_convergence(flow.at, scene.weight_at, points, each, scene.places)
        square = (found.mean_square * found.weight).reshape(len(angles), -1).sum(axis=1)
        weight = found.weight.reshape(len(angles), -1).sum(axis=1)
        costs += square / np.maximum(weight, 1e-12) / flow.noise_rad**2
    least = np.flatnonzero((costs <= np.roll(costs, 1)) & (costs < np.roll(costs, -1)))
    least = least if len(least) else np.array([np.argmin(costs)])
    least = least[np.argsort(costs[least])][: p.first_candidates]
    return np.asarray(angles[least[costs[least] <= p.first_excess * costs[least[0]] + 1e-12]])


def _choose_witness(
    scene: _Scene, points: Points, angle: float, p: RulingParameters
) -> tuple[FlowWitness, FlowWitness | None]:
    """The flow whose directions tell of rulings near `angle`, and the other.

    The major flow does (it is the better measured) unless it runs along the rulings: the case that 3.4.2 leaves open.
    """
    flows = scene.flows
    if len(flows) == 1:
        return flows[0], None
    weight = scene.weight_at(points)
    alpha = flows[0].at(points) - angle
    crossing = float(weight @ np.abs(np.sin(alpha))) / max(float(weight.sum()), 1e-12)
    return (flows[0], flows[1]) if crossing >= np.sin(p.least_crossing_rad) else (flows[1], flows[0])


def measure_costs(
    flows: list[FlowWitness],
    weight_at: Weights,
    points: Points,
    angles: Floats,
    places: Vector,
    p: RulingParameters,
) -> tuple[Floats, Floats]:
    """Costs (N, J), half the squared misfits over the flows' noise, and the major flow's mean squares (N, J) rad^2.

    A reference point's cost weighs by the text along it in all directions alike, so that no direction gains by
    leaving the text; one that has left it costs the average.
    """
    costs = np.zeros(angles.shape)
    first: Floats | None = None
    for flow in flows:
        found = measure_convergence(flow.at, weight_at, points, angles, places)
        usual = np.median(found.weight, axis=1, keepdims=True)
        trust = np.clip(found.weight / np.maximum(0.5 * usual, 1e-6), 0.0, 1.0)
        ratio = found.mean_square / flow.noise_rad**2
        ratio = np.where(ratio > p.saturation**2, p.saturation * (2 * np.sqrt(ratio) - p.saturation), ratio)
        average = (ratio * trust).sum(axis=1, keepdims=True) / np.maximum(
            trust.sum(axis=1, keepdims=True), 1e-9
        )
        costs += 0.5 * usual / p.correlation * (trust * ratio + (1 - trust) * average)
        first = found.mean_square if first is None else first
    assert first is not None
    return costs, first


def search_in_order(
    costs: Floats, off: Floats, turn_rad: float, allowed: NDArray[np.bool_]
) -> NDArray[np.intp]:
    """Direction (N,) of every ruling, as index into `angles` (N, J), of least total cost without a crossing.

    The Psi of 3.3.3 is infinite where neighbours cross inside the text; elsewhere a small cost on the change of
    direction (deviation `turn_rad`) lets flat parts, whose `costs` (N, J) tell nothing, follow the curved ones.
    """
    turn = off[1:, None, :] - off[:-1, :, None]
    pair = np.where(allowed, 0.5 * (turn / turn_rad) ** 2, np.inf)
    best = costs[0]
    back = np.zeros(costs.shape, np.intp)
    for i, between in enumerate(pair):
        total = best[:, None] + between
        back[i + 1] = np.argmin(total, axis=0)
        best = total[back[i + 1], np.arange(costs.shape[1])] + costs[i + 1]
    chosen = np.zeros(len(costs), np.intp)
    chosen[-1] = int(np.argmin(best))
    for i in range(len(costs) - 1, 0, -1):
        chosen[i - 1] = back[i, chosen[i]]
    return chosen


def _locates(costs: Floats, angles: Floats, chosen: NDArray[np.intp], limit_rad: float) -> NDArray[np.bool_]:
    """Where a ruling's own costs (N, J) place it within `limit_rad`: (N,) bool."""
    weight = np.exp(-(costs - costs.min(axis=1, keepdims=True)))
    rows = np.arange(len(costs))
    off = angles - angles[rows, chosen][:, None]
    spread = np.sqrt((weight * off**2).sum(axis=1) / weight.sum(axis=1))
    return np.asarray(spread < limit_rad)

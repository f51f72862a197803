"""What the photo tells of every strip: its rulings, their vanishing points, and flow samples inside of it."""

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from benchmarks.dissertation_chain.rulings.results import ProjectedRulings, RulingVanishingPoints
from benchmarks.dissertation_chain.strips.coverage import cover_text
from services.arrays import Floats, Points, Vector
from services.robust import cauchy_weights, robust_scale

_USUAL_WIDTH = 0.2
"""Of a single strip, whose neighbours do not tell it, in half diagonals."""


_ROUNDS = 4
_LEAST_ERROR_RAD = float(np.radians(1.0))
"""Directions that fit a line as well as this are not told apart."""


class Flow(Protocol):
    """A texture flow, in centred unit coordinates."""

    def at(self, points: Points) -> Vector:
        """Directions (N,) rad modulo pi at points (N, 2)."""
        ...

    def trust_at(self, points: Points) -> Vector:
        """How far they are to be trusted (N,): 1 among measurements, 0 far from any."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class StripEvidence:
    """L strips between L + 1 rulings, left to right along the text, in centred unit coordinates.

    `reference_points` (L + 1, 2) and unit `rulings` (L + 1, 2) are p_i and r_i of 3.3.5, `vanishing_points`
    (L + 1, 3) homogeneous unit vectors with `vanishing_deviations` (L + 1,) rad at focal length 1 (infinite:
    unknown). `points` (L, J, 2) are samples inside the strips with unit flow directions `major` and `minor`
    (L, J, 2) and weights `major_weights`, `minor_weights` (L, J), 0 where nothing is known.
    Directions are signed: `major` to the right along the text, `minor` and `rulings` down across it.
    """

    reference_points: Points
    rulings: Floats
    vanishing_points: Floats
    vanishing_deviations: Vector
    points: Floats
    major: Floats
    minor: Floats
    major_weights: Floats
    minor_weights: Floats

    @property
    def count(self) -> int:
        """Number of strips, L."""
        return len(self.rulings) - 1

    @property
    def ruling_angles(self) -> Vector:
        """Directions (L + 1,) of the rulings, rad in [0, pi)."""
        return np.asarray(np.arctan2(self.rulings[:, 1], self.rulings[:, 0]) % np.pi)


def gather_evidence(
    rulings: ProjectedRulings,
    vanishing_points: RulingVanishingPoints,
    major: Flow,
    minor: Flow | None,
    characters: Points,
    per_strip: int = 12,
) -> StripEvidence:
    """Flow samples on the centre line of every strip, as far as its `characters` (N, 2) reach.

    On the centre line the strip's plane is the tangent plane of the surface, so that its samples have no error of
    first order. Rulings are continued to where the text ends (see `coverage`); they may come in either order, the
    strips run to the right. A sample weighs by the characters near it and by the trust in its flow. `minor` is None
    where no strokes were found.

    Raises
    ------
    ValueError
        When there are fewer than two rulings: there is no strip between them.
    """
    if len(rulings) < 2:
        raise ValueError("a strip needs two rulings")
    rulings, vanishing_points = cover_text(rulings, vanishing_points, characters)
    along = _mean_axis(major.at(_spread(characters, rulings.points)))
    along = along if along[0] >= 0 else -along
    down = np.array([-along[1], along[0]])
    backwards = (rulings.points[-1] - rulings.points[0]) @ along < 0
    order = slice(None, None, -1) if backwards else slice(None)
    points = np.asarray(rulings.points[order], np.float64)
    directions = _signed(rulings.angles[order], down)
    middles, centre_lines = _centre_lines(points, directions)
    places, weights = _places_on_lines(middles, centre_lines, characters, per_strip)
    samples = middles[:, None] + places[..., None] * centre_lines[:, None]
    flat = samples.reshape(-1, 2)
    major_flow = _signed(major.at(flat), along).reshape(samples.shape)
    major_weights = weights * major.trust_at(flat).reshape(weights.shape)
    if minor is None:
        minor_flow, minor_weights = np.broadcast_to(down, samples.shape), np.zeros(weights.shape)
    else:
        minor_flow = _signed(minor.at(flat), down).reshape(samples.shape)
        minor_weights = weights * minor.trust_at(flat).reshape(weights.shape)
    return StripEvidence(
        points,
        directions,
        vanishing_points.directions[order],
        vanishing_points.deviations[order],
        samples,
        major_flow,
        minor_flow,
        major_weights,
        minor_weights,
    )


def distrust_outliers(evidence: StripEvidence) -> StripEvidence:
    """The same with less weight for samples that leave the steady turn of a flow along their strip.

    Along a ruling a flow turns towards its vanishing point, almost evenly: a straight line is fitted to the directions
    of each strip, robustly, and a sample is weighted by Cauchy's loss of its distance. Averages over a strip
    (3.3.5) take wild samples in otherwise.
    """
    along = np.einsum(
        "lja,la->lj", evidence.points - evidence.points.mean(axis=1, keepdims=True), _centres(evidence)
    )
    return replace(
        evidence,
        major_weights=_steady(along, evidence.major, evidence.major_weights),
        minor_weights=_steady(along, evidence.minor, evidence.minor_weights),
    )


def _centres(evidence: StripEvidence) -> Floats:
    return _centre_lines(evidence.reference_points, evidence.rulings)[1]


def _steady(along: Floats, flow: Floats, weights: Floats) -> Floats:
    """`weights` (L, J) times Cauchy's weights of a robust line through the directions of each strip."""
    mean = _mean_axis(np.arctan2(flow[..., 1], flow[..., 0]).ravel())
    turn = np.arctan2(mean[0] * flow[..., 1] - mean[1] * flow[..., 0], flow @ mean)
    turn = (turn + np.pi / 2) % np.pi - np.pi / 2
    trust: Floats = np.ones(weights.shape)
    for _ in range(_ROUNDS):
        w = weights * trust + 1e-9
        total = w.sum(axis=1, keepdims=True)
        place = along - (w * along).sum(axis=1, keepdims=True) / total
        level = (w * turn).sum(axis=1, keepdims=True) / total
        slope = (w * place * turn).sum(axis=1, keepdims=True) / (
            (w * place**2).sum(axis=1, keepdims=True) + 1e-9
        )
        distance = turn - level - slope * place
        # Median and scale of the whole page: a strip's own samples are few.
        scale = max(robust_scale(distance), _LEAST_ERROR_RAD)
        trust = cauchy_weights(distance, 3 * scale)
    return np.asarray(weights * trust)


def _spread(characters: Points, otherwise: Points) -> Points:
    return characters[:: len(characters) // 2000 + 1] if len(characters) else otherwise


def _mean_axis(angles: Vector) -> Vector:
    """Unit vector (2,) of the mean direction modulo pi."""
    mean = 0.5 * np.arctan2(np.sin(2 * angles).sum(), np.cos(2 * angles).sum())
    return np.array([np.cos(mean), np.sin(mean)])


def _signed(angles: Vector, towards: Vector) -> Floats:
    """Unit vectors (N, 2) of directions modulo pi: all on the side of their mean, which is signed `towards`."""
    mean = _mean_axis(angles)
    mean = mean if mean @ towards >= 0 else -mean
    vectors = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    return np.asarray(np.where(vectors @ mean >= 0, 1.0, -1.0)[:, None] * vectors)


def _centre_lines(points: Points, rulings: Floats) -> tuple[Points, Floats]:
    """Points (L, 2) and unit directions (L, 2) of the lines halfway between neighbouring rulings."""
    middle = (points[1:] + points[:-1]) / 2
    between = rulings[1:] + rulings[:-1]
    return middle, between / np.maximum(np.linalg.norm(between, axis=1, keepdims=True), 1e-12)


def _places_on_lines(
    middles: Points, lines: Floats, characters: Points, per_strip: int
) -> tuple[Floats, Floats]:
    """Parameters (L, J) of samples along the strips' centre lines, and their weights (L, J)."""
    steps = np.linalg.norm(np.diff(middles, axis=0), axis=1)
    width = max(float(np.median(steps)), 1e-3) if len(steps) else _USUAL_WIDTH
    offset = characters[None] - middles[:, None]
    along = np.einsum("lnk,lk->ln", offset, lines)
    across = offset[..., 0] * lines[:, None, 1] - offset[..., 1] * lines[:, None, 0]
    near = np.abs(across) < width
    if not near.any():
        places = np.broadcast_to(np.linspace(-0.3, 0.3, per_strip), (len(middles), per_strip))
        return places, np.zeros(places.shape)
    low, high = np.min(along[near]), np.max(along[near])
    bounds = np.array(
        [
            np.quantile(a[n], [0.01, 0.99]) if n.any() else (low, high)
            for a, n in zip(along, near, strict=True)
        ]
    )
    share = (np.arange(per_strip) + 0.5) / per_strip
    places = bounds[:, :1] + share * (bounds[:, 1:] - bounds[:, :1])
    # Characters per cell of the strip's width; a cell with the usual number of them weighs 1.
    bins = np.clip((along - bounds[:, :1]) / np.maximum(np.ptp(bounds, axis=1, keepdims=True), 1e-9), 0, 1)
    cells = (
        np.minimum((bins * per_strip).astype(int), per_strip - 1)
        + per_strip * np.arange(len(middles))[:, None]
    )
    counts = np.bincount(cells[near], minlength=places.size).reshape(places.shape)
    usual = np.median(counts[counts > 0])
    return places, np.minimum(counts / usual, 1.0)

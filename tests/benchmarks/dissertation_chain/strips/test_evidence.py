"""What is gathered for the strips: order, signs, samples where text is, weights."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.dissertation_chain.rulings.results import ProjectedRulings, RulingVanishingPoints
from benchmarks.dissertation_chain.strips.evidence import StripEvidence, distrust_outliers, gather_evidence
from services.arrays import Points, Vector
from tests.benchmarks.dissertation_chain.strips.bent_page import BentPage

PAGE = BentPage(skew_rad=0.1)


class EvenFlow:
    """One direction everywhere, known where x is positive."""

    def __init__(self, angle: float) -> None:
        self.angle = angle

    def at(self, points: Points) -> Vector:
        return np.full(len(points), self.angle)

    def trust_at(self, points: Points) -> Vector:
        return np.asarray((points[:, 0] > 0).astype(float))


def gathered(turn: float = 0.0, backwards: bool = False, minor: bool = True) -> StripEvidence:
    """Upright rulings at five places, text in the upper half, the whole photo turned."""
    c, s = np.cos(turn), np.sin(turn)
    rotation = np.array([[c, s], [-s, c]])
    order = slice(None, None, -1) if backwards else slice(None)
    points = (np.stack([np.linspace(-0.4, 0.4, 5), np.zeros(5)], axis=1) @ rotation)[order]
    rulings = ProjectedRulings(points, np.full(5, (np.pi / 2 + turn) % np.pi), np.zeros(5), np.ones(5, bool))
    vanishing = RulingVanishingPoints(np.tile([0.0, 1.0, 0.0], (5, 1)), np.arange(5.0)[order] + 1)
    grid = np.stack(np.meshgrid(np.linspace(-0.39, 0.39, 30), np.linspace(-0.5, 0.0, 30)), axis=-1)
    return gather_evidence(
        rulings,
        vanishing,
        EvenFlow((turn + np.pi / 2) % np.pi - np.pi / 2),
        EvenFlow((turn + np.pi / 2) % np.pi) if minor else None,
        grid.reshape(-1, 2) @ rotation,
        per_strip=6,
    )


def test_samples_lie_on_the_centre_lines_where_text_is() -> None:
    found = gathered()
    assert found.count == 4
    assert found.points.shape == (4, 6, 2)
    np.testing.assert_allclose(
        found.points[..., 0], np.repeat([[-0.3], [-0.1], [0.1], [0.3]], 6, axis=1), atol=1e-12
    )
    assert -0.5 < found.points[..., 1].min() < -0.4
    assert -0.1 < found.points[..., 1].max() < 0.0
    assert found.ruling_angles == pytest.approx(np.pi / 2)


@pytest.mark.parametrize("turn", [0.0, 0.3, -0.8, 1.4])
@pytest.mark.parametrize("backwards", [False, True])
def test_strips_run_to_the_right_and_directions_down(turn: float, backwards: bool) -> None:
    found = gathered(turn, backwards)
    assert np.all(np.diff(found.reference_points[:, 0]) > 0)
    right, down = [np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]
    np.testing.assert_allclose(found.major @ right, 1.0)
    np.testing.assert_allclose(found.minor @ down, 1.0)
    np.testing.assert_allclose(found.rulings @ down, 1.0)
    np.testing.assert_allclose(found.vanishing_deviations, [1, 2, 3, 4, 5])


def test_support_weighs_and_strokes_may_be_missing() -> None:
    found = gathered(minor=False)
    assert np.all(found.minor_weights == 0)
    assert np.all(found.major_weights[:2] == 0)
    assert np.all(found.major_weights[2:] > 0.5)


def test_text_in_places_leaves_weight_there_only() -> None:
    rulings = ProjectedRulings(
        np.array([[-0.1, 0.0], [0.1, 0.0]]), np.full(2, np.pi / 2), np.zeros(2), np.ones(2, bool)
    )
    vanishing = RulingVanishingPoints(np.tile([0.0, 1.0, 0.0], (2, 1)), np.full(2, np.inf))
    y = np.concatenate([np.linspace(-0.5, -0.4, 50), np.linspace(0.4, 0.5, 50)])
    flow = EvenFlow(0.0)
    characters = np.stack([np.full(100, 0.01), y], axis=1)
    found = gather_evidence(rulings, vanishing, flow, flow, characters, per_strip=10)
    np.testing.assert_array_equal(found.major_weights[0, 2:8] == 0, True)
    bare = gather_evidence(rulings, vanishing, flow, None, np.zeros((0, 2)))
    assert np.all(bare.major_weights == 0)
    assert np.all(np.isfinite(bare.points))


def test_one_ruling_makes_no_strip() -> None:
    rulings = ProjectedRulings(np.zeros((1, 2)), np.ones(1), np.zeros(1), np.ones(1, bool))
    vanishing = RulingVanishingPoints(np.array([[0.0, 1.0, 0.0]]), np.full(1, np.inf))
    with pytest.raises(ValueError, match="two rulings"):
        gather_evidence(rulings, vanishing, EvenFlow(0.0), None, np.zeros((0, 2)))


def test_wild_samples_lose_their_weight_and_the_others_keep_it() -> None:
    evidence = PAGE.evidence(15)
    major = evidence.major.copy()
    major[3, 2] = major[3, 2] @ [[0.8, 0.6], [-0.6, 0.8]]
    found = distrust_outliers(replace(evidence, major=major))
    assert found.major_weights[3, 2] < 0.01
    others = np.delete(found.major_weights.ravel(), 3 * 8 + 2)
    assert others.min() > 0.5
    assert found.minor_weights.min() > 0.5

"""Rulings go on to where the text ends, and only there."""

import numpy as np
import pytest

from benchmarks.dissertation_chain.rulings.results import ProjectedRulings, RulingVanishingPoints
from benchmarks.dissertation_chain.strips.coverage import cover_text

COUNT = 9


def fan(turn_rad: float = 0.02) -> tuple[ProjectedRulings, RulingVanishingPoints]:
    """Nearly upright rulings a tenth apart, each turned a little against the one before."""
    points = np.stack([0.1 * np.arange(COUNT) - 0.4, np.zeros(COUNT)], axis=1)
    angles = np.pi / 2 + turn_rad * (np.arange(COUNT) - 4)
    vanishing = RulingVanishingPoints(np.tile([0.0, 1.0, 0.0], (COUNT, 1)), np.full(COUNT, 0.1))
    return ProjectedRulings(points, angles, np.full(COUNT, 0.5), np.ones(COUNT, bool)), vanishing


def text(left: float, right: float) -> np.ndarray:
    return np.stack([np.linspace(left, right, 1000), np.full(1000, 0.05)], axis=1)


@pytest.mark.parametrize(
    ("left", "right", "before", "after"),
    [
        (-0.39, 0.39, 0, 0),
        (-0.39, 0.55, 0, 2),
        (-0.65, 0.3, 3, 0),
        (-0.55, 0.45, 2, 1),
        (-9.0, 9.0, 10, 10),
    ],
)
@pytest.mark.parametrize("turn_rad", [0.0, 0.02, -0.01])
def test_rulings_are_added_where_text_lies_beyond(
    left: float, right: float, before: int, after: int, turn_rad: float
) -> None:
    rulings, vanishing = fan(turn_rad)
    found, points = cover_text(rulings, vanishing, text(left, right))
    assert len(found) == COUNT + before + after
    np.testing.assert_allclose(np.diff(found.points[:, 0]), 0.1)
    np.testing.assert_allclose(np.diff(found.angles), turn_rad, atol=1e-12)
    inner = slice(before, before + COUNT)
    np.testing.assert_array_equal(found.points[inner], rulings.points)
    np.testing.assert_array_equal(points.deviations[inner], vanishing.deviations)
    assert np.isinf(np.delete(points.deviations, np.arange(before, before + COUNT))).all()
    assert found.curved.sum() == COUNT
    assert len(points.directions) == len(found.qualities) == len(found)


def test_order_and_half_turns_do_not_matter() -> None:
    rulings, vanishing = fan(0.0)
    turned = ProjectedRulings(
        rulings.points[::-1] @ np.array([[0.0, 1.0], [-1.0, 0.0]]),
        np.where(np.arange(COUNT) % 2, 0.001, np.pi - 0.001),
        rulings.qualities,
        rulings.curved,
    )
    found, _ = cover_text(turned, vanishing, text(-0.39, 0.55) @ np.array([[0.0, 1.0], [-1.0, 0.0]]))
    assert len(found) == COUNT + 2
    assert np.all((found.angles >= 0) & (found.angles < np.pi))


def test_too_few_rulings_or_no_text_stay_as_they_are() -> None:
    rulings, vanishing = fan()
    assert cover_text(rulings, vanishing, np.zeros((0, 2)))[0] is rulings
    two = ProjectedRulings(rulings.points[:2], rulings.angles[:2], rulings.qualities[:2], rulings.curved[:2])
    assert cover_text(two, vanishing, text(-9, 9))[0] is two

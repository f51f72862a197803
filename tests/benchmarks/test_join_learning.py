"""Weights of whole zones: known ones are found again, and the report judges sets by weights of the others."""

import numpy as np
import pytest

from benchmarks.layout.join_learning import Case, Judged, count_right, fit_wholes, label_pages, learn, report
from benchmarks.layout.word_labels import Photo
from services.layout.grouping.joining import WHOLE_FEATURES, whole_probabilities
from services.layout.grouping.piece_pairs import PAIR_FEATURES, describe_pieces
from services.layout.grouping.piece_tree import PieceTree
from tests.benchmarks.photos import simulated_photos

TRUE = np.array([0.9, -0.5, 0.2, 0.3, -1.0, 0.4, -0.3, -0.6, -0.4])
MEMBERS = ((0,), (1,), (2,), (0, 1), (0, 1, 2))


def drawn(rng: np.random.Generator) -> Judged:
    """Three zones, the first two joined first; the grouping is drawn by the probabilities that `TRUE` gives."""
    tree = PieceTree(
        pieces=describe_pieces([], 1.0)[0],
        zones=3,
        children=np.array([[-1, -1], [-1, -1], [-1, -1], [0, 1], [3, 2]]),
        is_root=np.array([False, False, False, False, True]),
        weakest=np.zeros(5),
        offered=np.zeros(5),
        members=MEMBERS,
    )
    features = np.zeros((5, len(WHOLE_FEATURES)))
    features[3:, :-1], features[3:, -1] = rng.normal(0.0, 1.0, (2, len(WHOLE_FEATURES) - 1)), 1.0
    probability = whole_probabilities(tree, features @ TRUE)
    is_true = np.zeros(5, bool)
    draw = rng.random()
    if draw < probability[4]:
        is_true[4] = True
    elif draw < probability[4] + probability[3]:
        is_true[[2, 3]] = True
    else:
        is_true[:3] = True
    return Judged(tree, features, is_true)


def test_known_weights_of_whole_zones_are_found_again() -> None:
    rng = np.random.default_rng(5)
    assert fit_wholes([[drawn(rng) for _ in range(6000)]]) == pytest.approx(TRUE, abs=0.12)


@pytest.fixture(scope="module")
def photos() -> list[Photo]:
    return simulated_photos(6)


def test_pages_are_learned_from_and_told(photos: list[Photo]) -> None:
    cases = [label_pages(name, "3", photos) for name in ("a", "b")]
    assert all(isinstance(case, Case) and len(case.pages) == 6 for case in cases)
    pairs, wholes = learn(cases)
    assert (len(pairs), len(wholes)) == (len(PAIR_FEATURES), len(WHOLE_FEATURES))
    before, after, zones = count_right(cases[0], (pairs, wholes))
    assert 0 < before <= zones
    assert 0 < after <= zones
    text = report(cases)
    [line] = [line for line in text.splitlines() if line.startswith("a, 3 samples")]
    assert line.split()[-1] == str(zones)

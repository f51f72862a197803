"""Pieces of one zone are put together; zones of other labels, doubtful and distant ones stay apart."""

from collections.abc import Mapping
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from services.layout.grouping.joining import (
    WHOLE_FEATURES,
    WHOLE_WEIGHTS,
    choose_groups,
    describe_joins,
    find_groups,
    whole_probabilities,
)
from services.layout.grouping.piece_pairs import (
    MOST_ZONES,
    PAIR_FEATURES,
    PAIR_WEIGHTS,
    are_neighbours,
    describe_pieces,
    pair_features,
)
from services.layout.grouping.piece_tree import PieceTree
from services.layout.model.layout_model import PieceStatistics
from services.layout.page import Box, Page, Zone
from services.layout.recognition.results import RecognizedZone

EM = 20.0
SURELY = {"head": PieceStatistics(6.0, divided=8.0), "text": PieceStatistics(-6.0, whole=8.0)}


def zone(name: str, box: Box, label: str | None, kind: str = "text") -> Zone:
    lines = max(1, round((box[3] - box[1]) / 24))
    return Zone(name, box, kind, lines=lines, font_size=EM, weight=0.1, label=label)  # type: ignore[arg-type]


def page(*zones: Zone) -> Page:
    return Page(1000.0, 1400.0, zones)


def labelled(*zones: Zone, evidence: float = 4.0) -> list[RecognizedZone]:
    return [
        RecognizedZone(each, each.label, 1.0, each.label, order, evidence) for order, each in enumerate(zones)
    ]


HEAD = zone("a", (100, 100, 500, 120), "head")
UNDER = zone("b", (100, 130, 400, 150), "head")
BODY = zone("c", (100, 200, 900, 400), "text")
MORE = zone("d", (100, 424, 900, 600), "text")


def test_pieces_that_a_class_joins_become_one_zone_and_its_paragraphs_stay_apart() -> None:
    zones = (HEAD, UNDER, BODY, MORE)
    assert find_groups(labelled(*zones), page(*zones), SURELY) == ((0, 1), (2,), (3,))


def scattered(seed: int, count: int, most: float = 900) -> tuple[Zone, ...]:
    rng = np.random.default_rng(seed)
    return tuple(
        zone(f"z{k}", (float(x), float(y), float(x) + 80, float(y) + 20), str(rng.choice(["head", "text"])))
        for k, (x, y) in enumerate(rng.uniform(50, most, (count, 2)))
    )


def test_every_zone_is_in_one_group_whatever_is_joined() -> None:
    zones = scattered(4, 40)
    groups = find_groups(labelled(*zones), page(*zones), dict.fromkeys(("head", "text"), SURELY["head"]))
    assert sorted(place for group in groups for place in group) == list(range(40))
    assert any(len(group) > 1 for group in groups)
    assert all(len({zones[place].label for place in group}) == 1 for group in groups)


def test_labels_that_are_hardly_right_are_joined_less() -> None:
    zones = (HEAD, UNDER)

    def score(evidence: float) -> float:
        features = describe_joins(labelled(*zones, evidence=evidence), page(*zones), SURELY, PAIR_WEIGHTS)[1]
        return float((features @ WHOLE_WEIGHTS)[-1])

    assert score(4.0) > score(-4.0)


def grouped(zones: tuple[Zone, ...], learned: Mapping[str, PieceStatistics]) -> tuple[PieceTree, np.ndarray]:
    tree, features = describe_joins(labelled(*zones), page(*zones), learned, PAIR_WEIGHTS)
    return tree, features @ WHOLE_WEIGHTS


def groupings(tree: PieceTree, node: int) -> list[tuple[int, ...]]:
    """All sets of nodes that have the zones below a node once."""
    if node < tree.zones:
        return [(node,)]
    below = product(*(groupings(tree, int(child)) for child in tree.children[node]))
    return [(node,), *(first + second for first, second in below)]


def test_probabilities_and_the_choice_are_those_of_all_groupings_of_the_tree() -> None:
    zones = scattered(7, 14, 400)
    tree, scores = grouped(zones, dict.fromkeys(("head", "text"), SURELY["head"]))
    assert len(tree.members) > len(zones) + 2
    wanted, best = np.zeros(len(scores)), 0.0
    chosen = choose_groups(tree, whole_probabilities(tree, scores))
    for root in np.flatnonzero(tree.is_root):
        every = groupings(tree, int(root))
        weight = np.array(
            [np.exp(sum(scores[node] for node in each if node >= tree.zones)) for each in every]
        )
        for each, share in zip(every, weight / weight.sum(), strict=True):
            wanted[list(each)] += share
        best += max(wanted[list(each)].sum() for each in every)
    assert whole_probabilities(tree, scores) == pytest.approx(wanted)
    place = {tuple(sorted(members)): node for node, members in enumerate(tree.members)}
    assert sum(wanted[place[group]] for group in chosen) == pytest.approx(best)


def neighbours(*zones: Zone) -> bool:
    """Whether the first two of the zones are neighbours."""
    pieces, _ = describe_pieces(zones, EM)
    return bool(are_neighbours(pieces, np.array([0]), np.array([1]), pieces)[0])


def test_a_zone_of_another_label_between_two_pieces_keeps_them_apart() -> None:
    between = zone("x", (100, 122, 400, 128), "text")
    assert neighbours(HEAD, UNDER)
    assert not neighbours(HEAD, UNDER, between)
    assert neighbours(HEAD, UNDER, replace(between, kind="rule"))


def test_distant_zones_and_zones_without_a_label_have_no_neighbours() -> None:
    assert not neighbours(HEAD, replace(UNDER, box=(100, 220, 400, 240)))
    assert not neighbours(replace(HEAD, label=None), replace(UNDER, label=None))


def test_crowded_pages_stay_as_they_are() -> None:
    zones = (HEAD, UNDER) * MOST_ZONES
    found = find_groups(labelled(*zones), page(*zones), SURELY)
    assert found == tuple((place,) for place in range(2 * MOST_ZONES))


def features_of(first: Zone, second: Zone, em: float = EM) -> np.ndarray:
    pieces, _ = describe_pieces([first, second], em)
    return pair_features(pieces, np.array([0]), np.array([1]))[0]


def test_features_do_not_depend_on_the_order_of_the_pieces_or_on_the_scale() -> None:
    forth, back = features_of(HEAD, UNDER), features_of(UNDER, HEAD)
    assert forth.shape == (len(PAIR_FEATURES),) == (len(PAIR_WEIGHTS),)
    assert len(WHOLE_FEATURES) == len(WHOLE_WEIGHTS)
    assert np.allclose(forth, back)
    double = [
        replace(each, box=tuple(2 * edge for edge in each.box), font_size=2 * EM) for each in (HEAD, UNDER)
    ]
    assert np.allclose(features_of(double[0], double[1], 2 * EM), forth)


def joined(label: str, learned: Mapping[str, PieceStatistics]) -> float:
    """Probability that the two heads are one zone."""
    tree, scores = grouped((replace(HEAD, label=label), replace(UNDER, label=label)), learned)
    return float(whole_probabilities(tree, scores)[2]) if len(scores) > 2 else 0.0


@pytest.mark.parametrize(("label", "likely"), [("head", True), ("text", False), ("new", None)])
def test_what_a_class_has_learned_moves_the_probability(label: str, likely: bool | None) -> None:
    usual, learned = joined(label, {}), joined(label, SURELY)
    assert 0 < usual < 1
    assert (learned > usual) is likely if likely is not None else learned == usual


def test_a_join_that_has_the_size_of_verified_zones_is_more_probable() -> None:
    width, height = np.log2(400 / 1000), np.log2(50 / 1400)

    def sizes(away: float) -> dict[str, PieceStatistics]:
        high = height + away
        return {
            "head": PieceStatistics(
                widths=(9.0, 9 * width, 9 * width**2), heights=(9.0, 9 * high, 9 * high**2)
            )
        }

    assert joined("head", sizes(0.0)) > joined("head", {}) - 1e-9 > joined("head", sizes(2.0))

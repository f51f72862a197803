"""Pieces of one zone are put together; zones of other labels, doubtful and distant ones stay apart."""

from dataclasses import replace

import numpy as np
import pytest

from services.layout.grouping.joining import JoiningParameters, find_groups
from services.layout.grouping.piece_pairs import (
    PIECE_FEATURES,
    USUAL_WEIGHTS,
    neighbours_of,
    piece_features,
    piece_probability,
)
from services.layout.page import Box, Page, Zone
from services.layout.recognition.results import LabelledZone

EM = 20.0
SURELY = {"head": 8.0, "text": -8.0}


def zone(name: str, box: Box, label: str | None, kind: str = "text") -> Zone:
    lines = max(1, round((box[3] - box[1]) / 24))
    return Zone(name, box, kind, lines=lines, font_size=EM, weight=0.1, label=label)  # type: ignore[arg-type]


def page(*zones: Zone) -> Page:
    return Page(1000.0, 1400.0, zones)


def labelled(*zones: Zone, confidence: float = 1.0) -> list[LabelledZone]:
    return [LabelledZone(each, each.label, confidence, each.label, order) for order, each in enumerate(zones)]


HEAD = zone("a", (100, 100, 500, 120), "head")
UNDER = zone("b", (100, 130, 400, 150), "head")
BODY = zone("c", (100, 200, 900, 400), "text")
MORE = zone("d", (100, 424, 900, 600), "text")


def test_pieces_that_a_class_joins_become_one_zone_and_its_paragraphs_stay_apart() -> None:
    zones = (HEAD, UNDER, BODY, MORE)
    assert find_groups(labelled(*zones), page(*zones), SURELY) == ((0, 1), (2,), (3,))


def test_every_zone_is_in_one_group_whatever_is_joined() -> None:
    rng = np.random.default_rng(4)
    zones = tuple(
        zone(f"z{k}", (float(x), float(y), float(x) + 80, float(y) + 20), str(rng.choice(["head", "text"])))
        for k, (x, y) in enumerate(rng.uniform(50, 900, (40, 2)))
    )
    groups = find_groups(labelled(*zones), page(*zones), {"head": 8.0, "text": 8.0})
    assert sorted(place for group in groups for place in group) == list(range(40))
    assert any(len(group) > 1 for group in groups)


def test_doubtful_labels_join_nothing() -> None:
    zones = (HEAD, UNDER)
    assert find_groups(labelled(*zones, confidence=0.8), page(*zones), SURELY) == ((0,), (1,))


def test_a_zone_of_another_label_between_two_pieces_keeps_them_apart() -> None:
    between = zone("x", (100, 122, 400, 128), "text")
    assert neighbours_of(0, (HEAD, UNDER), EM) == [1]
    assert neighbours_of(0, (HEAD, UNDER, between), EM) == []
    assert neighbours_of(0, (HEAD, UNDER, replace(between, kind="rule")), EM) == [1]


def test_distant_zones_and_zones_without_a_label_have_no_neighbours() -> None:
    assert neighbours_of(0, (HEAD, replace(UNDER, box=(100, 220, 400, 240))), EM) == []
    assert neighbours_of(0, (replace(HEAD, label=None), replace(UNDER, label=None)), EM) == []


def test_crowded_pages_stay_as_they_are() -> None:
    zones = (HEAD, UNDER)
    found = find_groups(labelled(*zones), page(*zones), SURELY, JoiningParameters(most_zones=1))
    assert found == ((0,), (1,))


def test_features_do_not_depend_on_the_order_of_the_pieces_or_on_the_scale() -> None:
    forth, back = piece_features(HEAD, UNDER, EM), piece_features(UNDER, HEAD, EM)
    assert forth.shape == (len(PIECE_FEATURES),) == (len(USUAL_WEIGHTS),)
    assert np.allclose(forth, back)
    double = [
        replace(each, box=tuple(2 * edge for edge in each.box), font_size=2 * EM) for each in (HEAD, UNDER)
    ]
    assert np.allclose(piece_features(double[0], double[1], 2 * EM), forth)


@pytest.mark.parametrize(("label", "likely"), [("head", True), ("text", False), ("new", None)])
def test_what_a_class_has_learned_moves_the_probability(label: str, likely: bool | None) -> None:
    a, b = replace(HEAD, label=label), replace(UNDER, label=label)
    usual, learned = piece_probability(a, b, EM, {}), piece_probability(a, b, EM, SURELY)
    assert 0 < usual < 1
    assert (learned > usual) is likely if likely is not None else learned == usual

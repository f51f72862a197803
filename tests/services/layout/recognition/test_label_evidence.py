"""Evidence of labels: what it rises and falls with, and that zones are judged by their own costs and by their pairs."""

from dataclasses import replace

import numpy as np
import pytest

from services.layout.matching import conditional_costs, own_costs
from services.layout.matching.cost_tables import CostTables
from services.layout.recognition.label_evidence import (
    ALWAYS,
    EVIDENCE_FEATURES,
    MOST_AWAY,
    READ,
    UNREAD,
    LabelEvidence,
    are_single,
    label_confidences,
    label_evidence,
    label_features,
    other_labels,
    zone_shares,
)

LABELS = np.array([1, 2, 1, 0])


def tables(seed: int = 3) -> CostTables:
    """Four zones, three labels, three pairs."""
    rng = np.random.default_rng(seed)
    pairs = np.array([[0, 1], [0, 3], [1, 2]])
    return CostTables(
        rng.normal(-2.0, 1.0, (4, 3)), pairs, rng.normal(0.0, 0.5, (3, 3, 3)), rng.normal(0.0, 0.2, (3, 5))
    )


def with_own_cost(cost: float) -> CostTables:
    """The tables with another cost of the second zone by itself; its labels keep their probabilities."""
    costs = tables()
    costs.node[1] += cost - costs.node[1, LABELS[1]]
    return costs


def evidence(costs: CostTables, samples: int = 5, kind: LabelEvidence = READ) -> np.ndarray:
    return label_evidence(costs, LABELS, conditional_costs(costs, LABELS), samples, is_read=kind is READ)


def features(costs: CostTables, samples: int = 5, kind: LabelEvidence = READ) -> dict[str, np.ndarray]:
    found = label_features(costs, LABELS, conditional_costs(costs, LABELS), samples, kind)
    return dict(zip(EVIDENCE_FEATURES, found.T, strict=True))


def test_own_costs_are_those_of_zones_and_of_their_pairs() -> None:
    """By the definition: node costs once, pair costs once for each of their zones."""
    costs = tables()
    own, pairs = own_costs(costs, LABELS)
    assert own == pytest.approx(costs.node[np.arange(4), LABELS])
    of_pairs = costs.edge[np.arange(3), LABELS[costs.pairs[:, 0]], LABELS[costs.pairs[:, 1]]]
    wanted = np.zeros(4)
    for (a, b), cost in zip(costs.pairs, of_pairs, strict=True):
        wanted[[a, b]] += cost
    assert pairs == pytest.approx(wanted)


@pytest.mark.parametrize("kind", [READ, UNREAD])
def test_evidence_is_the_weighted_sum_of_its_features(kind: LabelEvidence) -> None:
    found = features(tables(), kind=kind)
    wanted = sum(weight * found[name] for name, weight in zip(EVIDENCE_FEATURES, kind.weights, strict=True))
    assert evidence(tables(), kind=kind) == pytest.approx(wanted)
    assert found["zones"] == pytest.approx(np.log(4))
    assert found["samples"] == pytest.approx(np.log(5))
    sure = label_confidences(conditional_costs(tables(), LABELS), LABELS)
    assert found["log-odds"] == pytest.approx(np.log(sure / (1 - sure)))
    assert found["log-odds by samples"] == pytest.approx(found["log-odds"] * np.log(5))
    assert found["log-odds by own"] == pytest.approx(found["log-odds"] * found["own"])


@pytest.mark.parametrize("kind", [READ, UNREAD])
def test_a_zone_that_is_like_no_sample_has_less_evidence(kind: LabelEvidence) -> None:
    """All labels cost more by the same: their probabilities stay, the zone is explained less well."""
    usual, strange = with_own_cost(-1.0), with_own_cost(1.0)
    difference = evidence(strange, kind=kind) - evidence(usual, kind=kind)
    weights = dict(zip(EVIDENCE_FEATURES, kind.weights, strict=True))
    weight = weights["own"] + weights["log-odds by own"] * features(usual, kind=kind)["log-odds"][1]
    assert difference == pytest.approx([0.0, 2.0 * weight, 0.0, 0.0])
    assert difference[1] < 0


def test_more_samples_and_a_better_label_are_more_evidence() -> None:
    more = evidence(tables(), 20) - evidence(tables(), 3)
    probable = features(tables())["log-odds"] > 0
    assert probable.any()
    assert np.all(more[probable] > 0)
    assert more[probable].min() > more[~probable].max(), "an improbable label is not believed for the samples"
    better = tables()
    better.node[2, 1] -= 1.0
    assert evidence(better)[2] > evidence(tables())[2]
    assert evidence(better)[[0, 1, 3]] == pytest.approx(evidence(tables())[[0, 1, 3]])


@pytest.mark.parametrize("kind", [READ, UNREAD])
def test_evidence_is_bounded_where_costs_are_huge(kind: LabelEvidence) -> None:
    costs = tables()
    huge = replace(costs, node=costs.node * 1e6, edge=costs.edge * 1e6)
    assert np.all(np.abs(evidence(huge, kind=kind)) < 12.0)
    assert np.all(np.abs(features(huge, kind=kind)["log-odds"]) <= kind.most_log_odds + 1e-9)


def test_own_costs_of_unread_pages_tell_strange_zones_only() -> None:
    """Below -3 a lower own cost says nothing of a page that was not read, and more of one that was."""
    well, better = with_own_cost(-4.0), with_own_cost(-6.0)
    assert evidence(better, kind=UNREAD) == pytest.approx(evidence(well, kind=UNREAD))
    assert evidence(better, kind=READ)[1] > evidence(well, kind=READ)[1] + 0.2


def test_a_page_without_pairs_has_no_costs_of_pairs() -> None:
    alone = CostTables(np.zeros((2, 2)), np.zeros((0, 2), np.intp), np.zeros((0, 2, 2)), np.zeros((2, 3)))
    own, pairs = own_costs(alone, np.array([0, 1]))
    assert own.tolist() == pairs.tolist() == [0.0, 0.0]


def test_other_labels_share_what_is_left_if_a_label_is_wrong() -> None:
    conditional = np.array([[-5.0, -4.5, -4.5 + np.log(3), 19.0], [3.0, 0.0, MOST_AWAY + 0.1, 8.0]])
    often = np.zeros((4, 2))
    found = other_labels(conditional, np.array([0, 1]), often)
    # One of the first zone's is three times as probable as the next one; the second zone's are all too far away.
    assert found == pytest.approx(np.array([[0.0, 0.75, 0.25, 0.0], [0.0, 0.0, 0.0, 0.0]]), abs=1e-5)
    assert found[:, 3].tolist() == [0.0, 0.0]
    assert other_labels(np.array([[1.0]]), np.array([0]), often[:1]).tolist() == [[0.0]]


def test_a_label_that_every_page_has_is_told_of_every_zone() -> None:
    conditional = np.array([[0.0, 9.0, 9.0], [0.0, 7.0, 9.0]])
    counts = np.array([[0.0, 0.0], [ALWAYS + 0.1, 0.0], [ALWAYS - 0.1, 0.0]])
    found = other_labels(conditional, np.array([0, 0]), counts)
    assert (found[:, 1] > 0).all()
    assert found[1, 1] > found[0, 1]
    assert found[:, [0, 2]].tolist() == [[0.0, 0.0], [0.0, 0.0]]


def test_shares_of_a_label_do_not_depend_on_who_has_it_now() -> None:
    costs = replace(tables(), pairs=np.zeros((0, 2), np.intp), edge=np.zeros((0, 3, 3)))
    shares = zone_shares(costs, LABELS)
    assert shares[:, 1:].sum(axis=0) == pytest.approx(1.0)
    assert shares[:, 0].tolist() == [0.0] * 4
    assert shares == pytest.approx(zone_shares(costs, np.array([0, 0, 0, 1])))
    better = replace(costs, node=costs.node - np.array([[0.0, 0.0, 0.0]] * 3 + [[0.0, 5.0, 0.0]]))
    assert zone_shares(better, LABELS)[3, 1] > shares[3, 1]


def test_a_label_is_single_where_pages_have_it_once() -> None:
    counts = np.array([[3.0, 0.1, 4.0], [0.1, 3.0, 4.0], [3.0, 2.0, 0.1], [1.0, 0.1, 0.9]])
    assert are_single(counts).tolist() == [True, False, False, False]
    assert not are_single(counts[:, :2]).any()

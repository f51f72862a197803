from dataclasses import replace

import numpy as np
import pytest

from benchmarks.layout.simulated_cost_tables import HARD, TYPICAL, simulated_tables, strong_tables
from services.layout.matching import MatchingParameters, match_directly, match_in_two_steps
from services.layout.matching.cost_tables import CostTables
from tests.services.layout.matching.brute_force import all_costs, all_labellings

PARAMETERS = MatchingParameters(max_ms=10_000.0)
MANHATTAN = replace(PARAMETERS, manhattan=True)


def random_boxes(zones: int, rng: np.random.Generator) -> np.ndarray:
    corner = rng.uniform(0, 90, (zones, 2))
    return np.hstack([corner, corner + rng.uniform(2, 15, (zones, 2))])


def overlaps_another_group(boxes: np.ndarray, labels: np.ndarray, label: int) -> bool:
    group, others = boxes[labels == label], boxes[(labels > 0) & (labels != label)]
    low, high = group[:, :2].min(0), group[:, 2:].max(0)
    return bool(((others[:, :2] < high) & (others[:, 2:] > low)).all(1).any())


@pytest.mark.parametrize("seed", range(10))
def test_the_first_step_is_the_best_one_to_one_mapping(seed: int) -> None:
    rng = np.random.default_rng(seed)
    tables = strong_tables(6, 4, 1.5, rng)
    found = match_in_two_steps(tables, random_boxes(6, rng), PARAMETERS)
    labels = np.zeros(6, np.intp)
    for label, zone in found.backbone:
        labels[zone] = label
    assert len({label for label, _ in found.backbone}) == len(found.backbone)
    # zones that are left over are charged what they will cost as members of a group
    node, count = tables.node.copy(), tables.count.copy()
    best = node[:, 1:].min(axis=1)
    node[:, 0] = np.minimum(node[:, 0], best + 0.05 * (1 + node[:, 0] - best))
    count[0] = count[0].min()
    tables = replace(tables, node=node, count=count)
    every = all_labellings(tables)
    single = (np.stack([(every == label).sum(1) for label in range(1, 4)]) <= 1).all(0)
    assert tables.cost(labels) == pytest.approx(all_costs(tables, every[single]).min(), abs=1e-9)


@pytest.mark.parametrize("manhattan", [True, False])
@pytest.mark.parametrize("seed", range(8))
def test_grouping_lowers_the_cost_and_keeps_the_backbone(seed: int, manhattan: bool) -> None:
    rng = np.random.default_rng(seed)
    tables, _ = simulated_tables(18, 6, TYPICAL, rng)
    boxes = random_boxes(18, rng)
    parameters = replace(PARAMETERS, manhattan=manhattan)
    found = match_in_two_steps(tables, boxes, parameters)
    backbone = np.zeros(18, np.intp)
    for label, zone in found.backbone:
        backbone[zone] = label
    labels = found.matching.labels
    assert (labels[backbone > 0] == backbone[backbone > 0]).all()
    assert set(labels.tolist()) <= {0, *backbone.tolist()}
    assert found.matching.cost == tables.cost(labels) <= tables.cost(backbone)
    direct = match_directly(tables, parameters)
    assert direct.cost <= found.matching.cost + 1e-9
    assert found.matching.lower_bound <= direct.cost + 1e-9


@pytest.mark.pipeline
def test_boxes_of_groups_that_were_joined_overlap_no_other_group() -> None:
    joined = kept_apart = 0
    for seed in range(12):
        rng = np.random.default_rng(seed)
        tables, _ = simulated_tables(18, 5, TYPICAL, rng)
        boxes = random_boxes(18, rng)
        found = match_in_two_steps(tables, boxes, MANHATTAN)
        free = match_in_two_steps(tables, boxes, PARAMETERS)
        assert free.backbone == found.backbone
        labels = found.matching.labels
        for label in np.flatnonzero(np.bincount(labels) > 1):
            if label:
                joined += 1
                assert not overlaps_another_group(boxes, labels, int(label))
        kept_apart += not np.array_equal(free.matching.labels, labels)
    assert joined > 5
    assert kept_apart > 5


def test_a_zone_between_two_of_a_group_keeps_them_apart() -> None:
    """Three zones below each other: the outer ones want one label, the middle one another."""
    node = np.array([[5.0, 0.0, 5.0], [5.0, 5.0, 0.0], [2.0, 1.0, 5.0]])
    tables = CostTables(node, np.zeros((0, 2), np.intp), np.zeros((0, 3, 3)), np.zeros((3, 4)))
    boxes = np.array([[0.0, 0, 10, 10], [0, 20, 10, 30], [0, 40, 10, 50]])
    apart = match_in_two_steps(tables, boxes, MANHATTAN)
    assert apart.backbone == ((1, 0), (2, 1))
    assert apart.matching.labels.tolist() == [1, 2, 0]
    together = match_in_two_steps(tables, boxes, PARAMETERS)
    assert together.matching.labels.tolist() == [1, 2, 1]
    beside = boxes + np.array([[0, 0, 0, 0], [20, 0, 20, 0], [0, 0, 0, 0]])
    assert match_in_two_steps(tables, beside, MANHATTAN).matching.labels.tolist() == [1, 2, 1]


@pytest.mark.parametrize("zones", [0, 1, 2])
def test_few_zones(zones: int) -> None:
    tables, _ = simulated_tables(zones, 4, TYPICAL, np.random.default_rng(1))
    found = match_in_two_steps(tables, random_boxes(zones, np.random.default_rng(1)), PARAMETERS)
    assert found.matching.labels.shape == (zones,)
    assert found.matching.cost >= found.matching.lower_bound


def test_without_any_budget_the_mapping_is_one_to_one_still() -> None:
    tables, _ = simulated_tables(20, 5, HARD, np.random.default_rng(3))
    none = MatchingParameters(max_nodes=0, max_sweeps=0)
    found = match_in_two_steps(tables, random_boxes(20, np.random.default_rng(3)), none)
    assert len({label for label, _ in found.backbone}) == len(found.backbone)
    assert found.matching.lower_bound <= match_directly(tables, PARAMETERS).cost


def test_a_model_of_null_alone_takes_every_zone() -> None:
    tables = CostTables(np.ones((3, 1)), np.zeros((0, 2), np.intp), np.zeros((0, 1, 1)), np.zeros((1, 4)))
    found = match_in_two_steps(tables, random_boxes(3, np.random.default_rng(0)), PARAMETERS)
    assert found.backbone == ()
    assert found.matching.labels.tolist() == [0, 0, 0]

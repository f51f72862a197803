"""Models whose zones are alike stand in one group."""

from dataclasses import replace

import numpy as np
import pytest

from services.layout.model.layout_model import NumericExpectation
from services.layout.recognition.hierarchy import likeness
from services.layout.recognition.hierarchy.likeness import describe_likeness, group_alike
from tests.services.layout.recognition.hierarchy.bases import base, compiled
from tests.services.layout.samples import MAKERS, model_of


def partition(groups: np.ndarray, names: list[str]) -> set[frozenset[str]]:
    return {
        frozenset(name for name, each in zip(names, groups, strict=True) if each == group)
        for group in set(groups.tolist())
    }


def described() -> tuple[list[np.ndarray], list[str]]:
    models = [each.model for each in base(6, 0.5)]
    return [describe_likeness(model, compiled(model)) for model in models], [model.name for model in models]


def test_publications_of_a_class_are_alike() -> None:
    points, names = described()
    groups = group_alike(points)
    assert groups.max() + 1 == len(MAKERS)
    assert partition(groups, [name.split("-")[0] for name in names]) == {
        frozenset([name.split("-")[0]]) for name in MAKERS
    }


def test_the_order_of_models_changes_no_group() -> None:
    points, names = described()
    order = np.random.default_rng(1).permutation(len(points))
    other = group_alike([points[k] for k in order])
    assert partition(group_alike(points), names) == partition(other, [names[k] for k in order])


def test_more_models_join_the_nearest_group(monkeypatch: pytest.MonkeyPatch) -> None:
    points, names = described()
    order = np.argsort(
        [int(name.split("-")[-1]) if name[-1].isdigit() else 0 for name in names], kind="stable"
    )
    points, names = [points[k] for k in order], [names[k] for k in order]
    monkeypatch.setattr(likeness, "MOST_CLUSTERED", 4 * len(MAKERS))
    groups = group_alike(points)
    assert partition(groups, [name.split("-")[0] for name in names]) == {
        frozenset([name.split("-")[0]]) for name in MAKERS
    }


@pytest.mark.parametrize(("count", "most"), [(1, 1), (2, 2), (9, 3)])
def test_equal_models_are_grouped_too(count: int, most: int) -> None:
    point = describe_likeness(model_of("fax", 1), compiled(model_of("fax", 1)))
    groups = group_alike([point] * count)
    assert groups.shape == (count,)
    assert set(groups.tolist()) <= set(range(most))


def test_labels_are_not_looked_at() -> None:
    model = model_of("letter", 3)
    nodes = tuple(replace(node, label=node.label and f"le {node.label}") for node in model.nodes)
    other = replace(model, nodes=nodes, edges=())
    np.testing.assert_array_equal(
        describe_likeness(model, compiled(model)), describe_likeness(other, compiled(other))
    )


def test_odd_models_are_described_too() -> None:
    model = model_of("letter", 1)
    empty = replace(
        model, nodes=tuple(replace(node, zones=0.0, numeric={}, content={}) for node in model.nodes)
    )
    huge = replace(
        model,
        nodes=tuple(replace(node, numeric={"top": NumericExpectation(1e9, 1e-9)}) for node in model.nodes),
    )
    for odd in (empty, huge):
        assert np.isfinite(describe_likeness(odd, compiled(odd))).all()

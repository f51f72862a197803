"""Sums over labelled pages: by hand, and that pages can be taken away again."""

from dataclasses import fields, replace

import numpy as np
import pytest

from services.layout.graph.layout_graph import KIND_FEATURES, RELATION_OFFSETS, build_graph
from services.layout.graph.node_attributes import NUMERIC_ATTRIBUTES
from services.layout.model.statistics import (
    MOST_COUNTED,
    LabelledGraph,
    LabelStatistics,
    gather_statistics,
    label_indices,
    total_statistics,
)
from services.layout.page import Page, Zone
from tests.services.layout.samples import labelled_page, page_of

COLUMNS = [attribute.name for attribute in NUMERIC_ATTRIBUTES]
NAMES = ("date", "name")


def labelled(page: Page) -> LabelledGraph:
    return LabelledGraph(build_graph(page, NAMES), tuple(zone.label for zone in page.zones))


def assert_same(first: LabelStatistics, second: LabelStatistics) -> None:
    for each in fields(LabelStatistics)[:-1]:
        one, other = getattr(first, each.name), getattr(second, each.name)
        np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-9, err_msg=each.name)
    np.testing.assert_allclose(first.words.zones, second.words.zones, atol=1e-9)
    assert first.words.counts.keys() == second.words.counts.keys()
    for token, zones in first.words.counts.items():
        np.testing.assert_allclose(zones, second.words.counts[token], atol=1e-9, err_msg=str(token))


def test_sums_of_one_page_by_hand() -> None:
    zones = (
        Zone("a", (0, 0, 100, 10), label="title", lines=1, content={"date": 0.25}),
        Zone("b", (0, 20, 200, 30), label="body", lines=3, content={"date": 0.5}),
        Zone("c", (0, 40, 400, 50), label="body", content={"date": 1.0}),
    )
    found = gather_statistics(labelled(Page(1000, 1000, zones)), (None, "body", "title"))
    assert found.zones.tolist() == [0, 2, 1]
    assert found.pages.tolist() == [1]
    width, lines = COLUMNS.index("width"), COLUMNS.index("lines")
    np.testing.assert_allclose(found.totals[:, width], [0, 0.6, 0.1])
    np.testing.assert_allclose(found.squares[:, width], [0, 0.2, 0.01])
    assert found.known[:, width].tolist() == [0, 2, 1]
    assert found.known[:, lines].tolist() == [0, 1, 1], "what was not measured does not count"
    assert found.totals[:, lines].tolist() == [0, 2, 1]
    np.testing.assert_allclose(found.content[:, 0], [0, 1.5, 0.25])
    assert found.read[:, 0].tolist() == [0, 2, 1]
    assert found.counts.argmax(axis=1).tolist() == [0, 2, 1]
    assert found.counts.sum(axis=1).tolist() == [1, 1, 1]
    of_relation = found.descriptors[:, :, RELATION_OFFSETS[0] : RELATION_OFFSETS[1]].sum(axis=2)
    assert of_relation.tolist() == [[0, 0, 0], [0, 1, 0], [0, 2, 0]], "the title is upper to both"


def test_a_page_that_was_not_read_tells_nothing_of_words() -> None:
    page = page_of((0, 0, 9, 9), (0, 20, 9, 29), label="body")
    found = gather_statistics(labelled(page), (None, "body"))
    kinds = len(KIND_FEATURES)
    assert found.read[:, :-kinds].sum() == 0
    assert found.content[:, :-kinds].sum() == 0
    assert found.read[1, -kinds:].tolist() == [2, 2], "kinds are seen without reading"


def test_many_zones_of_a_label_count_as_the_most() -> None:
    page = page_of(*[(0.0, 10.0 * k, 9.0, 10.0 * k + 5) for k in range(MOST_COUNTED + 7)], label="entry")
    found = gather_statistics(labelled(page), (None, "entry"))
    assert found.counts[:, [0, MOST_COUNTED]].tolist() == [[1, 0], [0, 1]]


def test_labels_must_be_known() -> None:
    assert label_indices(["b", None, "a", "b"], [None, "a", "b"]).tolist() == [2, 0, 1, 2]
    with pytest.raises(KeyError):
        label_indices(["c"], [None, "a"])


@pytest.mark.parametrize("name", ["letter", "two-column"])
def test_pages_can_be_taken_away_again(name: str) -> None:
    pages = [labelled(labelled_page(name, seed)) for seed in range(5)]
    labels = (None, *sorted({label for page in pages for label in page.labels if label is not None}))
    each = [gather_statistics(page, labels) for page in pages]
    total = total_statistics(each)
    for index in range(len(each)):
        others = total_statistics([page for position, page in enumerate(each) if position != index])
        assert_same(total - each[index], others)
        left = total - each[index]
        for name_ in ("zones", "known", "read", "descriptors", "counts", "pages"):
            np.testing.assert_array_equal(getattr(left, name_), getattr(others, name_), err_msg=name_)
    assert_same(each[0] + each[1], each[1] + each[0])
    assert_same((each[0] + each[1]) + each[2], each[0] + (each[1] + each[2]))
    assert (total.totals < 0).any(), "logarithms sum to less than nothing"


def test_nothing_is_left_of_a_page_without_itself() -> None:
    page = labelled(labelled_page("memo", 0))
    alone = gather_statistics(page, (None, *sorted(set(page.labels))))
    for each in fields(LabelStatistics)[:-1]:
        assert not getattr(alone - alone, each.name).any()
    assert alone.words.counts
    assert not (alone - alone).words.counts
    tiny = replace(alone, content=alone.content + 1e-12)
    assert not (tiny - alone).content.any(), "rounding errors are no frequencies"

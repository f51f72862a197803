"""Layout graphs: independent of resolution and of the order in which zones are told."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.layout.graph.edge_attributes import RELATIONS
from services.layout.graph.layout_graph import (
    DERIVED_FEATURES,
    KIND_FEATURES,
    RELATION_OFFSETS,
    LayoutGraph,
    build_graph,
)
from services.layout.graph.node_attributes import NUMERIC_ATTRIBUTES
from services.layout.page import KINDS, Page, Zone
from tests.services.layout.samples import MAKERS, labelled_page, page_of, permuted, scaled

NAMES = ("date", "name")


def by_zone(graph: LayoutGraph, page: Page) -> dict[tuple[str, str], tuple[int, ...]]:
    names = [zone.id for zone in page.zones]
    return {
        (names[upper], names[lower]): tuple(row)
        for (upper, lower), row in zip(graph.pairs.tolist(), graph.relations.tolist(), strict=True)
    }


@pytest.mark.parametrize("name", MAKERS)
@pytest.mark.parametrize("factor", [0.25, 2.0, 1.7])
def test_the_graph_does_not_depend_on_resolution(name: str, factor: float) -> None:
    page = labelled_page(name, 3)
    graph, other = build_graph(page, NAMES), build_graph(scaled(page, factor), NAMES)
    np.testing.assert_allclose(other.numeric, graph.numeric, rtol=1e-9, atol=1e-9)
    np.testing.assert_array_equal(other.content, graph.content)
    np.testing.assert_array_equal(other.pairs, graph.pairs)
    np.testing.assert_array_equal(other.relations, graph.relations)


@settings(max_examples=40, deadline=None)
@given(
    st.lists(
        st.tuples(st.integers(0, 6), st.integers(0, 6), st.integers(1, 5), st.integers(1, 5)),
        min_size=1,
        max_size=12,
        unique=True,
    ),
    st.randoms(use_true_random=False),
)
def test_the_graph_does_not_depend_on_the_order_of_zones(
    cells: list[tuple[int, int, int, int]], random
) -> None:
    # Of a small grid, so that many zones begin at one height, or at one point.
    page = page_of(*((x * 80.0, y * 80.0, (x + w) * 80.0, (y + h) * 80.0) for x, y, w, h in cells))
    zones = tuple(
        replace(zone, font_size=float(random.choice([10, 12, 20])), lines=random.randint(0, 3))
        for zone in page.zones
    )
    page = replace(page, zones=zones)
    order = np.array(random.sample(range(len(zones)), len(zones)))
    graph, other = build_graph(page, NAMES), build_graph(permuted(page, order), NAMES)
    np.testing.assert_allclose(other.numeric, graph.numeric[order], rtol=1e-12)
    assert by_zone(other, permuted(page, order)) == by_zone(graph, page)


@pytest.mark.parametrize("name", MAKERS)
def test_the_graphs_of_pages_do_not_depend_on_the_order_of_zones(name: str) -> None:
    page = labelled_page(name, 4)
    shuffled = permuted(page, np.random.default_rng(0).permutation(len(page.zones)))
    assert by_zone(build_graph(shuffled, NAMES), shuffled) == by_zone(build_graph(page, NAMES), page)


def test_equal_boxes_are_told_apart_by_their_order_alone() -> None:
    page = page_of(*[(10.0, 10.0, 50.0, 50.0)] * 4)
    graph, again = build_graph(page, ()), build_graph(page, ())
    np.testing.assert_array_equal(graph.relations, again.relations)
    assert graph.pairs.tolist() == [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]]
    names = [attribute.name for attribute in NUMERIC_ATTRIBUTES]
    assert graph.numeric[:, names.index("from-top")].tolist() == [0, 1, 2, 3]


def test_content_is_unknown_only_where_nothing_was_read() -> None:
    graph = build_graph(page_of((0, 0, 9, 9), (0, 20, 9, 29)), NAMES)
    assert graph.content_names == (*NAMES, *DERIVED_FEATURES)
    kinds = len(KIND_FEATURES)
    assert np.isnan(graph.content[:, :-kinds]).all()
    assert not graph.is_read
    assert (graph.content[:, -kinds:] == 0).all(), "kinds are known without reading"
    read = Page(100, 100, (Zone("a", (0, 0, 9, 9), content={"date": 0.7}), Zone("b", (0, 20, 9, 29))))
    np.testing.assert_array_equal(build_graph(read, NAMES).content[:, :2], [[0.7, 0.0], [0.0, 0.0]])
    assert build_graph(read, NAMES).is_read


def test_kinds_of_zones_are_content() -> None:
    zones = tuple(Zone(kind, (0, k, 9, k + 1), kind=kind) for k, kind in enumerate(KINDS))
    content = build_graph(Page(100, 100, zones), ()).content[:, -len(KIND_FEATURES) :]
    assert content.tolist() == [[0, 0], [0, 0], [1, 0], [0, 1]]
    assert KINDS == ("text", "figure", "rule", "noise")


def test_shapes_of_pages_of_no_and_one_zone() -> None:
    for zones in (0, 1):
        graph = build_graph(page_of(*[(0.0, 0.0, 9.0, 9.0)] * zones), NAMES)
        assert graph.zones == zones
        assert graph.numeric.shape == (zones, len(NUMERIC_ATTRIBUTES))
        assert graph.content.shape == (zones, 2 + len(DERIVED_FEATURES))
        assert graph.relations.shape == (0, len(RELATIONS))
        assert graph.descriptor_indicators().shape == (0, RELATION_OFFSETS[-1])


def test_indicators_have_one_descriptor_of_each_relation() -> None:
    graph = build_graph(labelled_page("memo", 0), NAMES)
    indicators = graph.descriptor_indicators()
    for position in range(len(RELATIONS)):
        own = indicators[:, RELATION_OFFSETS[position] : RELATION_OFFSETS[position + 1]]
        np.testing.assert_array_equal(own.argmax(axis=1), graph.relations[:, position])
        np.testing.assert_array_equal(own.sum(axis=1), 1.0)

"""Distances of pages without labels: symmetric, zero to itself, whatever the order of zones."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.layout.discovery.page_distance import (
    MOST_ZONES,
    compare_pages,
    page_distances,
    zone_evidence,
)
from services.layout.graph.layout_graph import LayoutGraph, build_graph
from services.layout.page import Page, Zone
from services.layout.pipeline import content_features
from tests.services.layout.discovery.made_pages import NAMES, graph_of
from tests.services.layout.samples import MAKERS, labelled_page


@st.composite
def pages(draw: st.DrawFn) -> Page:
    zones = []
    for index in range(draw(st.integers(0, 7))):
        x, y = draw(st.integers(0, 800)), draw(st.integers(0, 1200))
        width, height = draw(st.integers(1, 1000 - x)), draw(st.integers(1, 1400 - y))
        zones.append(
            Zone(
                id=str(index),
                box=(x, y, x + width, y + height),
                kind=draw(st.sampled_from(("text", "figure", "rule", "noise"))),
                lines=draw(st.none() | st.integers(0, 60)),
                font_size=draw(st.none() | st.floats(1, 90)),
                text=draw(st.sampled_from(("", "Dear Sir,", "12 May 1998", "Abstract. We show"))),
            )
        )
    return content_features().measure_page(Page(1000, 1400, tuple(zones)))


def graph(page: Page) -> LayoutGraph:
    return build_graph(page, NAMES)


@settings(max_examples=60, deadline=None)
@given(pages(), pages())
def test_symmetric_and_bounded(one: Page, other: Page) -> None:
    forth, back = compare_pages(graph(one), graph(other)), compare_pages(graph(other), graph(one))
    assert forth.distance == pytest.approx(back.distance, abs=1e-9)
    assert 0 <= forth.distance <= 1
    np.testing.assert_allclose(
        zone_evidence(graph(one), graph(other)), zone_evidence(graph(other), graph(one)).T, atol=1e-9
    )


@settings(max_examples=40, deadline=None)
@given(pages())
def test_zero_to_itself(page: Page) -> None:
    assert compare_pages(graph(page), graph(page)).distance == pytest.approx(0, abs=1e-9)


@settings(max_examples=40, deadline=None)
@given(pages(), pages(), st.randoms(use_true_random=False))
def test_the_order_of_zones_says_nothing(one: Page, other: Page, random: object) -> None:
    rng = np.random.default_rng(int(random.random() * 2**31))  # type: ignore[attr-defined]
    mixed = replace(one, zones=tuple(one.zones[at] for at in rng.permutation(len(one.zones))))
    straight, turned = (compare_pages(graph(each), graph(other)) for each in (one, mixed))
    assert turned.distance == pytest.approx(straight.distance, abs=1e-9)


def test_zones_pair_one_to_one() -> None:
    compared = compare_pages(graph_of("letter", 0), graph_of("letter", 1))
    assert len(compared.pairs) == len(compared.likeness) > 3
    for column in compared.pairs.T:
        assert len(set(column.tolist())) == len(column)
    assert (compared.likeness > 0).all()


@pytest.mark.parametrize("name", MAKERS)
def test_zones_that_stand_for_each_other_have_one_label(name: str) -> None:
    one, other = labelled_page(name, 0), labelled_page(name, 1)
    compared = compare_pages(graph_of(name, 0), graph_of(name, 1))
    alike = compared.pairs[compared.likeness >= 0.5]
    assert len(alike) >= 3
    right = [one.zones[first].label == other.zones[second].label for first, second in alike]
    assert np.mean(right) >= 0.8


def test_pages_of_a_class_are_nearer() -> None:
    names = np.array([name for name in MAKERS for _ in range(4)])
    distances = page_distances([graph_of(name, seed) for name in MAKERS for seed in range(4)])
    np.testing.assert_array_equal(distances, distances.T)
    assert not distances.diagonal().any()
    same = names[:, None] == names
    others = np.where(same, np.inf, distances).min(axis=1)
    own = np.where(same, distances, 0).sum(axis=1) / 3
    assert (own < others).mean() >= 0.9
    assert own.max() < 0.6 < distances[~same].mean()


def test_without_zones_nothing_is_in_common() -> None:
    empty = graph(Page(100, 100, ()))
    assert compare_pages(empty, empty).distance == 0
    assert compare_pages(empty, graph_of("memo", 0)).distance == 1


def test_of_crowded_pages_the_largest_zones_are_compared() -> None:
    small = [Zone(f"s{k}", (10 * k, 900, 10 * k + 4, 904)) for k in range(80)]
    large = [Zone(f"l{k}", (0, 8 * k, 700 + k, 8 * k + 7)) for k in range(MOST_ZONES)]
    crowded = graph(Page(1000, 1000, (*small, *large)))
    compared = compare_pages(crowded, crowded)
    assert compared.distance == pytest.approx(0, abs=1e-9)
    assert compared.pairs.min() == len(small)
    assert len(compared.pairs) == MOST_ZONES

"""Groups of unknown pages: pure, whatever the order, with the zones that recur."""

import numpy as np
import pytest

from services.layout.discovery.groups import choose_pages, group_pages
from services.layout.graph.layout_graph import build_graph
from services.layout.page import Page
from tests.services.layout.discovery.made_pages import NAMES, graph_of
from tests.services.layout.samples import MAKERS, labelled_page

KINDS = tuple(name for name in MAKERS if name != "letter")
"""Letters have little layout in common: groups of them grow from more than four pages."""


def test_each_class_becomes_a_group() -> None:
    told = [(name, seed) for seed in range(4) for name in KINDS]
    groups = group_pages([graph_of(*each) for each in told])
    assert sorted(len(group.pages) for group in groups) == [4] * len(KINDS)
    for group in groups:
        assert len({told[page][0] for page in group.pages}) == 1
        assert group.typical in group.pages
        assert 0.3 < group.cohesion < 1


def test_two_pages_are_no_group() -> None:
    pages = [graph_of(name, seed) for name in KINDS for seed in range(2)]
    assert group_pages(pages) == ()
    assert group_pages([]) == ()


def test_the_order_of_pages_says_nothing() -> None:
    told = [(name, seed) for name in KINDS for seed in range(4)]
    order = np.random.default_rng(3).permutation(len(told))
    one = group_pages([graph_of(*each) for each in told])
    other = group_pages([graph_of(*told[at]) for at in order])
    assert {group.pages for group in one} == {
        tuple(sorted(int(order[page]) for page in group.pages)) for group in other
    }


def test_zones_that_recur_carry_a_label_to_all_pages() -> None:
    pages = [labelled_page("memo", seed) for seed in range(4)]
    (group,) = group_pages([graph_of("memo", seed) for seed in range(4)])
    assert len(group.recurring) >= 4
    right = total = 0
    for zone in group.recurring:
        label = pages[group.typical].zones[zone.zones[group.typical]].label
        others = [pages[page].zones[at].label for page, at in zone.zones.items() if page != group.typical]
        right += sum(other == label for other in others)
        total += len(others)
        assert len(zone.zones) >= 3
    assert right >= 0.85 * total


def test_work_is_bounded_by_zones(monkeypatch: pytest.MonkeyPatch) -> None:
    pages = [graph_of("memo", seed) for seed in range(4)]
    of_three = sum(page.zones for page in pages[:3])
    assert choose_pages(pages, of_three) == 3
    assert choose_pages(pages, of_three - 1) == 2
    assert choose_pages(pages, 1) == 1
    assert choose_pages([], 10) == 0
    monkeypatch.setattr("services.layout.discovery.groups.MOST_ZONES", of_three)
    (group,) = group_pages(pages)
    assert group.pages == (0, 1, 2)


def test_pages_without_zones_are_in_no_group() -> None:
    empty = build_graph(Page(100, 100, ()), NAMES)
    (group,) = group_pages([empty, *(graph_of("fax", seed) for seed in range(3)), empty])
    assert group.pages == (1, 2, 3)
    assert group_pages([empty] * 5) == ()

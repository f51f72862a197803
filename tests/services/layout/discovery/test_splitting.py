"""A class that was made of two is split into them, a class of one kind is not."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from services.layout.discovery.class_samples import ClassSamples, gather_samples, held_out_costs
from services.layout.discovery.splitting import compare_parts, halve, propose_split
from services.layout.pipeline import content_features
from tests.services.layout.discovery.made_pages import NAMES, samples_of
from tests.services.layout.samples import MAKERS, labelled_page


def union_of(one: str, other: str, each: int) -> ClassSamples:
    told = [(name, seed) for seed in range(each) for name in (one, other)]
    pages = [content_features().measure_page(labelled_page(*of)) for of in told]
    return gather_samples("both", [(page, None) for page in pages], NAMES)[0]


FAR_APART = [pair for pair in combinations(MAKERS, 2) if pair not in {("letter", "memo"), ("memo", "fax")}]
"""Of the two that are left out 20 samples tell, not 10: their layout is loose, and they share their components."""


@pytest.mark.parametrize(("one", "other"), FAR_APART)
def test_a_union_is_split_into_its_classes(one: str, other: str) -> None:
    proposal = propose_split(union_of(one, other, 5))
    assert proposal is not None
    assert set(proposal.parts) == {(0, 2, 4, 6, 8), (1, 3, 5, 7, 9)}
    assert all(typical in part for typical, part in zip(proposal.typical, proposal.parts, strict=True))
    assert proposal.gain >= 0.03
    assert proposal.better >= 0.7


@pytest.mark.parametrize("name", MAKERS)
def test_a_class_of_one_kind_stays(name: str) -> None:
    assert propose_split(samples_of(name, tuple(range(10)))) is None


def test_few_samples_tell_nothing() -> None:
    assert compare_parts(union_of("letter", "memo", 3)) is None


def test_a_single_stranger_is_no_part(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("services.layout.discovery.splitting.LEAST_GAIN", -1.0)
    names = list(MAKERS)
    pages = [labelled_page(names[0], seed) for seed in range(9)] + [labelled_page(names[1], 0)]
    mixed = [(content_features().measure_page(page), None) for page in pages]
    assert propose_split(gather_samples("mixed", mixed, NAMES)[0]) is None


def test_halves_are_those_of_two_clusters() -> None:
    places = np.array([0.0, 0.1, 0.2, 5.0, 5.1, 5.3, 5.4])
    first = halve(np.abs(places[:, None] - places))
    assert first.tolist() in ([True] * 3 + [False] * 4, [False] * 3 + [True] * 4)


def test_held_out_costs_are_those_of_pages_that_fit() -> None:
    costs = held_out_costs(samples_of("memo", (0, 1, 2, 3)))
    assert costs.shape == (4,)
    assert (costs < -2).all()


def test_a_class_needs_a_zone() -> None:
    page = labelled_page("memo", 0)
    with pytest.raises(ValueError, match="at least one page"):
        gather_samples("none", [(replace(page, zones=()), None)], NAMES)
    gathered, taken = gather_samples("some", [(replace(page, zones=()), None), (page, page)], NAMES)
    assert taken == (1,)
    assert len(gathered.samples[0]) == 2

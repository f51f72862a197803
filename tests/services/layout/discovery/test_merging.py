"""Two models of one class are proposed to be one, models of different classes are not."""

from dataclasses import replace
from itertools import combinations

import pytest

from services.layout.discovery.class_samples import gather_samples
from services.layout.discovery.merging import propose_merges
from services.layout.page import Page
from services.layout.pipeline import content_features
from tests.services.layout.discovery.made_pages import NAMES, samples_of
from tests.services.layout.samples import MAKERS, labelled_page

FIRST, SECOND = (0, 1, 2, 3), (4, 5, 6, 7)


@pytest.mark.parametrize("name", MAKERS)
def test_halves_of_a_class_are_one(name: str) -> None:
    one, other = replace(samples_of(name, FIRST), name="a"), replace(samples_of(name, SECOND), name="b")
    (proposal,) = propose_merges([other, one])
    assert (proposal.first, proposal.second) == ("a", "b")
    assert proposal.fit >= 0.7
    assert 0.15 <= proposal.unsure <= 1
    assert 0.7 <= proposal.agreement <= 1
    assert proposal == propose_merges([one, other])[0]


def test_different_classes_are_not(monkeypatch: pytest.MonkeyPatch) -> None:
    classes = [samples_of(name, FIRST) for name in MAKERS]
    assert propose_merges(classes) == ()
    monkeypatch.setattr("services.layout.discovery.merging._LEAST_AGREEMENT", 0.0)
    for one, other in combinations(classes, 2):
        assert propose_merges([one, other]) == ()


def test_labels_of_other_names_are_told() -> None:
    def renamed(page: Page) -> Page:
        zones = [replace(zone, label=zone.label and f"x-{zone.label}") for zone in page.zones]
        return replace(page, zones=tuple(zones))

    pages = [content_features().measure_page(renamed(labelled_page("memo", seed))) for seed in SECOND]
    other, _ = gather_samples("other", [(page, None) for page in pages], NAMES)
    (proposal,) = propose_merges([samples_of("memo", FIRST), other])
    assert proposal.labels["x-body"] == "body"
    right = [theirs == f"x-{ours}" for theirs, ours in proposal.labels.items()]
    assert sum(right) >= 0.8 * len(right)


def test_few_samples_tell_nothing() -> None:
    one, other = replace(samples_of("fax", (0, 1)), name="a"), replace(samples_of("fax", (2, 3)), name="b")
    assert propose_merges([one, other]) == ()
    assert propose_merges([]) == ()


def test_the_nearest_pairs_come_first(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("services.layout.discovery.merging._MOST_PAIRS", 1)
    classes = [samples_of(name, FIRST) for name in MAKERS]
    twin = replace(samples_of("letter", SECOND), name="twin")
    (proposal,) = propose_merges([*classes, twin])
    assert {proposal.first, proposal.second} == {"letter", "twin"}

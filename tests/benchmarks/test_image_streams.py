"""Streams on images: what counts as wrong, and that drawn zones teach."""

from collections import Counter

import pytest

from benchmarks.learning.image_streams import (
    IMAGE_ONCE,
    IMAGE_STREAMS,
    Sight,
    begin,
    faults,
    follow,
    recognized,
    taught,
    wrong_of,
)
from benchmarks.learning.pages import NONE
from services.contract.layout_learning import DEFAULT_LEARNER
from services.layout.page import Box, Page, Zone
from tests.benchmarks.photos import simulated_photos


def page(*zones: tuple[str | None, Box]) -> Page:
    return Page(
        1000.0, 1000.0, tuple(Zone(f"z{k}", box, label=label) for k, (label, box) in enumerate(zones))
    )


def test_faults_are_splits_and_merges_of_boxes_whatever_their_found_labels() -> None:
    true = page(("head", (0, 0, 100, 100)), ("date", (0, 200, 100, 240)), ("body", (0, 240, 100, 280)))
    found = page(("x", (0, 0, 100, 40)), ("head", (0, 50, 100, 100)), ("body", (0, 200, 100, 280)))
    assert faults(true, found) == Counter({("split", ("head",)): 1, ("merge", ("body", "date")): 1})
    assert faults(true, true) == Counter()
    without = page((None, (0, 0, 100, 100)), ("date", (0, 200, 100, 240)), ("body", (0, 240, 100, 280)))
    assert list(faults(without, found)) == [("merge", ("body", "date"))]
    assert faults(true, page()) == Counter()


@pytest.fixture(scope="module")
def sights() -> list[Sight]:
    return [Sight(photo.true, photo.own, photo.fine, photo.words) for photo in simulated_photos(7)]


def test_pages_are_judged_before_they_teach_and_drawn_zones_teach(sights: list[Sight]) -> None:
    errors = {method: follow(sights[0], sights[1:], method) for method in (NONE, DEFAULT_LEARNER)}
    assert errors[NONE][0][0] == errors[DEFAULT_LEARNER][0][0]
    assert sum(errors[DEFAULT_LEARNER][0]) <= sum(errors[NONE][0])
    model = begin(sights[:1])
    seen = recognized(model, sights[1])
    after = taught(model, seen, sights[1].true)
    assert after.samples == model.samples + 1
    again = recognized(after, sights[1])
    assert wrong_of(sights[1], again.page)[0] <= wrong_of(sights[1], seen.page)[0]


def test_reports_tell_what_is_required() -> None:
    windows = {NONE: [30.0, 30.0], DEFAULT_LEARNER: [20.0, 9.0]}
    text = IMAGE_STREAMS.report({"memos": {"pages": 20, "zones": windows, "words": windows}})
    [line] = [line for line in text.splitlines() if line.startswith("memos | zones   ")]
    assert line.split()[-2:] == ["30.00", "yes"]
    text = IMAGE_ONCE.report({"memos": {"trials": 3, "before": {"split": 10}, "after": {"split": 2}}})
    [line] = [line for line in text.splitlines() if line.startswith("memos")]
    assert line.split()[2:4] == ["10", "80.00"]

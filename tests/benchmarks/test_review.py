"""The review benchmark: trials end where enough zones are right, orders do what they say, bounds hold."""

from dataclasses import replace

import numpy as np
import pytest

from app.review.decisions import expected_wrong_zones
from benchmarks.layout.hierarchy import simulated_pages
from benchmarks.review.acceptance import is_within, judge_class, split_pages, unread
from benchmarks.review.orders import FIXED, GAIN, RANDOM, follow, urgency_of
from benchmarks.review.queue import OpenPage, Queue, first_models, recognize_open
from services.layout.page import Page


def opened(labels: str, confidences: tuple[float, ...], found: str | None = "letter") -> OpenPage:
    """A page whose zones all have the label "a" in truth."""
    page = simulated_pages("simulated memo", 1)[0]
    zones = tuple(replace(zone, label="a") for zone in page.zones[: len(labels)])
    labelled = Page(page.width, page.height, zones)
    return OpenPage(labelled, "letter", ("letter",), found, tuple(labels), confidences)


def test_a_zone_is_right_when_its_label_and_its_class_are() -> None:
    assert opened("aab", (0.9, 0.8, 0.7)).wrong == 1
    assert opened("aab", (0.9, 0.8, 0.7), None).wrong == 3


def test_orders_follow_gain_or_stay() -> None:
    rng = np.random.default_rng(0)
    sure, unsure = opened("aa", (0.9, 0.9)), opened("aa", (0.5, 0.4))
    pages = [sure, unsure]
    assert [round(urgency_of(GAIN, pages, rng)(each), 6) for each in pages] == [0.2, 1.1]
    assert expected_wrong_zones(unsure.confidences) == pytest.approx(1.1)
    fixed, random = urgency_of(FIXED, pages, rng), urgency_of(RANDOM, pages, rng)
    later = OpenPage(unsure.page, "letter", ("letter",), "letter", ("a", "a"), (1.0, 1.0))
    assert fixed(later) == pytest.approx(1.1)
    assert sorted(map(random, pages)) == [0.0, 1.0]


def test_a_trial_ends_when_enough_zones_are_right() -> None:
    pages = {name: simulated_pages(name, 5) for name in ("simulated letter", "simulated memo")}
    models = first_models({name: of_class[:1] for name, of_class in pages.items()})
    first = [recognize_open(page, name, models) for name, of_class in pages.items() for page in of_class[1:]]
    queue = Queue(models, first)
    wrong = follow(queue, GAIN, np.random.default_rng(0), refreshed=True)
    zones = sum(len(each.labels) for each in first)
    assert wrong[0] > 0.01 * zones >= wrong[-1]
    assert all(count > 0.01 * zones for count in wrong[:-1])
    assert len(queue.open) == len(first) - (len(wrong) - 1)
    assert [each.page for each in first] == [page for of_class in pages.values() for page in of_class[1:]]


def test_pages_are_split_without_overlap() -> None:
    pages = list(range(20))
    split = split_pages(pages, "3", (0.4, 0.8), np.random.default_rng(0))  # type: ignore[arg-type]
    assert (len(split.samples), len(split.verified), len(split.judged)) == (3, 8, 4)
    whole = split_pages(pages, "all", (0.4, 0.8), np.random.default_rng(0))  # type: ignore[arg-type]
    assert sorted([*whole.samples, *whole.verified, *whole.judged]) == pages


def test_unread_pages_have_zones_without_content_and_other_sides() -> None:
    page = simulated_pages("simulated memo", 1)[0]
    seen = unread(page, np.random.default_rng(0))
    assert [zone.label for zone in seen.zones] == [zone.label for zone in page.zones]
    assert not any(zone.content or zone.text or zone.words for zone in seen.zones)
    boxes, true = (np.array([zone.box for zone in each.zones]) for each in (seen, page))
    assert (boxes[:, :2] < boxes[:, 2:]).all()
    assert 0.005 < np.std(boxes - true) / page.width < 0.04


def test_zones_are_accepted_from_the_threshold_on() -> None:
    verdicts = [("a", 0.99, True)] * 600
    judged = [opened("aab", (0.995, 0.2, 0.99)), opened("aa", (1.0, 1.0), None)]
    found = judge_class("letter", verdicts, judged, 0.01)
    assert (found["threshold"], found["zones"], found["accepted"], found["wrong"]) == (0.0, 3, 3, 1)
    assert judge_class("letter", verdicts[:50], judged, 0.01)["threshold"] is None


@pytest.mark.parametrize(
    ("wrong", "accepted", "expected"), [(0, 5, True), (2, 100, True), (8, 100, False), (0, 0, True)]
)
def test_few_errors_may_come_from_the_tolerated_rate(wrong: int, accepted: int, expected: bool) -> None:
    assert is_within(wrong, accepted, 0.01) is expected

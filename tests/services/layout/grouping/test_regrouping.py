"""Zones are cut and joined where the model of a class explains another grouping of their lines better."""

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from services.imaging.channels import luminance
from services.layout.grouping.regrouping import regroup_page
from services.layout.grouping.regrouping_odds import cut_log_odds, join_log_odds, measure_space
from services.layout.page import Page
from services.layout.pipeline import (
    VersionedModel,
    content_features,
    fine_page,
    read_words,
    recognize,
    regroup,
)
from services.layout.recognition.page_recognition import RecognitionParameters
from services.layout.segmentation import FinePage, Line, compose_page, compose_with_lines
from simulation.labelled_pages import LabelledPage, letter_page
from tests.services.layout.samples import FIRST_UNSEEN, model_of
from tests.services.layout.test_pipeline import TruthfulEngine, rgb

NEVER = 1e6


@lru_cache(maxsize=4)
def seen_letter(seed: int) -> tuple[LabelledPage, FinePage]:
    page = letter_page(np.random.default_rng(FIRST_UNSEEN + seed))
    return page, fine_page(rgb(page), read_words(luminance(rgb(page)), TruthfulEngine(page)))[1]


def lines_of(fine: FinePage, true: LabelledPage, label: str) -> tuple[int, ...]:
    """Lines of the zone with a label."""
    x0, y0, x1, y1 = next(zone.box for zone in true.zones if zone.label == label)
    middle = (fine.boxes[:, 1] + fine.boxes[:, 3]) / 2
    inside = (middle > y0) & (middle < y1) & (fine.boxes[:, 2] > x0) & (fine.boxes[:, 0] < x1)
    return tuple(np.flatnonzero(inside).tolist())


def merged(fine: FinePage, *parts: Sequence[int]) -> FinePage:
    """The page as if segmentation had made one zone of these lines."""
    own = tuple(line for part in parts for line in part)
    rest = (tuple(line for line in block if line not in own) for block in fine.blocks)
    return replace(fine, blocks=(own, *(block for block in rest if block)))


def composed(fine: FinePage) -> tuple[Page, tuple[tuple[int, ...], ...]]:
    page, lines = compose_with_lines(fine)
    return content_features().measure_page(page), lines


def regrouped(fine: FinePage) -> tuple[Page, tuple[tuple[int, ...], ...]]:
    return regroup_page(fine, *composed(fine), model_of("letter", 8), content_features())[:2]


@pytest.mark.parametrize("labels", [("date", "receiver"), ("salutation", "body"), ("body", "closing")])
def test_a_zone_of_two_components_is_taken_apart(labels: tuple[str, str]) -> None:
    true, fine = seen_letter(0)
    upper, lower = (lines_of(fine, true, label) for label in labels)
    together = merged(fine, upper, lower)
    page, lines = regrouped(together)
    assert {upper, lower} <= set(lines)
    assert [zone.id for zone in page.zones] == [f"z{number}" for number in range(1, len(page.zones) + 1)]
    for zone, own in zip(page.zones, lines, strict=True):
        assert zone.text == "\n".join(fine.texts[line] for line in own if fine.texts[line])
        assert bool(zone.content) == bool(zone.text), "new zones have content features"


def test_pieces_with_different_labels_become_one_zone() -> None:
    """A signature's strokes and the name below them: alone the strokes have another label."""
    true, fine = seen_letter(2)
    own = lines_of(fine, true, "signature")
    rest = tuple(block for block in fine.blocks if not set(block) & set(own))
    apart = replace(fine, blocks=(own[:1], own[1:], *rest))
    page, lines = regrouped(apart)
    assert own in lines
    assert len(page.zones) == len(composed(apart)[0].zones) - 1


def test_a_page_that_is_explained_well_stays_as_it_is() -> None:
    _, fine = seen_letter(0)
    page, lines = composed(fine)
    model = model_of("letter", 8)
    assert regroup_page(fine, page, lines, model, content_features())[0] is page


@pytest.mark.parametrize(("bound", "least"), [("_MOST_HYPOTHESES", 0), ("_MOST_PAIRS", 1)])
def test_without_a_budget_nothing_changes(bound: str, least: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(f"services.layout.grouping.regrouping.{bound}", least)
    true, fine = seen_letter(0)
    together = merged(fine, lines_of(fine, true, "salutation"), lines_of(fine, true, "body"))
    assert regrouped(together)[1] == composed(together)[1]


def line(top: float, left: float = 100.0, right: float = 500.0, em: float = 20.0) -> Line:
    return Line(np.arange(9), (left, top, right, top + em), top + em, em, em / 2, 2.0)


def test_a_space_is_measured_in_ems() -> None:
    block = [line(0), line(30, left=140, right=460), line(60)]
    first, last = measure_space(block, 1), measure_space(block, 2)
    np.testing.assert_allclose(first, [1.5, 2.0, 0.0, 0.0, 0.0, 1.0, 0.0])
    np.testing.assert_allclose(last, [1.5, 2.0, 2.0, 0.0, 0.0, 0.0, 1.0])
    doubled = [line(0, 200, 1000, 40), line(60, 280, 920, 40), line(120, 200, 1000, 40)]
    np.testing.assert_allclose(measure_space(doubled, 1), first)


def test_odds_rise_with_what_the_class_gains_and_fall_with_what_print_says_against_it() -> None:
    near, far = (measure_space([line(0), line(down)], 1) for down in (24, 60))
    assert join_log_odds(2.0, near) > join_log_odds(0.0, near) > join_log_odds(0.0, far)
    assert cut_log_odds(2.0, -3.0, 1.0, near) > cut_log_odds(0.0, -3.0, 1.0, near)
    assert cut_log_odds(2.0, -3.0, 1.0, near) > cut_log_odds(2.0, -3.0, 0.0, near)
    assert cut_log_odds(2.0, -3.0, 1.0, near) > cut_log_odds(2.0, -6.0, 1.0, near)
    larger = measure_space([line(0, em=24.0), line(24)], 1)
    assert cut_log_odds(2.0, -3.0, 1.0, larger) > cut_log_odds(2.0, -3.0, 1.0, near)


def test_a_recognition_of_other_zones_is_matched_anew_and_keeps_its_class() -> None:
    true, fine = seen_letter(0)
    together = merged(fine, lines_of(fine, true, "salutation"), lines_of(fine, true, "body"))
    models = [VersionedModel(model_of("letter", 8), 7)]
    first = recognize(compose_page(together), models)
    assert first.chosen is not None
    found = regroup(together, first, models, RecognitionParameters(explain=True))
    assert found.match is not None
    assert found.chosen is not None
    assert found.chosen == found.classes[0] == replace(first.chosen, cost=found.match.cost)
    assert {"salutation", "body"} <= {each.label for each in found.zones}
    assert [each.zone.id for each in found.zones] == [zone.id for zone in found.page.zones]
    assert found.match.explanation
    assert {term.zone for term in found.match.explanation} <= {zone.id for zone in found.page.zones}

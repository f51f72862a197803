"""Recognition among many models: the answer is the one that searching for all of them gives."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from services.layout.matching.parameters import MatchingParameters
from services.layout.pipeline import recognize
from services.layout.recognition import page_recognition as recognition
from services.layout.recognition.hierarchy.descent import MOST_CANDIDATES
from services.layout.recognition.page_recognition import RecognitionParameters, VersionedModel
from services.layout.recognition.results import Recognition
from tests.services.layout.recognition.hierarchy.bases import base
from tests.services.layout.samples import MAKERS, labelled_page

pytestmark = pytest.mark.pipeline

UNHURRIED = MatchingParameters(max_ms=np.inf)
"""Searches end by their steps alone; on a machine under load one had been stopped by its time."""
USUAL = RecognitionParameters(matching=UNHURRIED)
FLAT = RecognitionParameters(most_candidates=1000, matching=UNHURRIED)
FEW = RecognitionParameters(most_candidates=4, matching=UNHURRIED)


def same_labels(one: Recognition, other: Recognition) -> bool:
    return [zone.label for zone in one.zones] == [zone.label for zone in other.zones]


@pytest.mark.parametrize("name", MAKERS)
@pytest.mark.parametrize("parameters", [USUAL, FEW])
def test_class_and_labels_are_those_of_the_whole_search(name: str, parameters: RecognitionParameters) -> None:
    models = base(5)
    page = labelled_page(name, 1000)
    found, flat = recognize(page, models, parameters), recognize(page, models, FLAT)
    assert found.chosen is not None
    assert flat.chosen is not None
    assert (found.chosen.name, found.chosen.cost) == (flat.chosen.name, flat.chosen.cost)
    assert found.chosen.probability == pytest.approx(flat.chosen.probability, abs=0.02)
    assert found.unknown_probability == pytest.approx(flat.unknown_probability, abs=1e-9)
    assert same_labels(found, flat)
    assert found.match == flat.match


def test_all_classes_are_told() -> None:
    models = base(5)
    found = recognize(labelled_page("plain", 1001), models, FEW)
    assert {each.name for each in found.classes} == {each.model.name for each in models}
    shares = [each.probability for each in found.classes]
    assert shares == sorted(shares, reverse=True)
    assert sum(shares) + found.unknown_probability == pytest.approx(1.0)
    assert np.isfinite([each.cost for each in found.classes]).all()


def test_few_models_are_all_searched_for() -> None:
    """As many as may be candidates have the very answer that they have without a hierarchy."""
    models = base(2)
    assert len(models) <= MOST_CANDIDATES
    page = labelled_page("fax", 1002)
    found, flat = recognize(page, models, USUAL), recognize(page, models, FLAT)
    assert replace(found, timings_ms={}) == replace(flat, timings_ms={})


def test_a_bounded_number_is_searched_for(monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[bool] = []
    match = recognition._match

    def counting(*arguments: Any, thorough: bool) -> Any:
        calls.append(thorough)
        return match(*arguments, thorough=thorough)

    monkeypatch.setattr(recognition, "_match", counting)
    recognize(labelled_page("memo", 1003), base(5))
    assert calls.count(False) == MOST_CANDIDATES
    assert 1 <= calls.count(True) <= recognition.MOST_CONTENDERS


def test_the_order_of_many_models_changes_nothing() -> None:
    models, page = base(5), labelled_page("margin", 1004)
    order = np.random.default_rng(2).permutation(len(models))
    found = recognize(page, models, USUAL)
    other = recognize(page, [models[k] for k in order])
    assert found.classes[0].name == other.classes[0].name
    again = {each.name: each for each in other.classes}
    for each in found.classes:
        assert again[each.name].cost == pytest.approx(each.cost)
        assert again[each.name].probability == pytest.approx(each.probability, abs=1e-6)
    assert same_labels(found, other)


def test_equal_models_share_the_probability() -> None:
    """More equal ones than may be candidates, or may be searched for thoroughly."""
    one = base(1)[0]
    models = [VersionedModel(replace(one.model, name=f"{k:02}"), 1) for k in range(20)]
    found = recognize(labelled_page("letter", 1005), models, USUAL)
    assert found.match is not None
    assert {each.name for each in found.classes} == {each.model.name for each in models}
    assert found.classes[0].probability >= 1 / len(models) - 0.01
    assert same_labels(found, recognize(labelled_page("letter", 1005), [one], USUAL))


def test_genres_that_users_name_change_no_answer() -> None:
    page = labelled_page("two-column", 1006)
    models = base(5)
    named = [replace(each, genre=each.model.name[0]) for each in models]
    found, other = recognize(page, models, USUAL), recognize(page, named, USUAL)
    assert found.chosen is not None
    assert other.chosen is not None
    assert found.chosen.name == other.chosen.name
    assert same_labels(found, other)


@pytest.mark.parametrize("left_out", MAKERS)
def test_pages_of_no_class_get_the_same_answer(left_out: str) -> None:
    models = [each for each in base(5) if not each.model.name.startswith(left_out)]
    for seed in (1007, 1008):
        page = labelled_page(left_out, seed)
        found, flat = recognize(page, models, USUAL), recognize(page, models, FLAT)
        assert (found.chosen is None) == (flat.chosen is None)
        assert found.classes[0].name == flat.classes[0].name
        assert same_labels(found, flat)

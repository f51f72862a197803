"""A page is learned until the model is right on it, or a few times, and counts once."""

from dataclasses import replace

import pytest

from services.contract.layout_learning import Learner
from services.layout.learning import learners
from services.layout.learning.learners import MOST_LESSONS, learn_page, wrong_zones
from services.layout.model.statistics import LabelledGraph
from tests.services.layout.learning.learning_models import learning_model, lesson


def relabelled(seed: int) -> LabelledGraph:
    """A letter whose labels are those of the neighbours before: no page of the model had them so."""
    page = lesson("letter", seed)
    return replace(page, labels=(*page.labels[1:], page.labels[0]))


def lessons_of(page: LabelledGraph, learner: Learner, monkeypatch: pytest.MonkeyPatch) -> tuple[int, int]:
    """How often a page was learned, and how many zones are wrong afterwards."""
    learned = learning_model("letter", 5)
    counted, once = [], learners._one_lesson

    def count(*given):
        counted.append(given)
        return once(*given)

    with monkeypatch.context() as patch:
        patch.setattr(learners, "_one_lesson", count)
        taught = learn_page(learned, page, learner)
    assert taught.samples == learned.samples + (learner != "error-correction")
    if learner != "error-correction":
        assert taught.zones.sum() == learned.zones.sum() + len(page.labels)
    return len(counted), wrong_zones(taught, page)


def test_a_page_that_is_right_is_learned_once(monkeypatch: pytest.MonkeyPatch) -> None:
    learned = learning_model("letter", 5)
    page = next(
        page for page in map(lambda seed: lesson("letter", seed), range(20)) if not wrong_zones(learned, page)
    )
    assert lessons_of(page, "passive-aggressive", monkeypatch) == (1, 0)


def test_a_page_that_stays_wrong_is_learned_again(monkeypatch: pytest.MonkeyPatch) -> None:
    page = relabelled(3)
    number, wrong = lessons_of(page, "passive-aggressive", monkeypatch)
    with monkeypatch.context() as patch:
        patch.setattr(learners, "MOST_LESSONS", 1)
        alone, before = lessons_of(page, "passive-aggressive", monkeypatch)
    assert alone == 1
    assert before > 0
    assert 1 < number <= MOST_LESSONS
    assert wrong < before


@pytest.mark.parametrize("learner", ["counting", "error-correction"])
def test_other_learners_learn_a_page_once(learner: Learner, monkeypatch: pytest.MonkeyPatch) -> None:
    assert lessons_of(relabelled(3), learner, monkeypatch)[0] == 1

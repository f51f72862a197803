"""Rounds of training: errors fall, what is held out decides, and nothing is counted twice."""

import pytest

from services.layout.learning.learners import wrong_zones
from services.layout.learning.rounds import run_rounds
from services.layout.learning.training import train_in_rounds
from services.layout.model.learning_model import LearningModel
from services.layout.pipeline import content_features
from tests.services.layout.learning.learning_models import known_lesson, learning_model
from tests.services.layout.samples import labelled_page, model_of

pytestmark = pytest.mark.pipeline


def lessons(document_class: str, learned: LearningModel, count: int):
    return [[known_lesson(learned, document_class, seed)] for seed in range(count)]


@pytest.mark.parametrize("learner", ["passive-aggressive", "error-correction"])
def test_errors_on_the_samples_fall(learner) -> None:
    learned = learning_model("letter", 1)
    pages = lessons("letter", learned, 6)
    model, training = run_rounds(lambda indices: learned, pages, 25, learner, hold_out=False)
    errors = [each.error for each in training.rounds]
    assert errors[0] > 0.02
    assert errors[training.kept_round] <= 0.5 * errors[0]
    assert errors[training.kept_round] == min(errors)
    assert all(each.held_out_error is None for each in training.rounds)
    zones = sum(len(views[0].labels) for views in pages)
    left = sum(wrong_zones(model, views[0]) for views in pages) / zones
    assert left == pytest.approx(errors[training.kept_round])


def test_counting_alone_stops_at_once() -> None:
    learned = learning_model("memo", 1)
    model, training = run_rounds(lambda indices: learned, lessons("memo", learned, 3), 10, "counting")
    assert (training.kept_round, len(training.rounds)) == (0, 2)
    assert training.stopped == ("no-change" if training.rounds[-1].error else "no-errors")
    assert model is learned


def test_held_out_pages_are_not_learned_from_and_choose_the_round(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("services.layout.learning.rounds._FOLDS", 3)
    monkeypatch.setattr("services.layout.learning.rounds._PATIENCE", 1)
    learned = learning_model("letter", 1)
    pages = lessons("letter", learned, 6)
    begun: list[set[int]] = []

    def begin(indices) -> LearningModel:
        begun.append(set(indices))
        return learned

    _, training = run_rounds(begin, pages, 6, "passive-aggressive")
    assert begun[-1] == set(range(6))
    held_out = [set(range(6)) - each for each in begun[:-1]]
    assert sorted(index for part in held_out for index in part) == list(range(6))
    errors = [each.held_out_error for each in training.rounds]
    assert errors[training.kept_round] == min(errors)
    best = min(training.rounds, key=lambda each: (each.held_out_error, each.error))
    assert training.kept_round == best.round


def test_training_stops_when_held_out_errors_rise(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pages whose labels contradict each other leave more and more errors on those held out."""
    learned = learning_model("letter", 1)
    pages = lessons("letter", learned, 4)
    held_out_errors = iter([5, 4, 6, 7, 9, 9])

    def scripted(model, page) -> int:
        return next(held_out_errors) if page is pages[0][0] and model is not whole else 0

    whole = learned
    monkeypatch.setattr("services.layout.learning.rounds.wrong_zones", scripted)
    monkeypatch.setattr(
        "services.layout.learning.rounds.correct_page", lambda model, page, learner: (model, True)
    )
    other = learning_model("letter", 1)
    _, training = run_rounds(
        lambda indices: whole if len(indices) == 4 else other, pages, 50, "passive-aggressive"
    )
    assert training.stopped == "held-out"
    assert training.kept_round == 1
    assert len(training.rounds) == 4, "two rounds worse than the best one"


def test_effort_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fewer parts are held out of what takes long, and rounds end."""
    learned = learning_model("letter", 1)
    pages = lessons("letter", learned, 6)
    _, whole = run_rounds(lambda indices: learned, pages, 3, "passive-aggressive")
    rounds = len(whole.rounds) - 1
    begun: list[int] = []

    def begin(indices) -> LearningModel:
        begun.append(len(indices))
        return learned

    monkeypatch.setattr("services.layout.learning.rounds._MOST_EFFORT", 1.0)
    monkeypatch.setattr("services.layout.learning.rounds._PATIENCE", 100)
    _, training = run_rounds(begin, pages, 3, "passive-aggressive")
    assert begun == [4, 6], "one part is held out still, and all are learned from"
    assert (training.stopped, len(training.rounds)) == ("effort", 2), "one round there is in any case"
    assert rounds > 1


def test_a_model_is_trained_from_its_samples() -> None:
    samples = [labelled_page("letter", seed) for seed in range(6)]
    heard: list[float] = []
    trained, report = train_in_rounds(
        model_of("letter", 3), samples, [None] * 6, 3, "passive-aggressive", content_features(), heard.append
    )
    assert report.rounds[0].held_out_error is not None
    assert trained.samples == 6
    assert trained.statistics is not None
    assert trained.statistics.pages == 6
    assert trained.calibration.pages == 12
    assert heard == sorted(heard)
    assert heard[-1] <= 1.0


def test_a_model_that_has_seen_more_than_its_samples_goes_on_from_where_it_stands() -> None:
    experienced = model_of("letter", 5)
    samples = [labelled_page("letter", 1000 + seed) for seed in range(2)]
    trained, report = train_in_rounds(
        experienced, samples, [None] * 2, 2, "passive-aggressive", content_features()
    )
    assert trained.samples == experienced.samples
    assert trained.statistics is not None
    assert trained.statistics.pages == 5, "its pages are not counted again"
    assert all(each.held_out_error is None for each in report.rounds)


def test_nothing_to_learn_from_is_an_error() -> None:
    with pytest.raises(ValueError, match="at least one page"):
        train_in_rounds(model_of("memo", 1), [], [], 1, "counting", content_features())

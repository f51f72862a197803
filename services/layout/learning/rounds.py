"""Rounds of training (5.6.1): every round learns from all verified pages in the same order."""

from collections.abc import Callable, Sequence

from services.contract.answers.learning import Round
from services.contract.layout_learning import Learner, Stop, TrainingReport
from services.layout.learning.learners import correct_page, wrong_zones
from services.layout.model.learning_model import LearningModel, with_labels
from services.layout.model.statistics import LabelledGraph

_FOLDS = 5
"""Folds of the cross-validation. Each takes as long as the training itself."""
_MOST_EFFORT = 6e9
"""Entries of tables of pairs in all: about a minute. Of very many or large pages fewer parts are held out in turn,
so that there is time for `FEWEST_ROUNDS`, and rounds end when it is spent."""
_PATIENCE = 2
"""Rounds in a row that may leave more errors on held-out pages than the best round before; errors are few, so
that one more may be chance."""


BeginModel = Callable[[Sequence[int]], LearningModel]
"""(indices of samples) -> the model at round 0 that has seen these samples alone."""


FEWEST_ROUNDS = 3
"""The dissertation's title pages needed three rounds (5.6.1)."""
LEAST_EFFORT = 2e5
"""Least effort that a page counts as."""


def run_rounds(
    begin: BeginModel,
    pages: Sequence[Sequence[LabelledGraph]],
    rounds: int,
    learner: Learner,
    report: Callable[[float], None] = lambda share: None,
    *,
    hold_out: bool = True,
) -> tuple[LearningModel, TrainingReport]:
    """The model of all pages after the round with fewest errors on held-out pages, and the report of all rounds.

    Of equal rounds it is the one with fewest errors on the samples, and of these the earliest.

    `pages[i]` are the views of sample i, the verified one first: errors are counted on it, every view is learned from.
    Training ends after `rounds`, when the held-out error has risen for `patience` rounds, when a round has changed
    nothing, or when `most_effort` is spent. `report` is called with the share of the work that is done.
    """
    every = range(len(pages))
    folds = min(_FOLDS, len(pages)) if hold_out and len(pages) > 1 else 0
    effort = [sum(_effort(view) for view in views) for views in pages]
    room = _MOST_EFFORT / FEWEST_ROUNDS / max(sum(effort), LEAST_EFFORT) - 1
    in_turn = folds if room >= folds else max(min(folds, 1), int(room))
    held_out = [[index for index in every if index % folds == part] for part in range(in_turn)]
    fold_models = [
        _Fold(begin([index for index in every if index not in set(part)]), part) for part in held_out
    ]
    whole = _Fold(begin(every), [])
    zones = max(1, sum(len(views[0].labels) for views in pages))
    held_zones = max(1, sum(len(pages[index][0].labels) for part in held_out for index in part))
    of_round = sum(effort) + sum(sum(effort) - sum(effort[index] for index in part) for part in held_out)
    history: list[Round] = []
    errors: list[tuple[int, int]] = []
    kept, kept_model = 0, whole.model
    stopped: Stop = "rounds"
    for number in range(rounds + 1):
        changed = False
        if number:
            for fold in fold_models:
                fold.learn_round(pages, learner)
            changed = whole.learn_round(pages, learner)
        wrong = sum(wrong_zones(whole.model, views[0]) for views in pages)
        held = sum(
            wrong_zones(each.model, pages[index][0]) for each in fold_models for index in each.held_out
        )
        errors.append((held, wrong))
        held_out_error = round(held / held_zones, 4) if fold_models else None
        history.append(Round(round=number, error=round(wrong / zones, 4), held_out_error=held_out_error))
        if errors[-1] < min(errors[:-1], default=(held_zones + 1, 0)):
            kept, kept_model = number, whole.model
        report(number / max(1, rounds))
        if number and not changed:
            stopped = "no-change" if wrong else "no-errors"
            break
        if number - kept >= _PATIENCE and held > errors[kept][0]:
            stopped = "held-out"
            break
        if number and (number + 1) * of_round > _MOST_EFFORT and number < rounds:
            stopped = "effort"
            break
    return kept_model, TrainingReport(tuple(history), kept, stopped)


def _effort(view: LabelledGraph) -> float:
    """Approximate number of entries in the tables of a page."""
    labels = len(set(view.labels)) + 1
    return LEAST_EFFORT + len(view.graph.pairs) * float(labels**2)


class _Fold:
    """A model of cross-validation: it learns from all samples but those that are held out."""

    def __init__(self, model: LearningModel, held_out: Sequence[int]) -> None:
        self.model, self.held_out = model, held_out

    def learn_round(self, pages: Sequence[Sequence[LabelledGraph]], learner: Learner) -> bool:
        """Learn in one round from all its samples; whether the model changed."""
        skipped, any_changed = set(self.held_out), False
        for index, views in enumerate(pages):
            if index in skipped:
                continue
            for view in views:
                self.model, changed = correct_page(with_labels(self.model, view.labels), view, learner)
                any_changed |= changed
        return any_changed

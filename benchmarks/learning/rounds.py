"""Error against rounds of training: Figures 5.7, 5.10 and 5.15 again, from all samples and from few."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import cast

import numpy as np

from benchmarks.common.baseline import Figures
from benchmarks.common.plots import draw_panels
from benchmarks.layout.labelling import UNIFIED
from benchmarks.layout.learning_curve import TEN
from benchmarks.layout.part import Part, Result, Results, share, table
from benchmarks.layout.protocols import Labels, component_counts, error_percent, folds
from benchmarks.layout.specimens import Specimen, of_sources
from benchmarks.layout.truth import TITLES_REAL
from benchmarks.learning.pages import (
    COLOURS,
    begin,
    chosen_sets,
    drop_percent,
    found_labels,
    labelled,
    see,
    verdict,
)
from services.contract.layout_learning import Learner
from services.layout.learning.initialization import Views
from services.layout.learning.learners import correct_page, learn_page, wrong_zones
from services.layout.learning.rounds import run_rounds
from services.layout.model.learning_model import LearningModel, with_labels
from services.layout.page import Page

TITLE_SETS = (*tuple(name for name in UNIFIED if name != "title page, made"), *TITLES_REAL)
LETTER_SETS = ("letters/real", "letters/real" + TEN, "letters/made")
FEW_SETS = (*TITLES_REAL, *LETTER_SETS)
TITLE_ROUNDS = (0, 1, 2, 3)
LETTER_ROUNDS = (0, 1, 2, 3, 5, 10, 20, 30)
FIGURE_ROUNDS = (*LETTER_ROUNDS, 50, 70, 100)
"""Of the ten components, as Figure 5.15 has them; the other letters' curves are flat long before."""
FEW_ROUNDS = (0, 1, 2, 3, 5, 10)
FEW = (1, 3, 5)
"""Samples that a model begins with before it learns from all."""
MOST_FOLDS = 45
"""Leave one out for publications; fewer folds for all else, whose models take too long to be trained so often."""
UNIFIED_FOLDS, LETTER_FOLDS = 10, 5
FEW_FOLDS = KEPT_FOLDS = 5
ROUND_LEARNERS: tuple[Learner, ...] = ("passive-aggressive", "error-correction")
LEAST_RIGHT = 93.0
"""Percent of the real letters' zones; the dissertation's trained model has 87."""
ALL = "all samples"
KEPT = "kept"
"""What training itself keeps, which holds pages out among the samples and stops."""

Begin = Callable[[Sequence[int]], LearningModel]


@dataclass(frozen=True, slots=True)
class _Trial:
    """One curve: a set, what the model begins with, and the learner."""

    pages: str
    start: str
    learner: Learner

    @property
    def name(self) -> str:
        return f"{self.pages} | {self.start} | {self.learner}"

    @classmethod
    def of(cls, name: str) -> "_Trial":
        pages, start, learner = name.split(" | ")
        return cls(pages, start, cast(Learner, learner))

    @property
    def rounds(self) -> tuple[int, ...]:
        """Those that are told."""
        if self.start not in (ALL, KEPT):
            return FEW_ROUNDS
        if self.pages == "letters/real" + TEN:
            return FIGURE_ROUNDS
        return LETTER_ROUNDS if self.pages in LETTER_SETS else TITLE_ROUNDS

    @property
    def folds(self) -> int:
        """At most so many."""
        if self.start != ALL:
            return FEW_FOLDS
        if self.pages in TITLES_REAL:
            return MOST_FOLDS
        return LETTER_FOLDS if self.pages in LETTER_SETS else UNIFIED_FOLDS


def _sets(specimens: Sequence[Specimen]) -> dict[str, list[Page]]:
    unified = {
        name: [each.true for each in of_sources(specimens, UNIFIED[name])]
        for name in TITLE_SETS
        if name in UNIFIED
    }
    sets = {**unified, **chosen_sets(specimens, (*TITLES_REAL, *LETTER_SETS))}
    return {name: pages for name, pages in sets.items() if len(pages) > FEW_FOLDS}


def _jobs(specimens: Sequence[Specimen]) -> list[str]:
    sets = _sets(specimens)
    few: tuple[Learner, ...] = (*ROUND_LEARNERS, "counting")
    trials = [
        *(
            _Trial(name, start, learner)
            for name in sets
            for start in (ALL, KEPT)
            for learner in ROUND_LEARNERS
        ),
        *(
            _Trial(name, _few(size), learner)
            for name in FEW_SETS
            if name in sets
            for size in FEW
            for learner in few
        ),
    ]
    return [trial.name for trial in trials]


def _few(size: int) -> str:
    return f"{size} sample{'s' * (size > 1)}"


def practised(learned: LearningModel, samples: Sequence[Views], learner: Learner) -> Iterator[LearningModel]:
    """The model after each round over both views of all samples, without end; the same once it learns no more."""
    while True:
        any_changed = False
        for views in samples:
            for view in views:
                ready = with_labels(learned, view.labelled.labels)
                learned, changed = correct_page(ready, view.labelled, learner)
                any_changed |= changed
        yield learned
        while not any_changed:
            yield learned


def corrected(
    learned: LearningModel, samples: Sequence[Views], seen: Sequence[int], learner: Learner
) -> Iterator[LearningModel]:
    """The model after each round of feedback on all samples, of which it had seen those at `seen` before.

    In the first round feedback tells it the others, after it each is practised again.
    """
    pages = [views[0].labelled for views in samples]
    number = 0
    while True:
        number += 1
        any_changed = number == 1
        for index, page in enumerate(pages):
            if number == 1 and index not in seen:
                learned = learn_page(learned, page, learner)
                continue
            learned, changed = correct_page(with_labels(learned, page.labels), page, learner)
            any_changed |= changed
        yield learned
        while not any_changed:
            yield learned


def _measure(job: str, specimens: Sequence[Specimen]) -> Result:
    trial = _Trial.of(job)
    pages = _sets(specimens)[trial.pages]
    seen = see(pages)
    if trial.start == KEPT:
        return _measure_kept(trial, seen)
    wrong = np.zeros((len(trial.rounds), 2))
    zones = np.zeros(2)
    for fold, (learned, tested) in enumerate(folds(len(seen), trial.folds)):
        samples = [seen[index] for index in learned]
        if trial.start == ALL:
            model = begin(samples)
            after = practised(model, samples, trial.learner)
        else:
            size = int(trial.start.split()[0])
            drawn = sorted(
                np.random.default_rng([fold, size]).choice(len(samples), size, replace=False).tolist()
            )
            model = begin([samples[index] for index in drawn])
            after = corrected(model, samples, drawn, trial.learner)
        parts = [[views[0].labelled for views in samples], [seen[index][0].labelled for index in tested]]
        zones += [sum(len(page.labels) for page in part) for part in parts]
        counted: tuple[LearningModel, list[int]] | None = None
        for number_of_round in range(trial.rounds[-1] + 1):
            if number_of_round:
                model = next(after)
            if number_of_round in trial.rounds:
                # A model that has learned no more need not be asked again.
                if counted is None or counted[0] is not model:
                    counted = model, [sum(wrong_zones(model, page) for page in part) for part in parts]
                wrong[trial.rounds.index(number_of_round)] += counted[1]
    return {
        "folds": min(trial.folds, len(seen)),
        "pages": len(seen),
        "zones": int(zones[1]),
        "rounds": list(trial.rounds),
        "training_percent": [share(each, zones[0]) for each in wrong[:, 0]],
        "error_percent": [share(each, zones[1]) for each in wrong[:, 1]],
    }


def _measure_kept(trial: _Trial, seen: Sequence[Views]) -> Result:
    """Training as `POST /layout/models/{name}/train` does it, with its stop; errors on pages that it never saw."""
    kept, run, before, after = [], [], 0, 0
    truth: list[Labels] = []
    found: list[Labels] = []
    for learned, tested in folds(len(seen), KEPT_FOLDS):
        samples = [seen[index] for index in learned]

        def begin_at(indices: Sequence[int], samples: Sequence[Views] = samples) -> LearningModel:
            return begin([samples[index] for index in indices])

        pages = [[view.labelled for view in views] for views in samples]
        model, training = run_rounds(begin_at, pages, trial.rounds[-1], trial.learner)
        kept.append(training.kept_round)
        run.append(training.rounds[-1].round)
        first = begin(samples)
        for page in (labelled(seen[index][0].page) for index in tested):
            before += wrong_zones(first, page)
            truth.append(tuple(page.labels))
            found.append(found_labels(model, page))
            after += sum(a != b for a, b in zip(truth[-1], found[-1], strict=True))
    zones = sum(map(len, truth))
    counts = component_counts(truth, found)
    named = [each for label, each in counts.items() if label is not None]
    correct = sum(each.correct for each in named)
    return {
        "kept": kept,
        "rounds": run,
        "begun_percent": share(before, zones),
        "error_percent": error_percent(truth, found),
        "right_percent": 100 - share(after, zones),
        "precision_percent": share(correct, sum(each.found for each in named)),
        "recall_percent": share(correct, sum(each.true for each in named)),
        "components": {
            label or "(unlabelled)": [each.true, each.found, each.correct]
            for label, each in sorted(counts.items(), key=lambda item: item[0] or "~")
        },
    }


def _report(results: Results) -> str:
    parts = []
    curves = {name: result for name, result in results.items() if _Trial.of(name).start != KEPT}
    for rounds, members in groupby(curves, key=lambda name: _Trial.of(name).rounds):
        head = ("set | begins with | learner", "pages", "folds", *(f"round {number}" for number in rounds))
        rows = []
        for name in members:
            result = results[name]
            told = [
                f"{error:.2f} ({training:.2f})"
                for error, training in zip(result["error_percent"], result["training_percent"], strict=True)
            ]
            rows.append([name, result["pages"], result["folds"], *told])
        parts.append(
            table("Error of zones, percent, on pages held out (on the samples), after rounds", head, rows)
        )
    rows = []
    for name, result in results.items():
        if _Trial.of(name).start == KEPT:
            rows.append(
                [
                    name,
                    "/".join(map(str, result["kept"])),
                    "/".join(map(str, result["rounds"])),
                    *(result[key] for key in ("begun_percent", "error_percent")),
                    *(result[key] for key in ("right_percent", "precision_percent", "recall_percent")),
                ]
            )
    head = ("set | training | learner", "kept round", "rounds run", "error round 0", "error kept")
    head = (*head, "right %", "precision %", "recall %")
    title = f"What training keeps, which stops by pages held out: {KEPT_FOLDS} folds, errors on pages it never saw"
    note = "right: of all zones; precision and recall: of zones with a label, all labels together"
    parts.append(f"{table(title, head, rows)}\n{note}")
    head = ("what", *(cell for learner in ROUND_LEARNERS for cell in (learner, "met")))
    parts.append(table("Required", head, _required(results)))
    return "\n\n".join(parts)


def _required(results: Results) -> list[list[object]]:
    """One row a set and beginning, with a cell and a verdict for each learner."""
    rows: dict[str, list[object]] = {}
    for name, result in results.items():
        trial = _Trial.of(name)
        if trial.learner not in ROUND_LEARNERS:
            continue
        if trial.start == KEPT:
            if trial.pages == "letters/real" + TEN:
                what = f"{trial.pages}, {trial.start}: right / precision / recall at least {LEAST_RIGHT:g} %"
                values = [result[key] for key in ("right_percent", "precision_percent", "recall_percent")]
                told = " / ".join(f"{value:.1f}" for value in values)
                rows.setdefault(what, [what]).extend([told, verdict(min(values) >= LEAST_RIGHT)])
            continue
        letters = trial.pages in LETTER_SETS
        fall, limit = (60, 5.0) if letters else (30, 2.0)
        when = f"within {result['rounds'][-1]} rounds" if letters else "after round 3"
        first = result["error_percent"][0]
        last = min(result["error_percent"]) if letters else result["error_percent"][result["rounds"].index(3)]
        drop = drop_percent(first, last)
        what = f"{trial.pages}, from {trial.start}: {when} {fall} % below round 0, or below {limit:g} %"
        told = f"{first:.2f} > {last:.2f} ({-drop:+.0f} %)"
        rows.setdefault(what, [what]).extend([told, verdict(drop >= fall or last < limit)])
    width = 1 + 2 * len(ROUND_LEARNERS)
    return [[*row, *([None] * (width - len(row)))] for row in rows.values()]


def draw_rounds(path: Path, results: Results) -> None:
    """One panel a set and beginning: held-out error by round of each learner, that on the samples dashed."""
    panels: dict[str, dict[str, tuple[Sequence[float], Sequence[float]]]] = {}
    for name, result in results.items():
        trial = _Trial.of(name)
        if trial.start != KEPT:
            panel = panels.setdefault(f"{trial.pages}\nfrom {trial.start}", {})
            panel[trial.learner] = result["rounds"], result["error_percent"]
            panel[f"({trial.learner}, on the samples)"] = result["rounds"], result["training_percent"]
    colours = {**COLOURS, **{f"({name}, on the samples)": colour for name, colour in COLOURS.items()}}
    draw_panels(path, panels, colours, "rounds", "zones with a wrong label, percent", ticks=FIGURE_ROUNDS)


def _figures(results: Results) -> Figures:
    return {
        f"rounds, {name}": {
            "rounds_error_percent": result["error_percent"]
            if _Trial.of(name).start == KEPT
            else min(result["error_percent"])
        }
        for name, result in results.items()
    }


ROUNDS = Part(_jobs, _measure, _report, _figures)

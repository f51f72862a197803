"""Class of a page: in folds, without its class, few samples, and the four kinds of documents."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from benchmarks.common.baseline import Figures
from benchmarks.layout.part import Part, Result, Results, share, table
from benchmarks.layout.protocols import folds, make_model, recognized
from benchmarks.layout.specimens import (
    OTHER_LETTERS,
    TRIALS,
    Specimen,
    Trial,
    by_class,
    by_kind,
    lessons,
    of_sources,
)
from services.layout.model.layout_model import LayoutModel
from services.layout.page import Page

FEW = (3, 5)
"""Samples of a model besides all."""
DRAWS = 2
BINS = 15
"""Of the reliability diagram of class probabilities."""
FOLDS = 10
"""Of a class's pages (the smallest classes have ten), instead of leaving out one by one: minutes, not half an hour."""
_FEW = {f"{few} samples": few for few in FEW}
_MEASURED: tuple[Trial, ...] = ("true zones", "taught to own")
Models = dict[str, LayoutModel]


def _jobs(specimens: Sequence[Specimen]) -> list[str]:
    if len(by_class(specimens)) < 2:
        return []
    jobs = [f"{what}, {trial}" for what in ("all samples", *_FEW, "four kinds") for trial in _MEASURED]
    return [*jobs, "images without zones"] if of_sources(specimens, (OTHER_LETTERS,)) else jobs


def _measure(job: str, specimens: Sequence[Specimen]) -> Result:
    if job == "images without zones":
        return _other_images(specimens)
    what, _, told = job.partition(", ")
    trial = next(each for each in _MEASURED if each == told)
    if what == "four kinds":
        return _kinds(specimens, trial)
    if what == "all samples":
        return _in_folds(by_class(specimens), trial)
    return _few_samples(by_class(specimens), trial, _FEW[what])


class _Decisions:
    """Decisions of the class, row by row."""

    def __init__(self) -> None:
        self.rows: dict[str, Counter[str]] = {}

    def decide(self, row: str, wanted: str, page: Page, models: Mapping[str, LayoutModel]) -> None:
        """With the page's class among the models, and without it."""
        counts = self.rows.setdefault(row, Counter())
        answer = recognized(page, models)
        chosen = answer.chosen.name if answer.chosen else "unknown"
        nearest = answer.classes[0].name if answer.classes else "unknown"
        counts["pages"] += 1
        counts["right"] += chosen == wanted
        counts["nearest right"] += nearest == wanted
        counts["unknown"] += chosen == "unknown"
        if chosen not in (wanted, "unknown"):
            counts[f"taken for {chosen}"] += 1
        others = {name: model for name, model in models.items() if name != wanted}
        recognized_others = recognized(page, others)
        stranger = recognized_others.chosen
        counts["unknown to others"] += stranger is None
        if stranger is not None:
            counts[f"unseen, taken for {stranger.name}"] += 1
        nearest_odds = answer.classes[0].probability if answer.classes else 0.0
        self._believe(counts, "known", nearest_odds, is_right=nearest == wanted)
        strange = recognized_others.classes[0].probability if recognized_others.classes else 0.0
        self._believe(counts, "unseen", strange, is_right=False)

    @staticmethod
    def _believe(counts: Counter[str], what: str, probability: float, *, is_right: bool) -> None:
        """Sums over the bins of a reliability diagram: thousandths of probability, and right decisions."""
        place = min(int(BINS * probability), BINS - 1)
        counts[f"{what} {place} probability"] += round(1000 * probability)
        counts[f"{what} {place} right"] += is_right

    def result(self) -> Result:
        return {row: dict(counts) for row, counts in self.rows.items()}


def _row(specimen: Specimen, class_name: str) -> str:
    """Letters are told by where they come from."""
    return specimen.source if class_name == "letter" else class_name


def _in_folds(classes: Mapping[str, Sequence[Specimen]], trial: Trial) -> Result:
    learned, tested = TRIALS[trial]
    full = {name: make_model(name, lessons(members, learned)) for name, members in classes.items()}
    decisions = _Decisions()
    for name, members in classes.items():
        for chosen, held_out in folds(len(members), FOLDS):
            rest = lessons((members[at] for at in chosen), learned)
            if rest:
                models = {**full, name: make_model(name, rest)}
                for specimen in (members[at] for at in held_out):
                    decisions.decide(_row(specimen, name), name, specimen.page(tested), models)
    return decisions.result()


def _few_samples(classes: Mapping[str, Sequence[Specimen]], trial: Trial, few: int) -> Result:
    (learned, tested), decisions = TRIALS[trial], _Decisions()
    for draw in range(DRAWS):
        rng = np.random.default_rng([draw, few])
        models: Models = {}
        held_out: list[tuple[Specimen, str]] = []
        for name, members in classes.items():
            drawn = set(rng.choice(len(members), min(few, len(members)), replace=False).tolist())
            models[name] = make_model(name, lessons((members[at] for at in sorted(drawn)), learned))
            held_out += [(member, name) for at, member in enumerate(members) if at not in drawn]
        for specimen, name in held_out:
            decisions.decide(_row(specimen, name), name, specimen.page(tested), models)
    return decisions.result()


def _kinds(specimens: Sequence[Specimen], trial: Trial) -> Result:
    (learned, tested), decisions = TRIALS[trial], _Decisions()
    kinds = by_kind(specimens)
    for fold in range(FOLDS):
        models: Models = {}
        for name, members in kinds.items():
            rest = [member for at, member in enumerate(members) if at % FOLDS != fold]
            models[name] = make_model(name, lessons(rest, learned))
        for name, members in kinds.items():
            for specimen in members[fold::FOLDS]:
                decisions.decide(_row(specimen, name), name, specimen.page(tested), models)
    return decisions.result()


def _other_images(specimens: Sequence[Specimen]) -> Result:
    """Images whose class alone is known, by models of all others' own zones."""
    decisions: dict[str, _Decisions] = {}
    for what, groups in (("all classes", by_class(specimens)), ("four kinds", by_kind(specimens))):
        models = {
            name: make_model(name, lessons(members, ("true", "own"))) for name, members in groups.items()
        }
        decisions[what] = _Decisions()
        for specimen in of_sources(specimens, (OTHER_LETTERS,)):
            row = f"{what}: {specimen.source} {specimen.class_name}"
            decisions[what].decide(row, specimen.class_name, specimen.page("own"), models)
    return {row: counts for each in decisions.values() for row, counts in each.result().items()}


def _total(rows: Iterable[Mapping[str, int]]) -> Counter[str]:
    total: Counter[str] = Counter()
    for row in rows:
        total.update(row)
    return total


def _expected_error(total: Mapping[str, int], kinds: Sequence[str]) -> float:
    """Expected calibration error, percent, of the probability of the nearest class, over pages of `kinds`."""
    wrong = 0.0
    for place in range(BINS):
        believed = sum(total.get(f"{kind} {place} probability", 0) for kind in kinds) / 1000
        wrong += abs(believed - sum(total.get(f"{kind} {place} right", 0) for kind in kinds))
    return share(wrong, len(kinds) * total["pages"])


_COUNTED = ("right", "nearest right", "unknown", "unknown to others")


def _report(results: Results) -> str:
    parts = []
    head = ("class", "pages", "right %", "nearest right %", "unknown %", "unseen: unknown %", "  taken for")
    for job, result in results.items():
        rows = []
        shown = {**result, "all": _total(result.values())} if job != "images without zones" else result
        for name, counts in shown.items():
            taken = " ".join(
                f"{what.removeprefix('taken for ')} {count}"
                for what, count in counts.items()
                if what.startswith("taken for")
            )
            shares = [share(counts.get(what, 0), counts["pages"]) for what in _COUNTED]
            rows.append([name, counts["pages"], *shares, taken if name != "all" else ""])
        parts.append(table(f"Class decision, {job}", head, rows))
        unseen = _total(result.values())
        strangers = {what: count for what, count in unseen.items() if what.startswith("unseen, ")}
        if strangers:
            listed = sorted(strangers.items(), key=lambda item: -item[1])[:5]
            parts[-1] += "\n  " + "; ".join(f"{what} {count}" for what, count in listed)
        errors = [_expected_error(unseen, kinds) for kinds in (("known",), ("known", "unseen"))]
        parts[-1] += "\n  expected error of the nearest class's probability, %: pages of known classes "
        parts[-1] += f"{errors[0]:.1f}; as many of unseen ones beside them {errors[1]:.1f}"
    wanted = "wanted: 100 % of all classes (dissertation: 85/85), four kinds at least 98 %"
    return "\n\n".join([*parts, wanted])


def _figures(results: Results) -> Figures:
    figures: Figures = {}
    for job, result in results.items():
        total = _total(result.values())
        figures[f"classes, {job}"] = {
            "right_percent": share(total["right"], total["pages"]),
            "unseen_unknown_percent": share(total["unknown to others"], total["pages"]),
        }
    return figures


CLASSES = Part(_jobs, _measure, _report, _figures)

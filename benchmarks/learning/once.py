"""One correction suffices: after feedback on a single page, how often the next pages have the same errors."""

from collections import Counter
from collections.abc import Sequence

import numpy as np

from benchmarks.common.baseline import Figures
from benchmarks.layout.learning_curve import TEN
from benchmarks.layout.part import Part, Result, Results, share, table
from benchmarks.layout.specimens import Specimen
from benchmarks.layout.truth import TITLES_MADE, TITLES_REAL
from benchmarks.learning.pages import LEARNERS, begin, chosen_sets, found_labels, see, verdict
from services.layout.learning.learners import learn_page

SETS = (
    *TITLES_REAL,
    *TITLES_MADE,
    "letters/real",
    "letters/real" + TEN,
    "letters/made",
    "letters/made memo",
    "letters/made fax",
)
"""A publication is a template; letters, memos and fax sheets are of many senders: their class is taken for one."""
SIZES = (1, 3, 5, 10)
SEEDS = 2
MOST_TRIALS, MOST_NEXT = 8, 20
"""Pages with errors that are each corrected alone, and pages that come after."""

Labels = Sequence[str | None]


def _jobs(specimens: Sequence[Specimen]) -> list[str]:
    return list(chosen_sets(specimens, SETS))


def confused(truth: Labels, found: Labels) -> Counter[tuple[str | None, str | None]]:
    """Errors of a page by what they are: true label and found label."""
    return Counter(pair for pair in zip(truth, found, strict=True) if pair[0] != pair[1])


def repeated(
    corrected: Counter[tuple[str | None, str | None]],
    truth: Sequence[Labels],
    found: Sequence[Labels],
) -> tuple[int, int]:
    """Errors on other pages: those that the corrected page had as well, and all."""
    errors = sum((confused(*pair) for pair in zip(truth, found, strict=True)), Counter())
    return sum(count for error, count in errors.items() if error in corrected), errors.total()


def _measure(job: str, specimens: Sequence[Specimen]) -> Result:
    seen = see(chosen_sets(specimens, (job,))[job])
    result: Result = {}
    for size in (size for size in SIZES if size + 2 <= len(seen)):
        same = {learner: 0 for learner in LEARNERS}
        every = {learner: 0 for learner in LEARNERS}
        same_before = every_before = trials = zones = 0
        for seed in range(SEEDS):
            order = np.random.default_rng([seed, size]).permutation(len(seen)).tolist()
            model = begin([seen[index] for index in order[:size]])
            rest = [seen[index][0].labelled for index in order[size:]]
            found = [found_labels(model, page) for page in rest]
            wrong = [at for at, page in enumerate(rest) if tuple(page.labels) != found[at]]
            for at in wrong[:MOST_TRIALS]:
                errors = confused(rest[at].labels, found[at])
                others = [other for other in range(len(rest)) if other != at][:MOST_NEXT]
                truth = [rest[other].labels for other in others]
                before = repeated(errors, truth, [found[other] for other in others])
                trials += 1
                same_before += before[0]
                every_before += before[1]
                zones += sum(map(len, truth))
                for learner in LEARNERS:
                    taught = learn_page(model, rest[at], learner)
                    after = repeated(errors, truth, [found_labels(taught, rest[other]) for other in others])
                    same[learner] += after[0]
                    every[learner] += after[1]
        result[str(size)] = {
            "trials": trials,
            "zones": zones,
            "same_before": same_before,
            "same_after": same,
            "all_before": every_before,
            "all_after": every,
        }
    return result


def _row(name: str, rows: Sequence[Result]) -> list[object]:
    total = {key: sum(row[key] for row in rows) for key in ("trials", "zones", "same_before", "all_before")}
    cells: list[object] = [name, total["trials"], share(total["same_before"], total["zones"])]
    for learner in LEARNERS:
        cells.append(share(sum(row["same_after"][learner] for row in rows), total["same_before"]))
    cells.append(share(total["all_before"], total["zones"]))
    for learner in LEARNERS:
        cells.append(share(sum(row["all_after"][learner] for row in rows), total["all_before"]))
    return cells


def _report(results: Results) -> str:
    rows = [[*_row(job, list(result.values()))] for job, result in results.items() if result]
    for size in map(str, SIZES):
        chosen = [result[size] for result in results.values() if size in result]
        if chosen:
            rows.append(_row(f"all sets, models of {size}", chosen))
    every = [row for result in results.values() for row in result.values()]
    rows.append(_row("all sets", every))
    for size in map(str, SIZES):
        details = [
            _row(f"{job}, {size}", [result[size]]) for job, result in results.items() if size in result
        ]
        rows += details
    head = (
        *("set", "pages", "same err %"),
        *(f"left %: {learner}" for learner in LEARNERS),
        *("all err %", *(f"all left %: {learner}" for learner in LEARNERS)),
    )
    title = (
        f"One correction: errors with the same true and found label on up to {MOST_NEXT} next pages, percent of zones, "
        "and what of them is left after feedback on one page; then all errors"
    )
    left = left_percent(results)
    required = [
        [
            f"{learner}: at most half of the same errors left, all sets",
            left[learner],
            verdict(left[learner] <= 50),
        ]
        for learner in LEARNERS
    ]
    return "\n\n".join([table(title, head, rows), table("Required", ("what", "left %", "met"), required)])


def left_percent(results: Results) -> dict[str, float]:
    """Of the same errors before, over all sets and sizes, by learner."""
    rows = [row for result in results.values() for row in result.values()]
    before = sum(row["same_before"] for row in rows)
    return {learner: share(sum(row["same_after"][learner] for row in rows), before) for learner in LEARNERS}


def _figures(results: Results) -> Figures:
    return {
        f"once, {learner}": {"same_left_percent": left} for learner, left in left_percent(results).items()
    }


ONCE = Part(_jobs, _measure, _report, _figures)

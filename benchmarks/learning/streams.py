"""Pages of a class one after another: each is recognized, then a person says what is right; and classes that change."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from benchmarks.common.baseline import Figures
from benchmarks.common.plots import draw_panels
from benchmarks.layout.learning_curve import TEN
from benchmarks.layout.part import Part, Result, Results, share, table
from benchmarks.layout.specimens import Specimen
from benchmarks.layout.truth import TITLES_REAL
from benchmarks.learning.pages import ANEW, COLOURS, LEARNERS, NONE, begin, chosen_sets, see
from services.layout.learning.initialization import Views
from services.layout.learning.learners import learn_page, wrong_zones
from services.layout.model.learning_model import LearningModel
from services.layout.page import Page

SETS = (
    *TITLES_REAL,
    "letters/real",
    "letters/real" + TEN,
    "letters/made",
    "letters/made memo",
    "letters/made fax",
)
DRIFTS = (
    ("letters/made", "letters/real"),
    ("letters/real", "letters/made"),
    ("titles/real/jose", "titles/real/juliacon"),
    ("titles/real/juliacon", "titles/real/rescience"),
)
"""A class whose pages are of the first kind, and then of the second."""
FEW = (1, 3)
SEEDS = 3
WINDOW = 10
MOST_PAGES = 40
DRIFT_SAMPLES, DRIFT_PAGES = 3, 20
"""Pages of each kind; as many as the smallest publication leaves."""
ANEW_EVERY = 5
METHODS = (NONE, *LEARNERS, ANEW)


def _few(size: int) -> str:
    return f"{size} sample{'s' * (size > 1)}"


def _then(kinds: tuple[str, str]) -> str:
    return " then ".join(kinds)


def _jobs(specimens: Sequence[Specimen]) -> list[str]:
    names = [name for name, pages in chosen_sets(specimens, SETS).items() if len(pages) > max(FEW)]
    streams = [f"{name} | {_few(size)}" for name in names for size in FEW]
    return [*streams, *(f"{_then(kinds)} | drift" for kinds in DRIFTS if set(kinds) <= set(names))]


def follow(samples: Sequence[Views], stream: Sequence[Views], method: str) -> list[int]:
    """Wrong zones of each page of the stream as it comes, before its right labels are told by feedback.

    `method` is a learner, `NONE` (the model of the samples stays), or `ANEW`: after every `ANEW_EVERY` pages the
    model is initialized from all that have come.
    """
    model = begin(samples)
    errors: list[int] = []
    for number, views in enumerate(stream, start=1):
        page = views[0].labelled
        errors.append(wrong_zones(model, page))
        model = _after(model, samples, stream[:number], method)
    return errors


def _after(
    model: LearningModel, samples: Sequence[Views], come: Sequence[Views], method: str
) -> LearningModel:
    if method == ANEW:
        return begin([*samples, *come]) if len(come) % ANEW_EVERY == 0 else model
    for learner in LEARNERS:
        if learner == method:
            return learn_page(model, come[-1][0].labelled, learner)
    return model


def _measure(job: str, specimens: Sequence[Specimen]) -> Result:
    what, _, how = job.partition(" | ")
    draw: Callable[[np.random.Generator], tuple[list[Page], list[Page]]]
    if how == "drift":
        kinds = next(kinds for kinds in DRIFTS if _then(kinds) == what)
        sets = chosen_sets(specimens, kinds)

        def draw(rng: np.random.Generator) -> tuple[list[Page], list[Page]]:
            before, after = (
                [sets[kind][index] for index in rng.permutation(len(sets[kind]))] for kind in kinds
            )
            before = before[: DRIFT_SAMPLES + DRIFT_PAGES]
            return before[:DRIFT_SAMPLES], [*before[DRIFT_SAMPLES:], *after[:DRIFT_PAGES]]
    else:
        pages, size = chosen_sets(specimens, (what,))[what], int(how.split()[0])

        def draw(rng: np.random.Generator) -> tuple[list[Page], list[Page]]:
            order = [pages[index] for index in rng.permutation(len(pages))]
            return order[:size], order[size : size + MOST_PAGES]

    errors: dict[str, list[list[int]]] = {method: [] for method in METHODS}
    zones: list[list[int]] = []
    for seed in range(SEEDS):
        samples, stream = (see(chosen) for chosen in draw(np.random.default_rng([seed, len(what)])))
        zones.append([len(views[0].labelled.labels) for views in stream])
        for method, rows in errors.items():
            rows.append(follow(samples, stream, method))
    size = DRIFT_PAGES if how == "drift" else WINDOW
    return {
        "pages": len(zones[0]),
        "windows": {method: in_windows(rows, zones, min(size, WINDOW)) for method, rows in errors.items()},
        "error_percent": {
            method: share(sum(map(sum, rows)), sum(map(sum, zones))) for method, rows in errors.items()
        },
    }


def in_windows(errors: Sequence[Sequence[int]], zones: Sequence[Sequence[int]], size: int) -> list[float]:
    """Error, percent, of every `size` pages of the streams together; what is left at the end joins the last window."""
    pages = min(map(len, zones))
    starts = [start for start in range(0, pages, size) if start == 0 or pages - start >= size / 2]
    ends = [*starts[1:], pages]
    return [
        share(sum(sum(row[a:b]) for row in errors), sum(sum(row[a:b]) for row in zones))
        for a, b in zip(starts, ends, strict=True)
    ]


def _report(results: Results) -> str:
    rows = []
    most = max((len(result["windows"][NONE]) for result in results.values()), default=0)
    for job, result in results.items():
        for method in METHODS:
            windows = result["windows"][method]
            padded = [*windows, *([None] * (most - len(windows)))]
            rows.append([f"{job} | {method}", result["pages"], *padded, result["error_percent"][method]])
    head = (
        "stream | begins with | learner",
        "pages",
        *(f"pages {k * WINDOW + 1}-" for k in range(most)),
        "all",
    )
    title = (
        f"Error of zones, percent, before each page's feedback, by {WINDOW} pages, {SEEDS} orders "
        f"(drift: {DRIFT_PAGES} pages of each kind, from {DRIFT_SAMPLES} samples of the first)"
    )
    return "\n".join([table(title, head, rows), "", _compared(results)])


def _compared(results: Results) -> str:
    """All streams together, each the same weight."""
    rows = []
    for how in (*map(_few, FEW), "drift"):
        chosen = [result for job, result in results.items() if job.endswith(f" | {how}")]
        if chosen:
            means = [float(np.mean([each["error_percent"][method] for each in chosen])) for method in METHODS]
            lasts = [float(np.mean([each["windows"][method][-1] for each in chosen])) for method in METHODS]
            rows += [[f"{how}, all pages", *means], [f"{how}, last window", *lasts]]
    return table("Mean error of the streams", ("begins with", *METHODS), rows)


def draw_streams(path: Path, results: Results) -> None:
    """One panel a stream, of those that begin with least."""
    panels = {
        job.replace(" | ", "\nfrom ").replace("from drift", "one class"): {
            method: ([(k + 0.5) * WINDOW for k in range(len(values))], values)
            for method, values in result["windows"].items()
        }
        for job, result in results.items()
        if not job.endswith(f" | {_few(max(FEW))}")
    }
    draw_panels(path, panels, COLOURS, "pages that came before", "zones with a wrong label, percent")


def _figures(results: Results) -> Figures:
    return {
        f"stream, {job}, {method}": {"stream_error_percent": result["error_percent"][method]}
        for job, result in results.items()
        for method in LEARNERS
    }


STREAMS = Part(_jobs, _measure, _report, _figures)

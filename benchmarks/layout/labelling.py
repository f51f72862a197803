"""Labels of zones, leave one out with initialization only: title pages (5.6.1) and letters (5.6.2)."""

from collections.abc import Sequence
from dataclasses import replace

from benchmarks.common.baseline import Figures
from benchmarks.layout.part import Part, Result, Results, share, table
from benchmarks.layout.protocols import (
    Labels,
    component_counts,
    confusions,
    label_by_graph,
    label_in_folds,
    page_labels,
    wrong_zones,
)
from benchmarks.layout.specimens import (
    TRIALS,
    Specimen,
    Trial,
    area_labelled,
    of_sources,
    with_ten_components,
)
from benchmarks.layout.truth import TITLES_MADE, TITLES_REAL
from services.layout.page import Page

UNIFIED = {
    "title page, real": TITLES_REAL,
    "title page, made": TITLES_MADE,
    "title page, all": (*TITLES_REAL, *TITLES_MADE),
}
"""The unified models. Made pages repeat texts of real ones, so that on all pages content is partly known."""
MOST_FOLDS = 90
"""True zones: leave one out, but for the unified model of all pages."""
OWN_FOLDS = 10
"""The trials on own zones, whose pages have more zones: leave one out of small sets only, which costs a fourth."""

DISSERTATION_TITLES = """dissertation (5.6.1): 85 pages, 1347 zones; of Figures 5.7 and 5.10 the text says
that the unified model's error drops by about 30 % in three rounds, and that publications are similar"""
DISSERTATION_LETTERS = """dissertation (5.6.2): 116 letters, 1389 zones; at round 0 about 500 zones are wrong (36 %),
below 200 after 100 rounds; Table 5.3 is of the trained model"""
TABLE_5_3: dict[str, tuple[int, int]] = {
    "receiver": (88, 91),
    "subject": (55, 60),
    "date": (89, 91),
    "salutation": (93, 93),
    "body": (96, 90),
    "signature": (82, 82),
    "enclosure": (59, 48),
    "typistinit": (56, 54),
    "ps": (53, 43),
    "cc": (0, 0),
    "(unlabelled)": (84, 93),
    "overall": (87, 87),
}
"""Recall and precision, percent, as printed."""
LETTER_SETS = ("letters/real", "letters/made")


def _title_jobs(specimens: Sequence[Specimen]) -> list[str]:
    sources = {specimen.source for specimen in specimens}
    sets = {**UNIFIED, **{source: (source,) for source in (*TITLES_REAL, *TITLES_MADE)}}
    return [name for name, chosen in sets.items() if sources.intersection(chosen)]


def _measure_titles(job: str, specimens: Sequence[Specimen]) -> Result:
    chosen = of_sources(specimens, UNIFIED.get(job, (job,)))
    most = MOST_FOLDS if len(chosen) <= MOST_FOLDS else 10
    truth = [specimen.true for specimen in chosen]
    names = [specimen.name for specimen in chosen]
    return {
        trial: _figures_of(truth, pages, found, names)
        for trial, (pages, found) in _trials(truth, [each.page("own") for each in chosen], most).items()
    }


def _trials(
    true: Sequence[Page], own: Sequence[Page], most: int
) -> dict[Trial, tuple[Sequence[Page], list[Labels]]]:
    """For each trial the pages that were tested, and the labels found."""
    both = [
        (page, found if any(zone.label for zone in found.zones) else None)
        for page, found in zip(true, own, strict=True)
    ]
    by_true, across = label_in_folds(label_by_graph, [(page, None) for page in true], most, true, own)
    [by_own] = label_in_folds(label_by_graph, [(page, None) for page in own], OWN_FOLDS, own)
    [taught] = label_in_folds(label_by_graph, both, OWN_FOLDS, own)
    return {
        "true zones": (true, by_true),
        "own zones": (own, by_own),
        "true to own": (own, across),
        "taught to own": (own, taught),
    }


def _figures_of(
    truth: Sequence[Page], tested: Sequence[Page], found: Sequence[Labels], names: Sequence[str]
) -> Result:
    """Figures of one trial: errors against the labels of `tested`, and of the true zones what is labelled rightly."""
    labels = [page_labels(page) for page in tested]
    wrong, zones = wrong_zones(labels, found)
    by_page = {
        name: sum(a != b for a, b in zip(true, given, strict=True))
        for name, true, given in zip(names, labels, found, strict=True)
    }
    areas = [
        area_labelled(page, _with_labels(other, given))
        for page, other, given in zip(truth, tested, found, strict=True)
    ]
    worst = sorted(by_page, key=by_page.__getitem__, reverse=True)[:3]
    return {
        "pages": len(tested),
        "zones": zones,
        "wrong": wrong,
        "error_percent": share(wrong, zones),
        "perfect_percent": share(sum(not errors for errors in by_page.values()), len(by_page)),
        "area_percent": share(sum(area[0] for area in areas), sum(area[1] for area in areas)),
        "found_percent": share(sum(area[2] for area in areas), sum(area[3] for area in areas)),
        "confused": [[true, given, n] for (true, given), n in confusions(labels, found).most_common(4)],
        "worst": {name: by_page[name] for name in worst if by_page[name]},
    }


def _with_labels(page: Page, labels: Labels) -> Page:
    zones = tuple(replace(zone, label=label) for zone, label in zip(page.zones, labels, strict=True))
    return replace(page, zones=zones)


def _report_titles(results: Results) -> str:
    rows, remarks = [], []
    for job, result in results.items():
        true, own, across, taught = (result[trial] for trial in TRIALS)
        rows.append(
            [
                *(job, true["pages"], true["zones"], true["error_percent"], true["perfect_percent"]),
                own["zones"],
                *(
                    figures[name]
                    for figures in (own, across, taught)
                    for name in ("error_percent", "area_percent", "found_percent")
                ),
            ]
        )
        for trial in TRIALS:
            remarks.append(f"  {job}, {trial}: {_confused(result[trial])}")
    head = (
        *("model", "pages", "zones", "error %", "perfect %", "own zones", "own>own", "area %", "found %"),
        *("true>own", "area %", "found %", "both>own", "area %", "found %"),
    )
    return "\n".join(
        [
            table(
                f"Title pages, 5.6.1: round 0, leave one out (all: 10 folds; own zones: {OWN_FOLDS} folds at most)",
                head,
                rows,
            ),
            DISSERTATION_TITLES,
            "confused (true > found, zones), and pages with the most errors:",
            *remarks,
        ]
    )


def _confused(figures: Result) -> str:
    pairs = ", ".join(f"{true} > {given} {count}" for true, given, count in figures["confused"])
    pages = ", ".join(f"{name} {count}" for name, count in figures["worst"].items())
    return f"{pairs or 'nothing'} | {pages or 'none'}"


def _title_figures(results: Results) -> Figures:
    return {
        f"{job}, {trial}": {
            name: result[trial][name] for name in ("error_percent", "area_percent", "found_percent")
        }
        for job, result in results.items()
        for trial in TRIALS
    }


TITLES = Part(_title_jobs, _measure_titles, _report_titles, _title_figures)


def _letter_jobs(specimens: Sequence[Specimen]) -> list[str]:
    return [source for source in LETTER_SETS if of_sources(specimens, (source,))]


def _measure_letters(job: str, specimens: Sequence[Specimen]) -> Result:
    letters = [specimen for specimen in of_sources(specimens, (job,)) if specimen.class_name == "letter"]
    result: Result = {}
    true = [with_ten_components(letter.true) for letter in letters]
    own = [with_ten_components(letter.page("own")) for letter in letters]
    for trial, (pages, found) in _trials(true, own, MOST_FOLDS).items():
        labels = [page_labels(page) for page in pages]
        wrong, zones = wrong_zones(labels, found)
        counts = component_counts(labels, found)
        result[trial] = {
            "pages": len(pages),
            "zones": zones,
            "error_percent": share(wrong, zones),
            "components": {
                label or "(unlabelled)": [each.true, each.found, each.correct]
                for label, each in sorted(counts.items(), key=lambda item: item[0] or "~")
            },
        }
    fine = [specimen.true for specimen in letters]
    [found] = label_in_folds(label_by_graph, [(page, None) for page in fine], MOST_FOLDS, fine)
    labels = [page_labels(page) for page in fine]
    mapped = [
        page_labels(with_ten_components(_with_labels(page, given)))
        for page, given in zip(fine, found, strict=True)
    ]
    result["all labels"] = {
        "error_percent": share(*wrong_zones(labels, found)),
        "ten_components_error_percent": share(
            *wrong_zones([page_labels(with_ten_components(page)) for page in fine], mapped)
        ),
        "confused": [[a, b, count] for (a, b), count in confusions(labels, found).most_common(8)],
    }
    return result


def _report_letters(results: Results) -> str:
    parts = []
    for job, result in results.items():
        for trial in TRIALS:
            parts.append(_table_5_3(f"Letters, 5.6.2 (Table 5.3): {job}, {trial}", result[trial]))
        fine = result["all labels"]
        pairs = ", ".join(f"{true} > {given} {count}" for true, given, count in fine["confused"])
        parts.append(
            f"{job}, all labels of the data: error {fine['error_percent']:.2f} %; by these, ten components: "
            f"{fine['ten_components_error_percent']:.2f} %\n  confused: {pairs}"
        )
    return "\n\n".join([*parts, DISSERTATION_LETTERS])


def _table_5_3(title: str, figures: Result) -> str:
    components = figures["components"]
    rows = []
    for name, (recall, precision) in TABLE_5_3.items():
        if name == "overall":
            correct = sum(counts[2] for counts in components.values())
            true, found = figures["zones"], figures["zones"]
        else:
            true, found, correct = components.get(name, (0, 0, 0))
        rows.append(
            [name, true, found, correct, share(correct, true), share(correct, found), recall, precision]
        )
    head = ("component", "true", "found", "correct", "recall %", "precision %", "5.3 recall", "5.3 precision")
    note = f"{figures['pages']} letters, error {figures['error_percent']:.2f} %"
    return f"{table(title, head, rows)}\n{note}"


def _letter_figures(results: Results) -> Figures:
    return {
        f"{job}, {trial}": {"error_percent": result[trial]["error_percent"]}
        for job, result in results.items()
        for trial in TRIALS
    }


LETTERS = Part(_letter_jobs, _measure_letters, _report_letters, _letter_figures)

"""Error against the number of samples: the layout graph model and a random forest on the same zones and attributes."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks.common.baseline import Figures
from benchmarks.layout.part import Part, Result, Results, table
from benchmarks.layout.peers import TREES, ForestLabels
from benchmarks.layout.protocols import (
    Labeller,
    Labels,
    draws,
    error_percent,
    floor_percent,
    label_by_graph,
    label_in_folds,
    page_labels,
)
from benchmarks.layout.specimens import Lesson, Specimen, of_sources, with_ten_components
from benchmarks.layout.truth import TITLES_MADE, TITLES_REAL
from services.layout.page import Page

SIZES = (1, 2, 3, 5, 10, 20)
COMPARED = ("1", "3", "5", "10", "all")
DRAWS = 4
FOLDS = 10
OTHER_PAGES = {
    "titles/real/jose": (2.3, 0.3),
    "titles/real/juliacon": (12.7, 4.3),
    "titles/real/rescience": (2.7, 1.3),
    "letters/real": (28.8, 10.7),
}
"""Such a forest's error, percent, by 5 samples and all, on other pages of these classes than the shared ones."""

TEN = ", ten components"
_OWN = ", own zones"


def labelled_sets(specimens: Sequence[Specimen]) -> dict[str, list[Page]]:
    """Labelled pages by the name of their set; where a set holds several classes, by class."""

    def pages(source: str, class_name: str | None = None) -> list[Page]:
        return [
            specimen.true
            for specimen in of_sources(specimens, (source,))
            if class_name in (None, specimen.class_name)
        ]

    sets = {source: pages(source) for source in TITLES_REAL}
    for source in ("letters/real", "letters/made"):
        sets[source] = pages(source, "letter")
        sets[source + TEN] = [with_ten_components(page) for page in sets[source]]
    for name in ("memo", "fax"):
        sets[f"letters/made {name}"] = pages("letters/made", name)
    sets.update({source: pages(source) for source in TITLES_MADE})
    for source in (*TITLES_REAL, "letters/real"):
        sets[source + _OWN] = [
            specimen.own for specimen in of_sources(specimens, (source,)) if specimen.own is not None
        ]
    return {name: members for name, members in sets.items() if len(members) > 1}


def _jobs(specimens: Sequence[Specimen]) -> list[str]:
    return list(labelled_sets(specimens))


def label_by_forest(samples: Sequence[Lesson], pages: Sequence[Page]) -> list[Labels]:
    """Labels by a random forest of the samples."""
    return ForestLabels([page for page, _ in samples]).label(pages)


def _measure(job: str, specimens: Sequence[Specimen]) -> Result:
    pages = labelled_sets(specimens)[job]
    result: Result = {}
    for size in SIZES:
        if size >= len(pages):
            break
        errors: dict[str, list[float]] = {"graph": [], "forest": [], "floor": []}
        for drawn in draws(len(pages), size, DRAWS, seed=5):
            samples = [pages[at] for at in drawn]
            tested = [page for at, page in enumerate(pages) if at not in drawn]
            truth = [page_labels(page) for page in tested]
            errors["graph"].append(
                error_percent(truth, label_by_graph([(page, None) for page in samples], tested))
            )
            errors["forest"].append(
                error_percent(truth, label_by_forest([(page, None) for page in samples], tested))
            )
            errors["floor"].append(floor_percent(samples, tested))
        result[str(size)] = errors
    truth = [page_labels(page) for page in pages]

    def in_folds(labeller: Labeller) -> float:
        return error_percent(
            truth, label_in_folds(labeller, [(page, None) for page in pages], FOLDS, pages)[0]
        )

    result["all"] = {"graph": [in_folds(label_by_graph)], "forest": [in_folds(label_by_forest)]}
    result["pages"] = len(pages)
    return result


def _mean(result: Result, size: str, who: str) -> float:
    values = result.get(size, {}).get(who, [])
    return float(np.mean(values)) if values else float("nan")


def _report(results: Results) -> str:
    rows, worse = [], []
    for job, result in results.items():
        cells = []
        for size in COMPARED:
            ours, theirs = (_mean(result, size, who) for who in ("graph", "forest"))
            cells.append("-" if np.isnan(ours) else f"{ours:.2f} / {theirs:.2f}")
            if ours > theirs:
                worse.append(f"{job}, {size} samples: {ours:.2f} > {theirs:.2f}")
        floors = " ".join(
            f"{_mean(result, size, 'floor'):.1f}" for size in ("1", "3", "5", "10") if size in result
        )
        other = OTHER_PAGES.get(job)
        rows.append([job, result["pages"], *cells, floors, f"{other[0]} {other[1]}" if other else "-"])
    head = (
        "set",
        "pages",
        *(f"{size} samples" for size in COMPARED),
        "floor 1 3 5 10",
        "forest, other pages 5 all",
    )
    compared = table(
        f"Error of zones, percent, graph / forest ({TREES} trees), mean of {DRAWS} draws; all: {FOLDS} folds",
        head,
        rows,
    )
    curve = []
    for job, result in results.items():
        for who in ("graph", "forest"):
            means = [_spread(result, str(size), who) for size in SIZES]
            curve.append([f"{job}, {who}", *means, _spread(result, "all", who)])
    learning = table(
        "Learning curve: error of zones, percent, mean +- standard deviation over the draws",
        ("set", *(str(size) for size in SIZES), "all"),
        curve,
    )
    verdict = f"graph at or below the forest everywhere: {'NO' if worse else 'yes'}"
    return "\n".join([compared, verdict, *(f"  {line}" for line in worse), "", learning])


def _spread(result: Result, size: str, who: str) -> str:
    values = result.get(size, {}).get(who, [])
    if not values:
        return "-"
    return f"{np.mean(values):.1f}+-{np.std(values):.1f}" if len(values) > 1 else f"{values[0]:.1f}"


def draw_curves(path: Path, results: Results) -> None:
    """One panel a set: error against the number of samples, with the spread over the draws."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    columns = 4
    rows = -(-len(results) // columns)
    figure, axes = pyplot.subplots(
        rows, columns, figsize=(4 * columns, 3 * rows), squeeze=False, layout="constrained"
    )
    for axis in axes.flat[len(results) :]:
        axis.set_axis_off()
    for axis, (job, result) in zip(axes.flat, results.items(), strict=False):
        sizes = [size for size in SIZES if str(size) in result]
        for who, colour in (("graph", "#4878a8"), ("forest", "#c03030"), ("floor", "#888888")):
            values = [result[str(size)][who] for size in sizes]
            means, spreads = [np.mean(each) for each in values], [np.std(each) for each in values]
            if who == "floor":
                axis.plot(sizes, means, label="label not seen", color=colour, linestyle=":")
                continue
            axis.errorbar(sizes, means, spreads, label=who, color=colour, capsize=3, marker="o")
            axis.axhline(result["all"][who][0], color=colour, linestyle="--", linewidth=0.8)
        axis.set_xscale("log")
        axis.set_xticks(sizes, [str(size) for size in sizes])
        axis.minorticks_off()
        axis.set_ylim(bottom=0)
        axis.set_title(f"{job} ({result['pages']})", fontsize=9)
        axis.legend(fontsize=7)
    figure.supxlabel("samples (dashed: all)")
    figure.supylabel("zones with a wrong label, percent")
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=90)
    pyplot.close(figure)


def _figures(results: Results) -> Figures:
    return {
        f"{job}, {size} samples": {"learning_error_percent": _mean(result, size, "graph")}
        for job, result in results.items()
        for size in (*map(str, SIZES), "all")
        if size in result
    }


LEARNING = Part(_jobs, _measure, _report, _figures)

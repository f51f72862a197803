"""Plot of discovery: new classes by pages, and what parts right from wrong proposals."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from services.layout.discovery.merging import LEAST_FIT
from services.layout.discovery.splitting import LEAST_GAIN


def draw_discovery(path: Path, results: Mapping[str, Any]) -> None:
    """Purity and completeness of new classes, fits of halves and of different classes, gains of parts."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(1, 3, figsize=(14, 4))
    by_pages = results["new"]["by_pages"]
    pages = [int(each) for each in by_pages]
    for kind, style in (("one", "-"), ("several", "--")):
        for what, colour in (("purity_percent", "#4878a8"), ("completeness_percent", "#c03030")):
            values = [by_pages[each][kind][what] for each in by_pages]
            axes[0].plot(
                pages, values, style, color=colour, marker="o", label=f"{what.split('_')[0]}, {kind} new"
            )
    axes[0].set_xlabel("pages of a new class")
    axes[0].set_ylabel("percent")
    axes[0].set_ylim(0, 102)
    axes[0].set_title("new classes among unknown pages")
    merges, splits = results["merges"].values(), results["splits"].values()
    _compare(
        axes[1],
        {what: [row["fit"] for size in merges for row in size[what]] for what in ("halves", "different")},
        LEAST_FIT,
        "fit of each other's samples: merge above",
    )
    _compare(
        axes[2],
        {what: [row["gain"] for size in splits for row in size[what]] for what in ("unions", "alone")},
        LEAST_GAIN,
        "gain of two models over one: split above",
    )
    for axis in axes:
        axis.legend(fontsize=8)
    figure.tight_layout()
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=100)
    pyplot.close(figure)


def _compare(axis: Any, values: Mapping[str, list[float]], threshold: float, title: str) -> None:
    for (name, each), colour in zip(values.items(), ("#4878a8", "#c03030"), strict=True):
        finite = [value for value in each if math.isfinite(value)]
        axis.hist(finite, bins=30, density=True, alpha=0.6, color=colour, label=f"{name} ({len(finite)})")
    axis.axvline(threshold, color="black", linestyle="--")
    axis.set_title(title, fontsize=10)

"""New classes among unknown pages, classes to merge and classes to split: what is found, and what is proposed wrongly.

    python -m benchmarks layout_discovery [--no-reading] [--limit N]

Each of the eleven classes is withheld in turn; two models are made of halves of one class; one model of two classes.
"""

import sys
from collections.abc import Iterable, Mapping, Sequence
from itertools import combinations
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.common.figures import plain_values, write_json
from benchmarks.common.options import make_parser
from benchmarks.common.places import MEMORY, OUTPUT
from benchmarks.layout.discovery_plot import draw_discovery
from benchmarks.layout.part import share, table
from benchmarks.layout.protocols import make_model, recognized
from benchmarks.layout.recognition import ReadingOptions, segment_all
from benchmarks.layout.specimens import ZONES, Specimen, Zones, by_class, lessons, load_specimens
from benchmarks.layout.truth import layout_folder
from services.layout.discovery.class_samples import ClassSamples, gather_samples, held_out_costs
from services.layout.discovery.groups import PageGroup, group_pages
from services.layout.discovery.merging import MergeProposal, are_indistinguishable, compare_classes
from services.layout.discovery.splitting import compare_parts, propose_split
from services.layout.graph.layout_graph import LayoutGraph, build_graph
from services.layout.page import Page
from services.layout.pipeline import content_features

PAGES = (2, 3, 5, 10, 20)
"""Of a withheld class, among unknown pages."""
STRANGERS = 2
"""Pages of every other class among them."""
AT_ONCE = 4
"""New classes that come together."""
DRAWS = 3
HALVES = (3, 5, 10)
UNIONS = (8, 12, 24)
LEARNED: dict[Zones, tuple[Zones, ...]] = {"true": ("true",), "own": ("true", "own")}
"""What models learn of samples, and what the pages are that they are tested on."""
Samples = Mapping[str, Sequence[tuple[Page, Page | None]]]


Results = dict[str, Any]


class Groups:
    """What was proposed of unknown pages, over draws."""

    def __init__(self) -> None:
        self.rows: list[Results] = []

    def add(self, groups: Sequence[PageGroup], true: Sequence[str], new: Iterable[str]) -> None:
        """`true` are classes of the pages; `new` those that were withheld."""
        named = [[true[page] for page in group.pages] for group in groups]
        main = [max(set(names), key=names.count) for names in named]
        pure = sum(names.count(first) for names, first in zip(named, main, strict=True))
        for name in new:
            largest = max(
                (n.count(name) for n, first in zip(named, main, strict=True) if first == name), default=0
            )
            self.rows.append(
                {
                    "class": name,
                    "grouped": sum(map(len, named)),
                    "pure": pure,
                    "found": largest >= 3,
                    "in_largest": largest,
                    "pages": true.count(name),
                }
            )

    def figures(self, name: str | None = None) -> dict[str, float]:
        rows = [row for row in self.rows if name is None or name == row["class"]]
        total = {key: sum(row[key] for row in rows) for key in ("grouped", "pure", "in_largest", "pages")}
        return {
            "purity_percent": share(total["pure"], total["grouped"]),
            "completeness_percent": share(total["in_largest"], total["pages"]),
            "found_percent": share(sum(row["found"] for row in rows), len(rows)),
        }


def measure_new_classes(classes: Mapping[str, Sequence[Specimen]], zones: Zones) -> Results:
    """Groups of unknown pages: one class or several withheld, beside pages of all others."""
    names = content_features().names
    graphs = {name: [build_graph(each.page(zones), names) for each in of] for name, of in classes.items()}
    refused = _refused(classes, zones)
    results: Results = {"refused_percent": {}, "by_pages": {}, "by_class": {}}
    for name, told in refused.items():
        results["refused_percent"][name] = share(sum(told), len(told))
    for pages in PAGES:
        alone, together = Groups(), Groups()
        for draw in range(DRAWS):
            rng = np.random.default_rng([draw, pages])
            for name in classes:
                unknown = [graph for graph, out in zip(graphs[name], refused[name], strict=True) if out]
                if unknown:
                    _draw({**graphs, name: unknown}, [name], pages, rng, alone)
            new = rng.choice(sorted(classes), min(AT_ONCE, len(classes)), replace=False).tolist()
            _draw(graphs, new, pages, rng, together)
        results["by_pages"][str(pages)] = {"one": alone.figures(), "several": together.figures()}
        results["by_class"][str(pages)] = {name: alone.figures(name) for name in classes}
    return results


def _draw(
    graphs: Mapping[str, Sequence[LayoutGraph]],
    new: Sequence[str],
    pages: int,
    rng: np.random.Generator,
    into: Groups,
) -> None:
    ring: list[LayoutGraph] = []
    true: list[str] = []
    for name, of in graphs.items():
        chosen = rng.permutation(len(of))[: pages if name in new else STRANGERS]
        ring += [of[at] for at in chosen]
        true += [name] * len(chosen)
    into.add(group_pages(ring), true, new)


def _refused(classes: Mapping[str, Sequence[Specimen]], zones: Zones) -> dict[str, list[bool]]:
    """Which pages of each class fit none of the others' models."""
    models = {name: make_model(name, lessons(members, LEARNED[zones])) for name, members in classes.items()}
    told = {}
    for name, members in classes.items():
        others = {other: model for other, model in models.items() if other != name}
        told[name] = [recognized(each.page(zones), others).chosen is None for each in members]
    return told


def _gather(name: str, samples: Sequence[tuple[Page, Page | None]], chosen: NDArray[np.intp]) -> ClassSamples:
    return gather_samples(name, [samples[at] for at in chosen], content_features().names)[0]


def measure_merges(samples: Samples) -> Results:
    """Halves of one class, and all pairs of different ones, by the number of samples of each."""
    results: Results = {}
    for size in HALVES:
        halves, pairs = [], []
        for draw in range(DRAWS):
            rng = np.random.default_rng([draw, size])
            made: dict[str, tuple[ClassSamples, NDArray[np.float64]]] = {}
            for name, pages in samples.items():
                order, count = rng.permutation(len(pages)), min(size, len(pages) // 2)
                one, other = (_gather(name, pages, order[at : at + count]) for at in (0, count))
                made[name] = one, held_out_costs(one)
                halves.append(_told(name, compare_classes(one, other, made[name][1], held_out_costs(other))))
            for first, second in combinations(made, 2):
                (one, its), (other, others) = made[first], made[second]
                pairs.append(_told(f"{first}/{second}", compare_classes(one, other, its, others)))
        results[str(size)] = {"halves": halves, "different": pairs}
    return results


def _told(name: str, proposal: MergeProposal) -> Results:
    return {
        "name": name,
        "fit": proposal.fit,
        "unsure": proposal.unsure,
        "agreement": proposal.agreement,
        "proposed": are_indistinguishable(proposal),
    }


def measure_splits(samples: Samples) -> Results:
    """Classes alone and unions of two, by the number of samples together."""
    results: Results = {}
    for size in UNIONS:
        alone, unions = [], []
        for draw in range(DRAWS):
            rng = np.random.default_rng([draw, size])
            for name, pages in samples.items():
                if len(pages) >= size:
                    alone.append(_split(name, _gather(name, pages, rng.permutation(len(pages))[:size])))
            for pair in combinations(samples, 2):
                drawn = {name: rng.permutation(len(samples[name]))[: size // 2] for name in pair}
                both = [samples[name][at] for name in pair for at in drawn[name]]
                gathered = _gather("both", both, np.arange(len(both)))
                unions.append(_split("/".join(pair), gathered, len(drawn[pair[0]])))
        results[str(size)] = {"alone": alone, "unions": unions}
    return results


def _split(name: str, samples: ClassSamples, first: int = 0) -> Results:
    """`first` of the samples are of the first class."""
    compared, proposal = compare_parts(samples), propose_split(samples)
    count = len(samples.samples)
    return {
        "name": name,
        "gain": float("nan") if compared is None else compared.gain,
        "better": float("nan") if compared is None else compared.better,
        "proposed": proposal is not None,
        "pure": proposal is not None
        and set(proposal.parts) == {tuple(range(first)), tuple(range(first, count))},
    }


def report(zones: str, found: Results) -> str:
    """Tables of one kind of zones."""
    new, parts = found["new"], []
    head: tuple[str, ...] = (
        "pages of a new class",
        "purity %",
        "complete %",
        "found %",
        "4 at once: purity %",
        "complete %",
    )
    rows = [
        [
            pages,
            *row["one"].values(),
            row["several"]["purity_percent"],
            row["several"]["completeness_percent"],
        ]
        for pages, row in new["by_pages"].items()
    ]
    parts.append(table(f"New classes among unknown pages, {zones} zones", head, rows))
    most = str(PAGES[-2])
    rows = [
        [name, new["refused_percent"][name], *row.values()] for name, row in new["by_class"][most].items()
    ]
    head = ("class", "refused %", "purity %", "complete %", "found %")
    parts.append(table(f"By class, {most} pages", head, rows))
    rows = []
    for size, row in found["merges"].items():
        rows.append(
            [
                size,
                *(_proposed(row[what]) for what in ("halves", "different")),
                _wrong(row["different"], True),
            ]
        )
    head = ("samples of each", "halves: proposed %", "different: proposed %", "wrongly")
    parts.append(table("Merging", head, rows))
    rows = [
        [
            size,
            _proposed(row["alone"]),
            _proposed(row["unions"]),
            _pure(row["unions"]),
            _wrong(row["alone"], True),
        ]
        for size, row in found["splits"].items()
    ]
    head = ("samples", "one class: proposed %", "two: proposed %", "  parts right %", "wrongly")
    parts.append(table("Splitting", head, rows))
    return "\n\n".join(parts)


def _proposed(rows: Sequence[Results]) -> float:
    return share(sum(row["proposed"] for row in rows), len(rows))


def _pure(rows: Sequence[Results]) -> float:
    told = [row["pure"] for row in rows if row["proposed"]]
    return share(sum(told), len(told))


def _wrong(rows: Sequence[Results], proposed: bool) -> str:
    return " ".join(sorted({row["name"] for row in rows if row["proposed"] == proposed})) or "-"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run, print, save."""
    parser = make_parser("layout_discovery", __doc__)
    parser.add_argument(
        "--limit", type=int, default=None, help="only the first N pages of each class and set"
    )
    parser.add_argument("--no-reading", action="store_true", help="segment without OCR")
    options = parser.parse_args(arguments)
    cv2.setNumThreads(1)
    specimens = load_specimens(options.data, options.limit)
    if not specimens:
        print(f"no pages in {layout_folder(options.data)}: nothing is measured", file=sys.stderr)
        return 0
    reading = ReadingOptions(None if options.fresh else MEMORY, not options.no_reading)
    classes = by_class(segment_all(specimens, reading, options.workers))
    results: Results = {}
    for zones in ZONES:
        samples = {name: lessons(members, LEARNED[zones]) for name, members in classes.items()}
        results[zones] = {
            "new": measure_new_classes(classes, zones),
            "merges": measure_merges(samples),
            "splits": measure_splits(samples),
        }
        print(f"{report(zones, results[zones])}\n", flush=True)
    write_json(OUTPUT / "layout_discovery.json", plain_values(results))
    draw_discovery(OUTPUT / "layout_discovery.png", results["own"])
    print(f"figures and plot: {OUTPUT}")
    return 0

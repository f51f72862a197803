"""Made invoices of twelve firms in four languages: values, items, and stacks, by models of a few labelled ones.

python -m benchmarks layout_forms [--parts words,scans,photos,stacks] [--limit N] [--update-baseline]

Samples label four values and the cells of the first two items. *Own*: five samples of the same firm; *others*: twenty
of other firms. Four firms, one of each language, are set aside: no model of others has a sample of them, and their
figures have rows of their own. *Words*: the drawn words, without OCR. *Scans*: pictures of 225 dpi, read as the service
reads; *photos*: of a flat and of a bent sheet, flattened first; both by models of scans. Texts are right by letters
without accents and digits. A row is found where one of its cells is right; rows that are there too much are counted
apart. *Stacks*: 10 to 30 pages of six firms that are one class, with a model of later pages; where documents begin.
"""

import sys
from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np

from benchmarks.common.baseline import Figures, Metric, judge
from benchmarks.common.figures import plain_values, write_json
from benchmarks.common.memory import Memory
from benchmarks.common.options import make_parser
from benchmarks.common.places import BASELINE, MEMORY, OUTPUT
from benchmarks.common.workers import Progress, run_in_workers
from benchmarks.layout.form_documents import (
    ASIDE,
    CLASS,
    Source,
    Tally,
    judge_form,
    make_form,
    model_of,
    sample_of,
)
from benchmarks.layout.part import share, table
from services.layout.pipeline import VersionedModel, content_features, initialize_with_items
from services.layout.recognition.page_recognition import RecognitionParameters
from services.layout.recognition.stack import part_stack
from services.ocr.engine import OcrEngine
from services.operations.layout_tables import gather_tables
from services.operations.reader import ocr_engine
from simulation.invoice_firms import FIRMS, Firm
from simulation.invoice_pages import ITEMS

NAME = "layout_forms"
OWN, OTHERS = 5, 20
"""Samples of a model."""
TESTED = {"words": 8, "scans": 2, "flat photos": 1, "bent photos": 1}
"""Forms of each firm."""
_FIRST_TESTED = 100
"""Seeds of forms that are tested; samples have smaller ones."""
FIRST, LATER = 3, 2
"""Samples of first and of later pages of each firm of a stack."""
STACKS, STACK_FIRMS, FEWEST, MOST = 12, 6, 10, 30
METRICS = {"right_percent": Metric(1.0, True)}
PARTS = ("words", "scans", "photos", "stacks")


def samples_for(firm: Firm, kind: str) -> list[tuple[Firm, int]]:
    """Firms and seeds of the samples of a model that is tested on forms of a firm."""
    if kind == "own":
        return [(firm, seed) for seed in range(OWN)]
    others = [each for each in FIRMS if each.name not in ASIDE and each is not firm]
    return [(others[seed % len(others)], seed) for seed in range(OTHERS)]


def measure_firm(
    firm: Firm, kind: str, part: str, tested: int, engine: OcrEngine | None, memory: Memory
) -> dict[str, Tally]:
    """What is right of forms of a firm, by where their words come from."""
    of_samples: Source = "words" if part == "words" else "scans"
    model = model_of(
        [make_form(each, seed, of_samples, engine, memory) for each, seed in samples_for(firm, kind)]
    )
    sources: tuple[Source, ...] = ("flat photos", "bent photos") if part == "photos" else (of_samples,)
    tallies: dict[str, Tally] = {}
    for source in sources:
        tally = tallies.setdefault(source, Tally())
        for seed in range(min(tested, TESTED[source])):
            tally.add(judge_form(make_form(firm, _FIRST_TESTED + seed, source, engine, memory), [model]))
    return tallies


def measure_stack(number: int) -> tuple[int, int, int, int]:
    """Beginnings, those found, those found where none is, and pages of a stack."""
    rng = np.random.default_rng([41, number])
    firms = [FIRMS[place] for place in sorted(rng.choice(len(FIRMS), STACK_FIRMS, replace=False).tolist())]
    models = _models_of_stack(firms)
    pages: list[Any] = []
    begins: list[bool] = []
    size = int(rng.integers(FEWEST, MOST + 1))
    while len(pages) < size:
        firm = firms[int(rng.integers(len(firms)))]
        form = make_form(firm, _FIRST_TESTED + 50 * number + len(pages), "words", None, Memory(None))
        pages += form.pages
        begins += [True] + [False] * (len(form.pages) - 1)
    features = content_features()
    gathered = gather_tables([(page.page, page.fine) for page in pages], models, features)
    found = part_stack([page for page, _ in gathered], models, features.names, RecognitionParameters())
    true = {place for place, is_first in enumerate(begins) if is_first} - {0}
    given = set(found.beginnings) - {0}
    return len(true), len(true & given), len(given - true), len(pages)


def _models_of_stack(firms: Sequence[Firm]) -> list[VersionedModel]:
    """One class of all these firms: a model of first pages, and one of later ones."""
    nothing = Memory(None)
    first = [
        make_form(firm, seed, "words", None, nothing).pages[0] for firm in firms for seed in range(FIRST)
    ]
    later = [
        make_form(firm, seed, "words", None, nothing, items=36 + seed).pages[-1]
        for firm in firms
        for seed in range(LATER)
    ]
    models = []
    for name, pages, continues in ((CLASS, first, None), (f"{CLASS}, later", later, CLASS)):
        views = [sample_of(page) for page in pages]
        model = initialize_with_items(
            name, [page for page, _ in views], content_features(), [found for _, found in views], ITEMS
        )
        models.append(VersionedModel(model, 1, continues=continues))
    return models


def main(arguments: Sequence[str] | None = None) -> int:
    """Run, print, save, compare; 1 when something got worse than the baseline."""
    parser = make_parser(NAME, __doc__)
    parser.add_argument("--parts", default="words,stacks", help=f"by commas: {', '.join(PARTS)}")
    parser.add_argument("--limit", type=int, default=max(TESTED.values()), help="forms of each firm")
    options = parser.parse_args(arguments)
    parts = options.parts.split(",")
    if unknown := [part for part in parts if part not in PARTS]:
        parser.error(f"no such part: {', '.join(unknown)}")
    kept = None if options.fresh else "kept"
    tasks = [
        (firm, kind, part, options.limit)
        for part in parts
        if part != "stacks"
        for kind in ("own", "others")
        for firm in FIRMS
    ]
    figures: Figures = {}
    if tasks:
        figures |= _report_forms(tasks, kept, options.workers)
    if "stacks" in parts:
        figures |= _report_stacks(min(STACKS, options.limit * 2), kept, options.workers)
    write_json(OUTPUT / f"{NAME}.json", plain_values(figures))
    if options.limit < max(TESTED.values()):
        return 0
    verdict, good = judge(
        BASELINE / f"{NAME}.json", plain_values(figures), METRICS, update=options.update_baseline
    )
    print(verdict, flush=True)
    return 0 if good else 1


def _report_forms(tasks: Sequence[tuple[Firm, str, str, int]], kept: str | None, workers: int) -> Figures:
    tallies: dict[tuple[str, str, str], Tally] = {}
    progress = Progress(len(tasks))
    for firm, kind, by_source in run_in_workers(_measure, tasks, _start, kept, workers):
        progress.tell(f"{firm}, {kind}")
        group = "set aside" if firm in ASIDE else "shown"
        for source, tally in by_source.items():
            tallies.setdefault((source, kind, group), Tally()).add(tally)
    figures: Figures = {}
    rows: list[list[str | float]] = []
    for (source, kind, group), tally in sorted(tallies.items()):
        case = f"{source}, {kind}, {group}"
        of_kinds = {
            "values": share(tally.values_right, tally.values),
            "rows": share(tally.rows_found, tally.rows),
            "cells": share(tally.cells_right, tally.cells),
        }
        figures |= {f"{case}, {name}": {"right_percent": right} for name, right in of_kinds.items()}
        rows.append([case, *of_kinds.values(), tally.values, tally.rows, tally.rows_extra])
    columns = ("words from, samples, firms", "values", "rows", "cells", "of values", "of rows", "too much")
    print(table("Right, percent", columns, rows))
    return figures


def _report_stacks(count: int, kept: str | None, workers: int) -> Figures:
    counts = np.array(list(run_in_workers(measure_stack, range(count), _start, kept, workers)))
    true, found, wrong, pages = counts.sum(axis=0).tolist()
    print(
        table("Stacks", ("", "pages", "beginnings", "found", "wrong"), [["all", pages, true, found, wrong]])
    )
    return {
        "stacks, beginnings found": {"right_percent": share(found, true)},
        "stacks, pages rightly parted": {"right_percent": share(pages - wrong - (true - found), pages)},
    }


_started: list[tuple[OcrEngine | None, Memory]] = []


def _start(memory: str | None) -> None:
    cv2.setNumThreads(1)
    _started[:] = [(ocr_engine("eng"), Memory(MEMORY if memory else None))]


def _measure(task: tuple[Firm, str, str, int]) -> tuple[str, str, dict[str, Tally]]:
    firm, kind, part, tested = task
    return firm.name, kind, measure_firm(firm, kind, part, tested, *_started[0])


if __name__ == "__main__":
    sys.exit(main())

"""Values of receipts of any shops, by models of a few labelled ones: company, date, address, total.

python -m benchmarks layout_receipts [--parts values,feedback] [--sizes 5,10,20] [--draws N] [--no-peers]

The receipts are for measuring only, and read from the data. They are read and segmented as the service does it. Samples
have the true boxes of all lines, with the labels of the four values; a model of some shops is tested on receipts of
others. A third of the shops is set aside: models of the other receipts are tested on them too. Peers in the same run: a
random forest on the same attributes of the same parts of lines, and rules (the first line, the first date, the largest
amount). A value is right by letters and digits alone; an address may have an edit distance of a tenth.

The part `feedback` teaches: one receipt of a shop before the next one (models of ten receipts of other shops), and
streams, of whose last receipts the values that are wrong are counted with and without learning (`receipt_feedback`).
"""

import re
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path

import cv2
import numpy as np

from benchmarks.common.baseline import Figures, Metric, judge
from benchmarks.common.figures import plain_values, write_json
from benchmarks.common.memory import Memory
from benchmarks.common.options import make_parser
from benchmarks.common.places import BASELINE, MEMORY, OUTPUT
from benchmarks.common.workers import Progress, run_in_workers
from benchmarks.layout.part import table
from benchmarks.layout.peers import ForestLabels
from benchmarks.layout.protocols import recognize_finely
from benchmarks.layout.receipt_feedback import Wrong, count_wrong, judge_pairs, judge_stream
from benchmarks.layout.receipt_values import (
    LABELS,
    MONEY,
    Receipt,
    Values,
    found_values,
    is_right,
    joined_values,
    letters,
    model_of,
    read_receipt,
    values_as_read,
)
from benchmarks.layout.truth import layout_folder
from services.layout.grouping.line_parts import cut_lines
from services.layout.pipeline import content_features
from services.layout.segmentation import compose_page
from services.ocr.engine import OcrEngine
from services.operations.reader import ocr_engine

NAME = "layout_receipts"
PARTS = ("values", "feedback")
SIZES = ("5", "10", "20")
DRAWS = 5
METRICS = {"right_percent": Metric(2.0, True)}
_DAY = re.compile(r"\d{1,4}[./-](?:\d{1,2}|[A-Za-z]{3})[./-]\d{2,4}")

Method = Callable[[Sequence[Receipt], Sequence[Receipt]], list[Values]]
"""(samples, receipts) -> values of each receipt."""


def by_models(samples: Sequence[Receipt], tested: Sequence[Receipt]) -> list[Values]:
    """Values by the model of the samples, as the service finds them."""
    model = model_of(samples)
    return [found_values(recognize_finely(each.fine, model)) for each in tested]


def by_forest(samples: Sequence[Receipt], tested: Sequence[Receipt]) -> list[Values]:
    """Values by a random forest on the lines of the samples."""
    features = content_features()
    pages = [features.measure_page(compose_page(cut_lines(each.fine).fine)) for each in tested]
    labelled = ForestLabels([each.true for each in samples]).label(pages)
    return [joined_values(page, labels) for page, labels in zip(pages, labelled, strict=True)]


def by_rules(samples: Sequence[Receipt], tested: Sequence[Receipt]) -> list[Values]:
    """The first line of three letters, the first date, no address, the largest amount; nothing is learned."""
    return [_by_rules([text for text in each.fine.texts if text]) for each in tested]


def _by_rules(lines: Sequence[str]) -> Values:
    days = (match[0] for line in lines for match in _DAY.finditer(line))
    amounts = [match for line in lines for match in MONEY.findall(line)]
    return {
        "company": next((line for line in lines if len(letters(line)) >= 3), None),
        "date": next(days, None),
        "address": None,
        "total": max(amounts, key=lambda amount: float(amount.replace(",", "")), default=None),
    }


METHODS: Mapping[str, Method] = {"models": by_models, "forest": by_forest, "rules": by_rules}
LESSONS: Mapping[str, Callable[[Sequence[Receipt], int], list[tuple[Wrong, Wrong]]]] = {
    "one of the shop": partial(judge_pairs, set_aside=False),
    "one of the shop, set aside": partial(judge_pairs, set_aside=True),
    "stream": judge_stream,
}
Judged = list[tuple[str, str, bool, bool]]
"""Of each value: receipt, label, whether it is right, whether the reading has it."""


def judge_draw(receipts: Sequence[Receipt], size: int, draw: int, method: Method) -> tuple[Judged, Judged]:
    """Values of the receipts that are no samples, and of those that were set aside."""
    shown = [each for each in receipts if not each.is_set_aside]
    aside = [each for each in receipts if each.is_set_aside]
    chosen = set(np.random.default_rng([draw, size]).choice(len(shown), size, replace=False).tolist())
    samples = [shown[k] for k in sorted(chosen)]
    shops = {each.shop for each in samples}
    others = [each for each in shown if each.shop not in shops]
    values = method(samples, [*others, *aside])
    judged = [_judged(each, found) for each, found in zip([*others, *aside], values, strict=True)]
    return (
        [one for each in judged[: len(others)] for one in each],
        [one for each in judged[len(others) :] for one in each],
    )


def _judged(receipt: Receipt, found: Values) -> Judged:
    read = values_as_read(receipt)
    return [
        (receipt.name, label, is_right(label, found[label], true), is_right(label, read[label], true))
        for label in LABELS
        if (true := receipt.values.get(label))
    ]


def interval(judged: Judged) -> tuple[float, float]:
    """95 % interval of the percentage that is right, by drawing receipts again; all draws of one go together."""
    by_receipt: dict[str, list[bool]] = {}
    for name, _, right, _ in judged:
        by_receipt.setdefault(name, []).append(right)
    means = np.array([np.mean(each) for each in by_receipt.values()])
    drawn = np.random.default_rng(0).choice(means, (1000, len(means))).mean(axis=1)
    low, high = np.quantile(drawn, (0.025, 0.975))
    return 100 * float(low), 100 * float(high)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run, print, save, compare; 1 when something got worse than the baseline."""
    parser = make_parser(NAME, __doc__)
    parser.add_argument("--parts", default=",".join(PARTS), help="only these, by commas: values,feedback")
    parser.add_argument("--sizes", default=",".join(SIZES), help="numbers of samples, by commas")
    parser.add_argument("--draws", type=int, default=DRAWS, help="draws of samples of each number")
    parser.add_argument("--no-peers", action="store_true", help="without the forest and the rules")
    options = parser.parse_args(arguments)
    files = sorted((layout_folder(options.data) / "receipts").glob("*.json"))
    if not files:
        print(f"no receipts in {layout_folder(options.data)}: nothing is measured", file=sys.stderr)
        return 0
    kept = None if options.fresh else "kept"
    progress = Progress(len(files))
    receipts = []
    for each in run_in_workers(_read, files, _start, kept, options.workers):
        receipts.append(each)
        progress.tell(each.name)
    receipts.sort(key=lambda each: each.name)
    figures: Figures = {}
    if "values" in options.parts:
        sizes = [int(size) for size in options.sizes.split(",")]
        methods = ["models"] if options.no_peers else list(METHODS)
        asked = [
            (receipts, size, draw, method)
            for size in sizes
            for method in methods
            for draw in range(options.draws)
        ]
        figures |= _report_values(run_in_workers(_judge, asked, _start, kept, options.workers))
    if "feedback" in options.parts:
        lessons = [(receipts, lesson, seed) for lesson in LESSONS for seed in range(options.draws)]
        figures |= _report_feedback(run_in_workers(_teach, lessons, _start, kept, options.workers))
    write_json(OUTPUT / f"{NAME}.json", plain_values(figures))
    if options.draws != DRAWS:
        return 0
    verdict, good = judge(
        BASELINE / f"{NAME}.json", plain_values(figures), METRICS, update=options.update_baseline
    )
    print(verdict, flush=True)
    return 0 if good else 1


def _report_values(results: Iterable[tuple[int, str, tuple[Judged, Judged]]]) -> Figures:
    judged: dict[tuple[str, int, str], Judged] = {}
    for size, method, parts in results:
        for part, found in zip(("others", "set aside"), parts, strict=True):
            judged.setdefault((part, size, method), []).extend(found)
    figures: Figures = {}
    rows: list[list[str | float]] = []
    for (part, size, method), found in sorted(judged.items()):
        for label in LABELS:
            own = [each for each in found if each[1] == label]
            known = [each for each in own if each[3]]
            right = 100 * float(np.mean([each[2] for each in own]))
            of_read = 100 * float(np.mean([each[2] for each in known])) if known else float("nan")
            if method == "models":
                figures[f"{part}, {size} samples, {label}"] = {"right_percent": right}
            shares = (right, *interval(own), of_read, 100 * len(known) / max(1, len(own)))
            rows.append([f"{part}, {size}, {method}, {label}", *shares])
    columns = ("shops, samples, method, label", "right", "from", "to", "of read", "read")
    print(table("Values right, percent of all", columns, rows))
    return figures


def _report_feedback(results: Iterable[tuple[str, list[tuple[Wrong, Wrong]]]]) -> Figures:
    judged: dict[str, list[tuple[Wrong, Wrong]]] = {}
    for lesson, found in results:
        judged.setdefault(lesson, []).extend(found)
    figures: Figures = {}
    rows: list[list[str | float]] = []
    for lesson, found in judged.items():
        before, of = count_wrong([each for each, _ in found])
        after, _ = count_wrong([each for _, each in found])
        rows.append([lesson, before, after, of, 100 * after / max(1, before)])
        figures[lesson] = {"right_percent": 100 * (1 - after / max(1, of))}
    columns = ("feedback", "wrong without", "wrong with it", "of values", "left %")
    print(table("Values that are wrong, of those that the reading has", columns, rows))
    return figures


_started: list[tuple[OcrEngine, Memory]] = []


def _start(memory: str | None) -> None:
    cv2.setNumThreads(1)
    engine = ocr_engine("eng")
    assert engine is not None, "receipts cannot be read without an engine"
    _started[:] = [(engine, Memory(MEMORY if memory else None))]


def _read(file: Path) -> Receipt:
    return read_receipt(file, *_started[0])


def _judge(task: tuple[Sequence[Receipt], int, int, str]) -> tuple[int, str, tuple[Judged, Judged]]:
    receipts, size, draw, method = task
    return size, method, judge_draw(receipts, size, draw, METHODS[method])


def _teach(task: tuple[Sequence[Receipt], str, int]) -> tuple[str, list[tuple[Wrong, Wrong]]]:
    receipts, lesson, seed = task
    return lesson, LESSONS[lesson](receipts, seed)

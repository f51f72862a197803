"""Values of receipts of any shops, by models of a few labelled ones: company, date, address, total.

python -m benchmarks layout_receipts [--sizes 5,10,20] [--draws N] [--no-peers]

The receipts are for measuring only, and read from the data. They are read and segmented as the service does it. Samples
have the true boxes of all lines, with the labels of the four values; a model of some shops is tested on receipts of
others. A third of the shops is set aside: models of the other receipts are tested on them too. Peers in the same run: a
random forest on the same attributes of the same parts of lines, and rules (the first line, the first date, the largest
amount). A value is right by letters and digits alone; an address may have an edit distance of a tenth.
"""

import csv
import json
import re
import sys
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from rapidfuzz.distance import Levenshtein

from benchmarks.common.baseline import Figures, Metric, judge
from benchmarks.common.figures import plain_values, write_json
from benchmarks.common.memory import Memory
from benchmarks.common.options import make_parser
from benchmarks.common.places import BASELINE, MEMORY, OUTPUT
from benchmarks.common.workers import Progress, run_in_workers
from benchmarks.layout.part import table
from benchmarks.layout.peers import ForestLabels
from benchmarks.layout.protocols import make_model, recognize_finely
from benchmarks.layout.specimens import load_gray
from benchmarks.layout.truth import layout_folder
from services.arrays import GrayImage
from services.contract.fields import FieldSetting
from services.layout.content.zone_texts import fill_texts
from services.layout.grouping.line_parts import cut_lines
from services.layout.learning.label_transfer import transfer_labels
from services.layout.page import Box, Page, Zone
from services.layout.pipeline import content_features, readable
from services.layout.recognition.fields import gather_fields
from services.layout.segmentation import FinePage, compose_page, measure_zones, segment_finely
from services.layout.values.typed_value import find_value, plain_text
from services.ocr.engine import OcrEngine, Word
from services.ocr.lost_lines import with_lost_lines
from services.ocr.softer_reading import read_best
from services.operations.reader import ocr_engine

NAME = "layout_receipts"
LABELS = ("company", "date", "address", "total")
SETTINGS = {"date": FieldSetting("date", order="DMY"), "total": FieldSetting("amount")}
SIZES = ("5", "10", "20")
DRAWS = 5
NEARLY = 0.1
"""Edit distance over length up to which an address is right."""
METRICS = {"right_percent": Metric(2.0, True)}
_LIMIT_S = 30.0
_MONEY = re.compile(r"\d[\d,]*\.\d\d(?!\d)")
_DAY = re.compile(r"\d{1,4}[./-](?:\d{1,2}|[A-Za-z]{3})[./-]\d{2,4}")

Values = Mapping[str, str | None]


@dataclass(frozen=True, slots=True)
class Receipt:
    """A receipt: its true lines with labels, its page as it is found, and the true values."""

    name: str
    shop: str
    true: Page
    fine: FinePage
    own: Page
    values: dict[str, str]

    @property
    def is_set_aside(self) -> bool:
        """Whether its shop was not looked at while the code was written."""
        return zlib.crc32(self.shop.encode()) % 3 == 0


class ServiceReader:
    """Reads a page as the service does, within its bounds."""

    name = "service, receipts"

    def __init__(self, engine: OcrEngine) -> None:
        self._engine = engine

    def read_page(self, image: GrayImage) -> list[Word]:
        """Words of a page in even light."""
        words, _ = read_best(image, self._engine, _LIMIT_S)
        return with_lost_lines(image, words, self._engine)


def letters(text: str) -> str:
    """Capital letters and digits of a text."""
    return re.sub(r"[^A-Z0-9]", "", text.upper())


def is_right(label: str, given: str | None, true: str) -> bool:
    """Whether a value is the true one."""
    if not given:
        return False
    if label == "total":
        amounts = [re.sub(r"[^\d.]", "", text) for text in (given, true)]
        return all(amounts) and amounts[0] == amounts[1]
    if label == "address":
        return Levenshtein.distance(letters(given), letters(true)) <= NEARLY * len(letters(true))
    return letters(true) in letters(given) if label == "date" else letters(given) == letters(true)


def labelled_boxes(
    lines: Sequence[tuple[Box, str]], values: Mapping[str, str]
) -> list[tuple[Box, str | None]]:
    """The boxes of the true lines with their labels; a value within a line has a box of its own, as a person draws it.

    All characters of a line are taken to be equally wide.
    """
    from_top = sorted(range(len(lines)), key=lambda k: lines[k][0][1])
    held: dict[int, tuple[str, tuple[int, int]]] = {}
    for label in ("company", "address"):
        left = values.get(label, "")
        for k in from_top:
            if k not in held and (span := _common_part(lines[k][1], left)) is not None:
                held[k] = (label, span)
                left = left.replace(lines[k][1][slice(*span)].strip(), "", 1)
    day, total = values.get("date", ""), values.get("total", "")
    for k in from_top:
        if day and k not in held and (at := lines[k][1].find(day)) >= 0:
            held[k] = ("date", (at, at + len(day)))
            break
    amounts = [
        k for k in from_top if k not in held and total and is_right("total", _last_amount(lines[k][1]), total)
    ]
    if amounts:
        best = max(amounts, key=lambda k: _is_total(lines, k))
        held[best] = ("total", [match.span() for match in _MONEY.finditer(lines[best][1])][-1])
    boxes: list[tuple[Box, str | None]] = []
    for k, (box, text) in enumerate(lines):
        if k not in held:
            boxes.append((box, None))
            continue
        label, (begin, end) = held[k]
        width = (box[2] - box[0]) / max(1, len(text))
        for start, stop, own in ((0, begin, None), (begin, end, label), (end, len(text), None)):
            if own is not None or letters(text[start:stop]):
                boxes.append(((box[0] + start * width, box[1], box[0] + stop * width, box[3]), own))
    return boxes


def _common_part(text: str, value: str) -> tuple[int, int] | None:
    """Where a line has a part of the value: the whole line, or all that is left of the value within it."""
    own, left = letters(text), letters(value)
    if len(own) >= 3 and own in left:
        return 0, len(text)
    at = text.upper().find(value.strip().upper())
    return (at, at + len(value.strip())) if len(left) >= 3 and at >= 0 else None


def _last_amount(text: str) -> str | None:
    found = _MONEY.findall(text)
    return found[-1] if found else None


def _is_total(lines: Sequence[tuple[Box, str]], place: int) -> tuple[int, float]:
    """How much the row of an amount speaks of a total, and how large it is printed."""
    box = lines[place][0]
    middle = (box[1] + box[3]) / 2
    row = " ".join(text.upper() for other, text in lines if other[1] <= middle <= other[3])
    return 2 * ("TOTAL" in row and "SUB" not in row) + ("AMOUNT" in row or "TOTAL" in row), box[3] - box[1]


def read_receipt(file: Path, engine: OcrEngine, memory: Memory) -> Receipt:
    """The receipt `file` (its values, as JSON), read and segmented."""
    gray = load_gray(file.with_suffix(".jpg"))
    words = memory.page_words(ServiceReader(engine), readable(gray))
    values = {name: str(value) for name, value in json.loads(file.read_text("utf-8")).items() if value}
    lines: list[tuple[Box, str]] = []
    with file.with_suffix(".csv").open(encoding="utf-8", newline="") as rows:
        for row in csv.reader(rows):
            corners = np.array(row[:8], dtype=np.float64).reshape(4, 2)
            (x0, y0), (x1, y1) = corners.min(axis=0).tolist(), corners.max(axis=0).tolist()
            lines.append(((x0, y0, x1, y1), ",".join(row[8:])))
    zones = (Zone(f"t{k}", box, label=label) for k, (box, label) in enumerate(labelled_boxes(lines, values)))
    height, width = gray.shape
    features = content_features()
    true = measure_zones(gray, Page(float(width), float(height), tuple(zones)))
    true = features.measure_page(fill_texts(true, words))
    fine = segment_finely(gray, words)
    own = features.measure_page(transfer_labels(true, compose_page(fine)))
    return Receipt(file.stem, values.get("company", file.stem), true, fine, own, values)


Method = Callable[[Sequence[Receipt], Sequence[Receipt]], list[Values]]
"""(samples, receipts) -> values of each receipt."""


def by_models(samples: Sequence[Receipt], tested: Sequence[Receipt]) -> list[Values]:
    """Values by the model of the samples, as the service finds them."""
    model = make_model("receipt", [(each.true, each.own) for each in samples])
    found = []
    for each in tested:
        fields = {field.label: field for field in gather_fields(recognize_finely(each.fine, model), SETTINGS)}
        found.append(
            {
                label: (field.value if label == "total" else field.text) if field else None
                for label, field in ((label, fields.get(label)) for label in LABELS)
            }
        )
    return found


def by_forest(samples: Sequence[Receipt], tested: Sequence[Receipt]) -> list[Values]:
    """Values by a random forest on the lines of the samples."""
    features = content_features()
    pages = [features.measure_page(compose_page(cut_lines(each.fine).fine)) for each in tested]
    labelled = ForestLabels([each.true for each in samples]).label(pages)
    return [_joined(page, labels) for page, labels in zip(pages, labelled, strict=True)]


def _joined(page: Page, labels: Sequence[str | None]) -> Values:
    values: dict[str, str | None] = {}
    for label in LABELS:
        text = "\n".join(zone.text for zone, own in zip(page.zones, labels, strict=True) if own == label)
        values[label] = find_value(plain_text(text), SETTINGS[label]).value if label == "total" else text
    return values


def by_rules(samples: Sequence[Receipt], tested: Sequence[Receipt]) -> list[Values]:
    """The first line of three letters, the first date, no address, the largest amount; nothing is learned."""
    return [_by_rules([text for text in each.fine.texts if text]) for each in tested]


def _by_rules(lines: Sequence[str]) -> Values:
    days = (match[0] for line in lines for match in _DAY.finditer(line))
    amounts = [match for line in lines for match in _MONEY.findall(line)]
    return {
        "company": next((line for line in lines if len(letters(line)) >= 3), None),
        "date": next(days, None),
        "address": None,
        "total": max(amounts, key=lambda amount: float(amount.replace(",", "")), default=None),
    }


def values_as_read(receipt: Receipt) -> Values:
    """The values that the service's own reading has in the labelled lines: no method can find others."""
    values = dict(_joined(receipt.true, [zone.label for zone in receipt.true.zones]))
    text = "\n".join(zone.text for zone in receipt.true.zones if zone.label == "total")
    values["total"] = _last_amount(text.replace(" ", ""))
    return values


METHODS: Mapping[str, Method] = {"models": by_models, "forest": by_forest, "rules": by_rules}
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
    methods = ["models"] if options.no_peers else list(METHODS)
    tasks = [
        (receipts, int(size), draw, method)
        for size in options.sizes.split(",")
        for method in methods
        for draw in range(options.draws)
    ]
    judged: dict[tuple[str, int, str], Judged] = {}
    for size, method, parts in run_in_workers(_judge, tasks, _start, kept, options.workers):
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
            low, high = interval(own)
            rows.append(
                [
                    f"{part}, {size}, {method}, {label}",
                    right,
                    low,
                    high,
                    of_read,
                    100 * len(known) / max(1, len(own)),
                ]
            )
    columns = ("shops, samples, method, label", "right", "from", "to", "of read", "read")
    print(table("Values right, percent of all", columns, rows))
    write_json(OUTPUT / f"{NAME}.json", plain_values(figures))
    if options.draws != DRAWS:
        return 0
    verdict, good = judge(
        BASELINE / f"{NAME}.json", plain_values(figures), METRICS, update=options.update_baseline
    )
    print(verdict, flush=True)
    return 0 if good else 1


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

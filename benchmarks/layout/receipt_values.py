"""Public receipts with the truth of four values: company, date, address, total; their reading, and what is right."""

import csv
import json
import re
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rapidfuzz.distance import Levenshtein

from benchmarks.common.memory import Memory
from benchmarks.layout.protocols import make_model
from benchmarks.layout.specimens import load_gray
from services.arrays import GrayImage
from services.contract.fields import FieldSetting
from services.layout.content.zone_texts import fill_texts
from services.layout.learning.label_transfer import transfer_labels
from services.layout.model.layout_model import LayoutModel
from services.layout.page import Box, Page, Zone
from services.layout.pipeline import content_features, readable
from services.layout.recognition.fields import gather_fields
from services.layout.recognition.results import Recognition
from services.layout.segmentation import FinePage, compose_page, measure_zones, segment_finely
from services.layout.values.typed_value import find_value, plain_text
from services.ocr.engine import OcrEngine, Word
from services.ocr.lost_lines import with_lost_lines
from services.ocr.lost_numbers import with_lost_numbers
from services.ocr.softer_reading import read_best

CLASS = "receipt"
LABELS = ("company", "date", "address", "total")
SETTINGS = {"date": FieldSetting("date", order="DMY"), "total": FieldSetting("amount")}
NEARLY = 0.1
"""Edit distance over length up to which an address is right."""
_LIMIT_S = 30.0
MONEY = re.compile(r"\d[\d,]*\.\d\d(?!\d)")

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
        held[best] = ("total", [match.span() for match in MONEY.finditer(lines[best][1])][-1])
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
    found = MONEY.findall(text)
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
    even = readable(gray)
    words = with_lost_numbers(even, memory.page_words(ServiceReader(engine), even), engine)
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


def joined_values(page: Page, labels: Sequence[str | None]) -> Values:
    """The values of zones with these labels."""
    values: dict[str, str | None] = {}
    for label in LABELS:
        text = "\n".join(zone.text for zone, own in zip(page.zones, labels, strict=True) if own == label)
        values[label] = find_value(plain_text(text), SETTINGS[label]).value if label == "total" else text
    return values


def model_of(samples: Sequence[Receipt]) -> LayoutModel:
    """The model of samples with their images."""
    return make_model(CLASS, [(each.true, each.own) for each in samples])


def found_values(seen: Recognition) -> Values:
    """The values of a recognized receipt, as its fields."""
    fields = {field.label: field for field in gather_fields(seen, SETTINGS)}
    return {
        label: (field.value if label == "total" else field.text) if field else None
        for label, field in ((label, fields.get(label)) for label in LABELS)
    }


def values_as_read(receipt: Receipt) -> Values:
    """The values that the service's own reading has in the labelled lines: no method can find others."""
    values = dict(joined_values(receipt.true, [zone.label for zone in receipt.true.zones]))
    text = "\n".join(zone.text for zone in receipt.true.zones if zone.label == "total")
    values["total"] = _last_amount(text.replace(" ", ""))
    return values

"""Made invoices as documents: drawn words or pictures to be read, samples of them, and what is right of an answer."""

import unicodedata
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from benchmarks.common.memory import Memory
from benchmarks.layout.receipt_values import ServiceReader
from benchmarks.rectify.sheet_experiments import LAMPS
from services.arrays import RgbImage
from services.contract.answers.tables import ItemCell
from services.contract.fields import FieldSetting
from services.contract.layout import ModelDocument
from services.contract.rectify import RectifyParameters
from services.imaging.channels import luminance
from services.layout.content.zone_texts import fill_texts
from services.layout.learning.label_transfer import transfer_labels
from services.layout.page import Page, Zone
from services.layout.pipeline import (
    VersionedModel,
    complete_recognition,
    content_features,
    fine_page,
    initialize_with_items,
    readable,
)
from services.layout.recognition.documents import PageInDocument, recognize_document
from services.layout.segmentation import FinePage, measure_zones
from services.ocr.engine import OcrEngine, Word
from services.ocr.lost_numbers import with_lost_numbers
from services.operations.layout_result import describe_fields
from services.operations.layout_tables import describe_tables, gather_tables, with_tables
from services.rectify.pipeline import rectify
from simulation.degradation import PHONE
from simulation.flat_page import Page as FlatPage
from simulation.invoice_firms import FIRMS, Firm
from simulation.invoice_pages import ITEMS, VALUES, InvoicePage, invoice
from simulation.scenes import BOOK, PLANE, View
from simulation.sheets import take_photo
from simulation.surfaces import Shape
from simulation.truth import Truth

Source = Literal["words", "scans", "flat photos", "bent photos"]
"""Where words come from: the truth, pictures of the pages, photos of these that were flattened."""
ASIDE = frozenset(firm.name for place, firm in enumerate(FIRMS) if place % 3 == 2)
"""Firms that nobody looked at while tables were made: one of each language."""
TYPES: Mapping[str, FieldSetting] = {
    "date": FieldSetting("date", order="DMY"),
    "total": FieldSetting("amount"),
    **{label: FieldSetting("amount") for label in ("quantity", "price", "amount")},
}
CLASS = "invoice"
LABELLED_ROWS = 2
_SURE = 0.97
"""Confidence of drawn words."""
_SCAN_SCALE = 1.5
"""Of pictures that are read: 225 dpi."""
_PHOTO_PX = (2400, 3200)
_SHAPES: Mapping[Source, Shape] = {"flat photos": PLANE, "bent photos": BOOK}


@dataclass(frozen=True, slots=True, eq=False)
class FormPage:
    """A page of a form: the truth, and as it was segmented from its words."""

    truth: InvoicePage
    page: Page
    fine: FinePage
    words: tuple[Word, ...]
    gray_size: tuple[int, int]


@dataclass(frozen=True, slots=True, eq=False)
class Form:
    """An invoice of a firm."""

    firm: str
    pages: tuple[FormPage, ...]


@dataclass(slots=True)
class Tally:
    """What was right of forms: values, rows and cells, and what is there too much."""

    values: int = 0
    values_right: int = 0
    rows: int = 0
    rows_found: int = 0
    rows_extra: int = 0
    cells_right: int = 0

    @property
    def cells(self) -> int:
        return self.rows * len(ITEMS)

    def add(self, other: "Tally") -> None:
        for name in Tally.__slots__:
            setattr(self, name, getattr(self, name) + getattr(other, name))


def make_form(
    firm: Firm,
    seed: int,
    source: Source,
    engine: OcrEngine | None,
    memory: Memory,
    items: int | None = None,
) -> Form:
    """The invoice of a firm by a seed, its words from `source`; of so many items (None: by the seed)."""
    rng = np.random.default_rng([seed, FIRMS.index(firm)])
    drawn = invoice(firm, rng, items=items, scale=1.0 if source == "words" else _SCAN_SCALE)
    pages = []
    for number, page in enumerate(drawn):
        assert page.image is not None, "it is drawn"
        if source == "words":
            image = np.repeat(page.image[..., None], 3, axis=2)
            words = [Word(word.text, word.box, _SURE) for word in page.words]
        else:
            assert engine is not None, "pictures cannot be read without an engine"
            image = _picture(page, source, seed + number, engine)
            even = readable(luminance(image))
            words = with_lost_numbers(even, memory.page_words(ServiceReader(engine), even), engine)
        segmented, fine = fine_page(image, words)
        pages.append(FormPage(page, segmented, fine, tuple(words), image.shape[:2]))
    return Form(firm.name, tuple(pages))


def _picture(page: InvoicePage, source: Source, seed: int, engine: OcrEngine) -> RgbImage:
    assert page.image is not None, "it is drawn"
    if source == "scans":
        return np.repeat(page.image[..., None], 3, axis=2)
    rng = np.random.default_rng(7000 + seed)
    flat = FlatPage(page.image)
    view = View("form", 2500.0, rng.uniform(5, 20), rng.uniform(0, 360), rng.uniform(-6, 6))
    camera, shape = view.camera(*_PHOTO_PX), _SHAPES[source]
    truth = Truth(flat, shape, 0.0, view.pose(flat, shape, camera), camera)
    photo = take_photo(truth, LAMPS[seed % len(LAMPS)], PHONE, rng)
    return rectify(photo.image, RectifyParameters(), None, engine).image


def sample_of(form: FormPage, rows: int = LABELLED_ROWS) -> tuple[Page, Page]:
    """The page as a person labels it (values, and the cells of some rows), and in the zones of segmentation."""
    zones = [
        Zone(f"v{k}", value.box, label=label) for k, (label, value) in enumerate(form.truth.values.items())
    ]
    for k, row in enumerate(form.truth.rows[:rows]):
        zones += [Zone(f"c{k}-{label}", row[label].box, label=label) for label in ITEMS]
    features = content_features()
    height, width = form.gray_size
    drawn = Page(float(width), float(height), tuple(zones))
    assert form.truth.image is not None, "it is drawn"
    verified = features.measure_page(fill_texts(measure_zones(form.truth.image, drawn), list(form.words)))
    return verified, features.measure_page(transfer_labels(verified, form.page))


def model_of(forms: Sequence[Form], name: str = CLASS) -> VersionedModel:
    """The model of all pages of these forms, as workers get it."""
    samples = [sample_of(page) for form in forms for page in form.pages]
    model = initialize_with_items(
        name, [page for page, _ in samples], content_features(), [found for _, found in samples], ITEMS
    )
    return VersionedModel(model, 1)


def recognized(form: Form, models: Sequence[VersionedModel]) -> list[PageInDocument]:
    """The pages with labels and tables, as the service finds them."""
    features = content_features()
    pages = gather_tables([(page.page, page.fine) for page in form.pages], models, features)
    seen = recognize_document([page for page, _ in pages], models, features.names)
    labelled = []
    for placed, (_, fine) in zip(seen.pages, pages, strict=True):
        recognition = complete_recognition(fine, placed.recognition, models, None, features)
        labelled.append(PageInDocument(recognition, placed.part, placed.document_class))
    documents = [ModelDocument(model.model.name, 1, b"", fields=TYPES) for model in models]
    return with_tables(labelled, models, documents)


def judge_form(form: Form, models: Sequence[VersionedModel]) -> Tally:
    """What is right of a form by these models."""
    placed = recognized(form, models)
    tally = Tally()
    found: dict[str, tuple[str | None, float]] = {}
    for each in placed:
        for field in describe_fields(each.recognition, TYPES):
            before = found.get(field.label)
            if before is None or before[0] is None or (field.value and field.confidence > before[1]):
                found[field.label] = field.value, field.confidence
    true = {label: value for page in form.pages for label, value in page.truth.values.items()}
    for label in VALUES:
        tally.values += 1
        given = found.get(label, (None, 0.0))[0]
        tally.values_right += given is not None and plain(given) == plain(true[label].value)
    for each, page in zip(placed, form.pages, strict=True):
        rows = [
            {label: cell for label, cell in zip(table.columns, row, strict=True) if cell is not None}
            for table in describe_tables(each.recognition.tables)
            for row in table.rows
        ]
        tally.add(_judge_rows(page.truth, rows))
    return tally


def _judge_rows(truth: InvoicePage, rows: Sequence[Mapping[str, ItemCell]]) -> Tally:
    """Rows in their order, paired so that most cells are right; a pair has one right cell at least."""
    true = [{label: plain(row[label].text) for label in ITEMS} for row in truth.rows]
    found = [{label: plain(cell.text) for label, cell in row.items()} for row in rows]
    equal = np.array([[sum(a[label] == b.get(label) for label in ITEMS) for b in found] for a in true])
    best = np.zeros((len(true) + 1, len(found) + 1), dtype=int)
    pairs = np.zeros_like(best)
    for i in range(len(true)):
        for j in range(len(found)):
            ways = [(best[i, j + 1], pairs[i, j + 1]), (best[i + 1, j], pairs[i + 1, j])]
            if equal[i, j]:
                ways.append((best[i, j] + equal[i, j], pairs[i, j] + 1))
            best[i + 1, j + 1], pairs[i + 1, j + 1] = max(ways)
    paired = int(pairs[-1, -1])
    return Tally(
        rows=len(true),
        rows_found=paired,
        rows_extra=len(found) - paired,
        cells_right=int(best[-1, -1]),
    )


def plain(text: str) -> str:
    """Letters without accents, digits: an engine without a language's letters misses its accents only."""
    parts = unicodedata.normalize("NFKD", text.casefold())
    return "".join(letter for letter in parts if letter.isalnum())

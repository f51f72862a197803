"""A class whose samples are laid out in different ways: a page in yet another one is of the class, with its values."""

from dataclasses import replace

import numpy as np
import pytest

from services.contract.fields import FieldSetting
from services.layout.content.zone_texts import fill_texts
from services.layout.learning.label_transfer import transfer_labels
from services.layout.page import Page, Zone
from services.layout.pipeline import (
    VersionedModel,
    complete_recognition,
    content_features,
    fine_page,
    initialize_with_items,
    recognize,
)
from services.layout.recognition.fields import gather_fields
from services.layout.recognition.results import Recognition
from services.layout.segmentation import FinePage, measure_zones
from services.ocr.engine import Word
from services.operations.layout_tables import gather_tables
from simulation.invoice_firms import Firm
from simulation.invoice_pages import ITEMS, InvoicePage, invoice
from tests.services.layout.tables.invoices import AHRENS, ALDER

pytestmark = pytest.mark.pipeline

TYPES = {"date": FieldSetting("date", order="DMY"), "total": FieldSetting("amount")}
FEATURES = content_features()


def shown(firm: Firm) -> tuple[Firm, ...]:
    """Three layouts of a firm's invoices: its own, in boxes and with a grid, in columns and centred."""
    return (
        firm,
        replace(firm, meta="boxes", customer_right=not firm.customer_right, rules="grid"),
        replace(firm, meta="columns", centred=True, size=24.0, serif=not firm.serif),
    )


def unseen(firm: Firm) -> tuple[Firm, ...]:
    """Others, in which each of these is combined with another one, and keys of amounts stand elsewhere."""
    return (
        replace(firm, meta="columns", customer_right=True, keys_at_left=True, size=15.0),
        replace(firm, meta="boxes", centred=True, customer_right=False, keys_at_left=True),
    )


def printed(firm: Firm, seed: int) -> tuple[InvoicePage, Page, FinePage, list[Word]]:
    """A drawn invoice, segmented with its true words."""
    [truth] = invoice(firm, np.random.default_rng(seed), items=4)
    assert truth.image is not None
    words = [Word(word.text, word.box, 0.97) for word in truth.words]
    return truth, *fine_page(np.repeat(truth.image[..., None], 3, axis=2), words), words


def sample(firm: Firm, seed: int) -> tuple[Page, Page]:
    """An invoice as a person labels it, and in the zones of segmentation."""
    truth, page, _, words = printed(firm, seed)
    assert truth.image is not None
    zones = [Zone(label, value.box, label=label) for label, value in truth.values.items()]
    zones += [
        Zone(f"{label}{k}", row[label].box, label=label)
        for k, row in enumerate(truth.rows[:2])
        for label in ITEMS
    ]
    drawn = measure_zones(truth.image, replace(page, zones=tuple(zones), loose=()))
    verified = FEATURES.measure_page(fill_texts(drawn, words))
    return verified, FEATURES.measure_page(transfer_labels(verified, page))


def seen(page: Page, fine: FinePage, model: VersionedModel) -> Recognition:
    [(gathered, finer)] = gather_tables([(page, fine)], [model], FEATURES)
    return complete_recognition(finer, recognize(gathered, [model]), [model])


@pytest.mark.parametrize("firm", [ALDER, AHRENS], ids=["words behind keys", "German"])
def test_values_are_known_by_their_words_where_their_places_are_new(firm: Firm) -> None:
    """Words are shared by all samples of a class, whatever their places: no mixture of layouts is needed."""
    views = [sample(each, seed) for each in shown(firm) for seed in range(2)]
    learned = initialize_with_items(
        "invoice", [drawn for drawn, _ in views], FEATURES, [found for _, found in views], ITEMS
    )
    model = VersionedModel(learned, 1)
    for place, each in enumerate(unseen(firm)):
        truth, page, fine, _ = printed(each, 140 + place)
        recognition = seen(page, fine, model)
        assert recognition.chosen is not None
        values = {field.label: field.value for field in gather_fields(recognition, TYPES)}
        true = {label: truth.values[label].value for label in ("number", "date", "total")}
        assert {label: values.get(label) for label in true} == true

"""Feedback as workers do it: documents in, documents out, and clear answers where nothing can be learned."""

import json
import time
from dataclasses import replace
from typing import Any

import pytest

from services.contract.layout import LayoutSettings, ModelDocument
from services.contract.layout_learning import VerifiedPage
from services.errors import InvalidOption
from services.layout.exchange.page_json import page_to_document
from services.layout.model.layout_model import MOST_LABELS
from services.layout.model.model_document import model_to_document
from services.layout.page import Page
from services.operations.layout_learning import adapt_models, revise_page
from services.operations.layout_models import measure_sample
from tests.services.layout.samples import FIRST_UNSEEN, labelled_page, model_of, page_of

LETTER = ModelDocument("letter", 1, json.dumps(model_to_document(model_of("letter", 2))).encode())


def task(page: Page, found_class: str | None, labels: dict[str, str | None]) -> VerifiedPage[dict[str, Any]]:
    """What a person said of a page of letters, whose zones were found to have the labels that they carry."""
    found = {zone.id: zone.label for zone in page.zones}
    return VerifiedPage(page_to_document(page), found_class, found, "letter", labels)


def test_a_page_teaches_the_model_of_its_class() -> None:
    page = labelled_page("letter", FIRST_UNSEEN)
    adaptation = adapt_models(task(page, "letter", {page.zones[0].id: "new"}), [LETTER], LayoutSettings())
    assert [wrong.verified for wrong in adaptation.wrong] == ["new"]
    assert "new" in [node["label"] for node in adaptation.documents["letter"]["nodes"]]


def test_more_labels_than_a_model_may_have_are_refused_before_anything_is_computed() -> None:
    boxes = [
        (10.0 * column, 10.0 * row, 10.0 * column + 8, 10.0 * row + 8)
        for row in range(20)
        for column in range(25)
    ]
    page = page_of(*boxes)
    labels: dict[str, str | None] = {zone.id: f"label {number}" for number, zone in enumerate(page.zones)}
    started = time.process_time()
    with pytest.raises(InvalidOption, match=f"a model may have {MOST_LABELS}"):
        adapt_models(task(page, None, labels), [LETTER], LayoutSettings())
    assert time.process_time() - started < 2.0  # learning them took gigabytes


def test_labels_that_were_found_count_only_where_they_stay() -> None:
    own = {node.label for node in model_of("letter", 2).nodes} - {None}
    page = page_of(*[(10.0 * k, 10.0, 10.0 * k + 8, 18.0) for k in range(MOST_LABELS)])
    page = replace(page, zones=tuple(replace(zone, label=f"gone {zone.id}") for zone in page.zones))
    labels: dict[str, str | None] = {zone.id: min(own) for zone in page.zones}
    assert adapt_models(task(page, "letter", labels), [LETTER], LayoutSettings()).documents
    del labels["z0"], labels["z1"]
    assert adapt_models(task(page, "letter", labels), [LETTER], LayoutSettings()).documents
    with pytest.raises(InvalidOption, match="different labels"):
        adapt_models(task(page, "letter", {}), [LETTER], LayoutSettings())


def test_a_page_without_zones_teaches_nothing() -> None:
    adaptation = adapt_models(task(page_of(), None, {}), [LETTER], LayoutSettings())
    assert (adaptation.documents, adaptation.zones, adaptation.costs) == ({}, 0, [])


def test_found_zones_become_the_second_view_of_a_sample_whose_zones_a_person_drew() -> None:
    page = labelled_page("letter", FIRST_UNSEEN)
    found = replace(page, zones=tuple(replace(zone, label=None) for zone in page.zones[:-1]))
    labels = {zone.id: zone.label for zone in page.zones}
    drawn = replace(task(page, "letter", labels), found_page=page_to_document(found))
    sample = adapt_models(drawn, [LETTER], LayoutSettings()).sample
    assert [zone["label"] for zone in sample["found"]["zones"]] == [zone.label for zone in page.zones[:-1]]
    assert "found" not in adapt_models(task(page, "letter", labels), [LETTER], LayoutSettings()).sample


def test_a_box_thinner_than_a_pixel_is_refused_unless_it_was_found() -> None:
    found = [10.0, 10.0, 60.0, 10.4567]
    kept: Any = {"width": 100, "height": 100, "zones": [{"id": "z1", "box": found, "label": "date"}]}
    zones: Any = [
        {"box": [10.0, 10.0, 60.0, 10.46], "label": "date"},
        {"box": [5, 50, 5.02, 60], "label": None},
    ]
    with pytest.raises(InvalidOption, match="at least 1 x 1") as refused:
        revise_page(kept, zones, LayoutSettings())
    assert refused.value.field == "zones[1].box"
    zones[1]["box"] = [99.5, 50, 120, 60]  # of which half a pixel is on the page
    with pytest.raises(InvalidOption, match="at least 1 x 1"):
        revise_page(kept, zones, LayoutSettings())
    zones[1]["box"] = [5, 50, 6, 60]
    assert len(revise_page(kept, zones, LayoutSettings()).zones) == 2
    with pytest.raises(InvalidOption, match="at least 1 x 1") as refused:
        measure_sample(None, json.dumps(kept).encode(), LayoutSettings())
    assert refused.value.field == "zones[0].box"

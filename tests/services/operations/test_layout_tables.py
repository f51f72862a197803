"""Tables as workers make them: models with the columns of settings, answers, feedback, documents of several pages."""

import json
from typing import Any

import pytest

from services.contract.answers.tables import ItemTable, TableChecks, tables_of_document
from services.contract.fields import FieldSetting
from services.contract.layout import LayoutSettings, ModelDocument
from services.contract.layout_learning import Correction, VerifiedPage
from services.contract.page_json import PageJson, SampleJson
from services.layout.model.model_document import model_from_document
from services.layout.tables.print_rows import em_of, page_words, printed_rows, segments_of
from services.operations.corrected_result import correct_result
from services.operations.layout_again import recognize_again
from services.operations.layout_learning import adapt_models, train_model
from services.operations.layout_models import import_model, initialize_from_samples
from simulation.invoice_firms import Firm
from simulation.invoice_pages import ITEMS, InvoicePage
from tests.services.layout.tables.invoices import AHRENS, ALDER, made, printed

SETTINGS = LayoutSettings()
TYPES = {"amount": FieldSetting("amount"), "total": FieldSetting("amount")}


def found_page(page: InvoicePage) -> PageJson:
    """A page as it is kept: a zone for each run of words, with these."""
    plain = printed(page)
    words = page_words(plain)
    zones = []
    for row in printed_rows(words):
        for part in segments_of(row, em_of(words)):
            own = [[word.text, *map(round, word.box), 0.95, 0] for word in part.words]
            zones.append(
                {"box": list(part.box), "text": part.text, "printed": own, "kind": "text", "label": None}
            )
    named: list[Any] = [{"id": f"z{k}", **zone} for k, zone in enumerate(zones)]
    return {"width": plain.width, "height": plain.height, "zones": named}


def given_cells(page: InvoicePage, rows: int = 2) -> list[dict[str, Any]]:
    return [
        {"id": f"c{k}-{label}", "box": list(row[label].box), "label": label, "kind": "text"}  # type: ignore[index]
        for k, row in enumerate(page.rows[:rows])
        for label in ITEMS
    ]


def sample(firm: Firm, seed: int) -> SampleJson:
    [page] = made(firm, seed)
    values: list[Any] = [
        {"id": label, "box": list(value.box), "label": label, "kind": "text", "text": value.text}
        for label, value in page.values.items()
    ]
    zones: list[Any] = [*values, *given_cells(page)]
    return {**found_page(page), "zones": zones, "found": found_page(page)}


@pytest.fixture(scope="module")
def document() -> dict[str, Any]:
    """A model of three samples of one firm."""
    samples = [sample(ALDER, seed) for seed in range(3)]
    draft = initialize_from_samples("invoice", samples, SETTINGS, ITEMS)
    return json.loads(json.dumps(draft.document))


def stored(document: dict[str, Any]) -> ModelDocument:
    return ModelDocument("invoice", 1, json.dumps({**document, "memory": None}).encode(), fields=TYPES)


def test_columns_are_no_labels_of_the_graph(document: dict[str, Any]) -> None:
    assert {node["label"] for node in document["nodes"]} == {None, "number", "date", "customer", "total"}
    assert [column["label"] for column in document["table"]["columns"]] == list(ITEMS)
    back = json.loads(json.dumps(import_model("invoice", json.dumps(document).encode()).document))
    assert back["table"] == document["table"]


def test_the_usual_cost_is_that_of_zones_of_segmentation(document: dict[str, Any]) -> None:
    """Of three samples as they were found; as they were drawn, with four values each, they cost less than half."""
    assert document["calibration"]["pages"] == 3
    [page] = made(ALDER, 21)
    found = recognize_again(found_page(page), [stored(document)], SETTINGS, words=False)
    assert found["class"] is not None


def test_without_columns_the_same_labels_are_those_of_zones() -> None:
    draft = initialize_from_samples("invoice", [sample(ALDER, seed) for seed in range(2)], SETTINGS)
    assert draft.document.get("table") is None
    assert "amount" in draft.labels


def test_a_kept_page_has_its_table_with_typed_values(document: dict[str, Any]) -> None:
    [page] = made(ALDER, 20)
    found = recognize_again(found_page(page), [stored(document)], SETTINGS, words=False)
    [table] = found["tables"]
    assert table["columns"] == list(ITEMS)
    assert table["types"] == ["text", "text", "text", "amount"]
    amounts = [row[3] for row in table["rows"]]
    assert [cell and cell["value"] for cell in amounts] == [row["amount"].value for row in page.rows]
    assert table["checks"]["products"] == "fit"
    assert table["checks"]["sum"] == "fits"


def test_cells_that_a_person_labels_teach_the_table_and_stay_in_the_sample(document: dict[str, Any]) -> None:
    """Another firm's: its header has other words."""
    [page] = made(AHRENS, 1)
    model = ModelDocument("invoice", 1, json.dumps(document).encode())
    plain, cells = found_page(page), given_cells(page)
    drawn: PageJson = {**plain, "zones": [*plain["zones"][:3], *cells]}  # type: ignore[list-item]
    labels: dict[str, str | None] = {str(zone["id"]): zone["label"] for zone in drawn["zones"]}
    verified = VerifiedPage(drawn, "invoice", {}, "invoice", labels, plain)
    adaptation = adapt_models(verified, [model], SETTINGS)
    table = model_from_document(json.loads(json.dumps(adaptation.documents["invoice"]))).table
    assert table is not None
    headers = {column.label: set(column.headers) for column in table.columns}
    assert headers["quantity"] == {"qty", "menge"}
    assert table.samples == 4
    assert {node["label"] for node in adaptation.documents["invoice"]["nodes"]}.isdisjoint(ITEMS)
    assert sum(zone["label"] in ITEMS for zone in adaptation.sample["zones"]) == len(cells)
    assert [wrong.zone for wrong in adaptation.wrong] == []


def test_training_keeps_the_table(document: dict[str, Any]) -> None:
    model = ModelDocument("invoice", 1, json.dumps(document).encode())
    draft, _ = train_model(model, [sample(ALDER, seed) for seed in range(2)], 1, SETTINGS)
    assert json.loads(json.dumps(draft.document))["table"] == document["table"]
    assert not set(draft.labels) & set(ITEMS)


def test_a_person_s_other_class_leaves_no_table(document: dict[str, Any]) -> None:
    [page] = made(ALDER, 20)
    found: Any = recognize_again(found_page(page), [stored(document)], SETTINGS, words=False)
    found = {**found, "width": 1240, "height": 1754}
    labels = {zone["id"]: zone["label"] for zone in found["zones"]}
    for name, tables in (("invoice", 1), ("letter", 0)):
        said = Correction(name, labels, frozenset(), {}, None, 0.01)
        assert len(correct_result(found, found["zones"], said)["tables"]) == tables


def answer(rows: int, columns: tuple[str, ...] = ("a", "b"), unlike: tuple[int, ...] = ()) -> ItemTable:
    checks = TableChecks(products="differ" if unlike else "fit", unlike_rows=list(unlike), sum="fits")
    return ItemTable(
        columns=list(columns),
        types=["text"] * len(columns),
        headers=[None] * len(columns),
        box=(0, 0, 1, 1),
        rows=[[None] * len(columns)] * rows,
        checks=checks,
    )


def test_pages_that_follow_each_other_have_one_table() -> None:
    pages = [[answer(2)], [answer(3, unlike=(1,)), answer(1)], [], [answer(1)], [answer(1, ("c",))]]
    tables = tables_of_document(pages)
    assert [(table.columns, table.pages) for table in tables] == [
        (["a", "b"], [0, 0, 1, 1, 1]),
        (["a", "b"], [1]),
        (["a", "b"], [3]),
        (["c"], [4]),
    ]
    assert tables[0].checks.unlike_rows == [3]
    assert (tables[0].checks.products, tables[1].checks.products) == ("differ", "fit")

"""Tables as workers make them: models with the columns of settings, answers, feedback, documents of several pages."""

import json
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, cast

import pytest

from services.contract.answers.tables import ItemTable, TableChecks, tables_of_document
from services.contract.boxes import holds_middle
from services.contract.fields import FieldSetting
from services.contract.layout import LayoutSettings, ModelDocument
from services.contract.layout_learning import Adaptation, Correction, RevisedPage, VerifiedPage
from services.contract.page_json import PageJson, SampleJson
from services.errors import InvalidOption
from services.layout.model.model_document import model_from_document
from services.layout.page import Page
from services.layout.recognition.page_recognition import VersionedModel
from services.layout.recognition.results import ClassMatch, Recognition
from services.layout.tables.print_rows import em_of, page_words, printed_rows, segments_of
from services.operations.corrected_result import correct_result
from services.operations.corrected_tables import correct_tables
from services.operations.layout_again import recognize_again
from services.operations.layout_learning import adapt_models, revise_page, train_model
from services.operations.layout_models import import_model, initialize_from_samples
from services.operations.layout_tables import SegmentedPage, recognize_view
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


def test_what_is_doubtful_in_cells_is_said() -> None:
    samples: list[Any] = [sample(ALDER, seed) for seed in range(2)]
    codes = [each.code for each in initialize_from_samples("invoice", samples, SETTINGS, ITEMS).warnings]
    assert codes == []
    named = [*ITEMS, "total", "discount"]
    doubled = {**given_cells(made(ALDER, 0)[0])[0], "id": "again"}
    doubled["box"] = [doubled["box"][2] + 5, doubled["box"][1], doubled["box"][2] + 20, doubled["box"][3]]
    samples[0]["zones"].append(doubled)
    warnings = initialize_from_samples("invoice", samples, SETTINGS, named).warnings
    assert [each.code for each in warnings] == [
        "column-without-cells", "column-outside-rows", "two-cells-in-line",
    ]  # fmt: skip
    for warning, label in zip(warnings, ("'discount'", "'total'", "'description'"), strict=True):
        assert label in warning.detail


def test_a_column_that_no_sample_has_does_not_blame_the_other_one() -> None:
    samples = [sample(ALDER, seed) for seed in range(2)]
    warnings = initialize_from_samples("invoice", samples, SETTINGS, [ITEMS[0], "nonexistent"]).warnings
    assert [each.code for each in warnings] == ["column-without-cells"]
    assert "'nonexistent'" in warnings[0].detail


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


@pytest.mark.parametrize(
    ("gathered_as", "plain_as", "taken"),
    [
        (("letter", 0.9), ("letter", 0.8), "plain"),
        (("invoice", 0.9), ("letter", 0.5), "gathered"),
        (("invoice", 0.9), ("invoice", 0.95), "gathered"),
        (("invoice", 0.75), ("letter", 0.95), "plain"),
    ],
)
def test_a_class_without_a_table_is_asked_of_pages_as_they_are(
    document: dict[str, Any], gathered_as: tuple[str, float], plain_as: tuple[str, float], taken: str
) -> None:
    """Two labelled invoices without `items` lost their next page to another firm's class that had `items`."""
    model = model_from_document(document)
    models = [VersionedModel(model, 1), VersionedModel(replace(model, name="letter", table=None), 1)]
    gathered, plain = ([(Page(1.0, 1.0, ()), None)] for _ in range(2))
    seen: list[str] = []

    def recognize(pages: Sequence[SegmentedPage]) -> Recognition:
        seen.append("gathered" if pages is gathered else "plain")
        name, probability = gathered_as if pages is gathered else plain_as
        return Recognition(pages[0][0], (), None, (ClassMatch(name, 1, 0.0, probability),))

    view, found = recognize_view(gathered, plain, models, recognize)
    assert view is (gathered if taken == "gathered" else plain)
    assert found.classes[0].name == (gathered_as if taken == "gathered" else plain_as)[0]
    assert seen == ["gathered", "plain"]
    assert recognize_view(plain, plain, models, recognize)[0] is plain
    assert recognize_view(gathered, plain, models[:1], recognize)[0] is (
        gathered if gathered_as[0] == "invoice" else plain
    )
    assert len(seen) == (4 if gathered_as[0] == "invoice" else 5), (
        "a class alone with its table is asked once"
    )


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


def corrected(
    page: InvoicePage, model: ModelDocument, extra: list[dict[str, Any]], found: Any = None
) -> tuple[dict[str, Any], RevisedPage, Adaptation]:
    """The result of a page as it is after feedback with more zones, as the app makes it."""
    kept = found_page(page)
    found = found or {**recognize_again(kept, [model], SETTINGS, words=False), "width": 1240, "height": 1754}
    given = [{name: zone[name] for name in ("box", "label", "kind")} for zone in found["zones"]]
    revised = revise_page(kept, [*given, *extra], SETTINGS)  # type: ignore[list-item]
    labels = {zone["id"]: zone["label"] for zone in revised.zones}
    told = VerifiedPage(revised.page, "invoice", labels, "invoice", labels, kept)
    adaptation = adapt_models(told, [model], SETTINGS, ITEMS)
    texts = frozenset(each.zone for each in revised.texts)
    said = Correction("invoice", labels, texts, TYPES, None, 0.01, ITEMS, adaptation.tables)
    return cast(dict[str, Any], correct_result(found, revised.zones, said)), revised, adaptation


def shown_texts(result: dict[str, Any]) -> list[list[str | None]]:
    return [[cell and cell["text"] for cell in row] for table in result["tables"] for row in table["rows"]]


def test_a_corrected_cell_shows_in_the_table(document: dict[str, Any]) -> None:
    [page] = made(ALDER, 20)
    row = page.rows[2]
    cell = {"box": list(row["amount"].box), "label": "amount", "kind": "text", "text": "1,234.50"}  # type: ignore[index]
    result, revised, _ = corrected(page, stored(document), [cell])
    expected = [[row[label].text for label in ITEMS] for row in page.rows]
    assert shown_texts(result) == [*expected[:2], [*expected[2][:3], "1,234.50"], *expected[3:]]
    [table] = result["tables"]
    shown = table["rows"][2][3]
    assert (shown["value"], shown["confidence"]) == ("1234.50", 1.0)
    assert shown["found"]["text"] == row["amount"].text
    assert table["checks"] == {"products": None, "unlike_rows": [], "sum": None}
    assert "amount" not in {field["label"] for field in result["fields"]}
    assert [(text.found, text.verified) for text in revised.texts] == [(row["amount"].text, "1,234.50")]


def test_rows_follow_from_the_cells_of_one(document: dict[str, Any]) -> None:
    """The table was not found: the words above its columns are another firm's."""
    [page] = made(AHRENS, 1)
    model = stored(document)
    found: Any = recognize_again(found_page(page), [model], SETTINGS, words=False)
    found = {
        **found,
        "width": 1240,
        "height": 1754,
        "tables": [],
        "class": {**found["classes"][0], "probability": 1.0},
    }
    result, _, _ = corrected(page, model, given_cells(page, rows=1), found)
    assert shown_texts(result) == [[row[label].text for label in ITEMS] for row in page.rows]


def test_cells_without_any_table_make_one() -> None:
    """The class has no table yet: its first cells begin one, and are no labels of the graph."""
    [page] = made(ALDER, 20)
    plain: Any = [{**sample(ALDER, seed), "zones": sample(ALDER, seed)["zones"][:4]} for seed in range(3)]
    document = json.loads(json.dumps(initialize_from_samples("invoice", plain, SETTINGS, ITEMS).document))
    assert document.get("table") is None
    result, _, adaptation = corrected(page, stored(document), given_cells(page, rows=2))
    expected = [[row[label].text for label in ITEMS] for row in page.rows]
    assert shown_texts(result)[:2] == expected[:2]
    learned = json.loads(json.dumps(adaptation.documents["invoice"]))
    assert [column["label"] for column in learned["table"]["columns"]] == list(ITEMS)
    assert {node["label"] for node in learned["nodes"]}.isdisjoint(ITEMS)


def test_another_zone_takes_a_row_away(document: dict[str, Any]) -> None:
    [page] = made(ALDER, 20)
    boxes = [page.rows[-1][label].box for label in ITEMS]  # type: ignore[index]
    hull = [
        min(box[0] for box in boxes),
        min(box[1] for box in boxes),
        max(box[2] for box in boxes),
        max(box[3] for box in boxes),
    ]
    for label in ("note", None):
        result, _, _ = corrected(page, stored(document), [{"box": hull, "label": label, "kind": "text"}])
        assert len(shown_texts(result)) == len(page.rows) - 1


@pytest.mark.parametrize("left", ["left out", "body", "with a cell", "as found"])
def test_a_table_goes_with_its_zone(document: dict[str, Any], left: str) -> None:
    """The zone that it lies in gets another label, or is left out with nothing drawn there."""
    [page] = made(ALDER, 20)
    kept = found_page(page)
    found: Any = {**recognize_again(kept, [stored(document)], SETTINGS, words=False), "width": 1240}
    [table] = found["tables"]
    outside = [zone for zone in found["zones"] if not holds_middle(table["box"], zone["box"])]
    whole = {**found["zones"][0], "id": "table", "label": None, "box": table["box"]}
    found["zones"] = [*outside, whole]
    cell = {**whole, "id": "c", "label": "amount", "text": "9.99", "box": list(page.rows[0]["amount"].box)}  # type: ignore[index]
    given = {"left out": [], "body": [{**whole, "label": "body"}], "with a cell": [cell], "as found": [whole]}
    said = Correction("invoice", {}, frozenset(), TYPES, None, 0.01, ITEMS)
    tables, _ = correct_tables(found, [*outside, *given[left]], said)
    rows = [len(each["rows"]) for each in tables]
    assert rows == ([] if left in ("left out", "body") else [len(page.rows)])


@pytest.mark.parametrize(
    ("labels", "rows"), [(ITEMS, 3), (("amount",), 3), (("quantity", "amount"), 2)], ids=str
)
def test_a_box_of_several_cells_is_not_one(
    document: dict[str, Any], labels: Sequence[str], rows: int
) -> None:
    [page] = made(ALDER, 20)
    boxes = [row[label].box for row in page.rows[:rows] for label in labels]  # type: ignore[index]
    x0, y0, x1, y1 = zip(*boxes, strict=True)
    zone = {"box": [min(x0), min(y0), max(x1), max(y1)], "label": "amount", "kind": "text"}
    with pytest.raises(InvalidOption, match="holds several cells") as refused:
        corrected(page, stored(document), [zone])
    assert str(refused.value.field).startswith("labels.")
    wide = {**sample(ALDER, 20), "zones": [{"id": "wide", **zone}]}
    warnings = initialize_from_samples("invoice", [wide], SETTINGS, ["amount"]).warnings  # type: ignore[list-item]
    assert "several-cells-in-box" in [each.code for each in warnings]


def test_zones_are_known_by_their_places_and_cells_by_their_words(document: dict[str, Any]) -> None:
    """So zones without ids, and cells whose texts were read right, are no errors."""
    [page] = made(ALDER, 20)
    cells = [
        {"box": list(row[label].box), "label": label, "kind": "text", "text": row[label].text}  # type: ignore[index]
        for row in page.rows[:2]
        for label in ITEMS
    ]
    result, revised, adaptation = corrected(page, stored(document), cells)
    assert {zone["id"] for zone in result["zones"]} >= {zone["id"] for zone in found_page(page)["zones"]}
    assert [text.edits for text in revised.texts] == [0] * len(cells)
    assert adaptation.wrong == []


def test_texts_of_places_without_words_are_not_judged() -> None:
    """A stored page of zones without words does not say what was read in a part of one."""
    zone: Any = {
        "id": "z1",
        "box": [0, 0, 900, 40],
        "text": "Glass pane 7 12.00",
        "kind": "text",
        "label": None,
    }
    kept: PageJson = {"width": 1000, "height": 1000, "zones": [zone]}
    part: Any = {"box": [700, 0, 900, 40], "label": "amount", "text": "12.00"}
    whole: Any = {"box": [0, 0, 900, 40], "label": None, "text": "Glass pane 7 12.00"}
    assert [text.zone for text in revise_page(kept, [whole, part], SETTINGS).texts] == ["z1"]


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

"""GET /layout/results: pages of results with their values, as JSON, JSON lines, CSV and XLSX."""

import csv
import io
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any, TypeVar

import httpx
import openpyxl
import pytest

from app.schemas.layout_results import LIST_MEDIA_TYPES
from app.storage.layout_store import DATABASE
from models.documents import decode_measured
from models.records import ResultDraft, ReviewDraft
from models.repository import Store
from tests.app.serving import serving
from tests.app.test_problems import assert_problem

KEYS = ({"X-API-Key": "alice-secret"}, {"X-API-Key": "bob-secret"})
TEXTS = ("March 3, 1998", '=HYPERLINK("http://example.org")', 'comma, "quote"\nline', "Ärger")

T = TypeVar("T")


def result_with(text: str, value: str | None, kind: str) -> dict[str, Any]:
    of_class = {"name": "letter", "model_version": 1, "cost": 1.0, "probability": 0.9}
    field = {"label": "x", "text": text, "type": kind, "value": value, "confidence": 0.5, "zones": ["z1"]}
    return {"result": {"class": of_class, "fields": [field], "zones": []}, "page": {}}


LARGE = result_with("x" * 20_000, None, "text")


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with results of two keys, the oldest first: the texts, then a phone number of the other key."""
    folder = tmp_path_factory.mktemp("results")
    with Store.open(folder / DATABASE) as store:
        for text in TEXTS:
            store.add_result(result_with(text, text, "text"), 1000, owner="alice")
        store.add_result(result_with("+49 30 1", "+49301", "phone"), 1000, owner="bob")
    return folder


@pytest.fixture(scope="module")
def client(results: Path) -> Iterator[httpx.Client]:
    with serving(api_keys=("alice:alice-secret", "bob:bob-secret"), data_dir=results) as client:
        yield client


def test_a_list_is_read_page_by_page(client: httpx.Client) -> None:
    seen, path = [], "/layout/results?limit=3"
    while path:
        response = client.get(path, headers=KEYS[0])
        assert response.status_code == 200, response.text
        body = response.json()
        seen += [entry["fields"][0]["text"] for entry in body["results"]]
        path = response.links.get("next", {}).get("url", "")
        assert (body["next"] is None) == (path == "")
    assert seen == list(TEXTS[::-1])
    first = client.get("/layout/results?limit=1", headers=KEYS[1]).json()["results"][0]
    assert (first["state"], first["class"], first["fields"][0]["value"]) == ("open", "letter", "+49301")


def test_csv_has_a_row_for_each_value_and_no_formula(client: httpx.Client) -> None:
    response = client.get("/layout/results", params={"format": "csv"}, headers=KEYS[0])
    assert response.headers["content-type"].startswith("text/csv")
    rows = list(csv.DictReader(io.StringIO(response.text)))
    assert [row["text"] for row in rows] == [TEXTS[3], TEXTS[2], "'" + TEXTS[1], TEXTS[0]]
    assert {row["class"] for row in rows} == {"letter"}
    phones = client.get("/layout/results", headers={**KEYS[1], "Accept": "text/csv"})
    [row] = csv.DictReader(io.StringIO(phones.text))
    assert (row["value"], row["text"], row["type"]) == ("+49301", "'+49 30 1", "phone")


def test_json_lines_have_a_result_a_line(client: httpx.Client) -> None:
    response = client.get("/layout/results?format=jsonl", headers=KEYS[0])
    assert response.headers["content-type"] == "application/jsonl"
    lines = [json.loads(line) for line in response.text.split("\n") if line]
    assert lines == client.get("/layout/results", headers=KEYS[0]).json()["results"]


@pytest.mark.parametrize(
    "query", ["limit=0", "limit=201", "cursor=abc", "state=lost", "format=xml", "order=1"]
)
def test_bad_queries_name_the_option(client: httpx.Client, query: str) -> None:
    problem = assert_problem(client.get(f"/layout/results?{query}", headers=KEYS[0]), 422, "invalid-option")
    assert problem["field"] == query.partition("=")[0]


def test_another_format_is_not_acceptable(client: httpx.Client) -> None:
    assert_problem(
        client.get("/layout/results", headers={**KEYS[0], "Accept": "image/png"}), 406, "not-acceptable"
    )
    assert client.get("/layout/results", headers={**KEYS[0], "Accept": "text/*"}).text.startswith("result,")


@pytest.mark.parametrize("order", ["newest", "gain"])
def test_a_list_of_large_results_has_short_pages(
    order: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One result is over the bound already: every page has one, and the links lead through all of them."""
    decoded = []

    def count(stored: bytes, shape: type[T]) -> tuple[T, int]:
        decoded.append(len(stored))
        return decode_measured(stored, shape)

    with Store.open(tmp_path / DATABASE) as store:
        place = ReviewDraft(1.0, 0.5, "letter", 1, "review")
        ids = [store.add_result(LARGE, 1000, review=place) for _ in range(4)]
    monkeypatch.setattr("app.routes.layout_results.MOST_LISTED_BYTES", 10_000)
    monkeypatch.setattr("models.result_repository.decode_measured", count)
    with serving(data_dir=tmp_path) as client:
        seen, path, answers = [], f"/layout/results?order={order}", 0
        while path:
            response = client.get(path)
            answers += 1
            seen += [entry["id"] for entry in response.json()["results"]]
            path = response.links.get("next", {}).get("url", "")
    assert (seen, answers) == (ids[::-1], 4)
    assert len(decoded) == 4 + 3  # and of each answer but the last the one after it


HOSTILE = (
    "=1+1",
    "+1",
    "-1",
    "@SUM(A1)",
    "#REF!",
    "a\x07\ud7ff\ufffe",
    "x" * 40_000,
    "two\nlines",
    " spaced ",
    "Ärger",
)


def page(
    *fields: tuple[str, str, str | None], of_class: str | None = "invoice", name: str | None = None
) -> dict[str, Any]:
    """A stored result of a page; `fields` have label, text and value. Without a name it is that of an older release."""
    found = of_class and {"name": of_class, "model_version": 1, "cost": 1.0, "probability": 0.9}
    shown = [
        {"label": label, "text": text, "value": value, "confidence": 0.5, "zones": ["z"]}
        for label, text, value in fields
    ]
    result = {"class": found, "fields": shown, "zones": []}
    return {"result": result if name is None else {**result, "file_name": name}, "page": {}}


def sheet_of(response: httpx.Response) -> list[list[Any]]:
    """The cells of the only sheet, None where one is empty; none of them is a formula."""
    assert response.status_code == 200, response.text
    assert response.headers["content-type"] == LIST_MEDIA_TYPES["xlsx"]
    [sheet] = openpyxl.load_workbook(io.BytesIO(response.content))
    assert {cell.data_type for row in sheet for cell in row} <= {"s", "inlineStr", "n"}
    return [list(row) for row in sheet.values]


def test_a_workbook_has_the_texts_of_csv_and_none_is_a_formula(tmp_path: Path) -> None:
    """Hostile texts as label, value, text and file name, in both kinds of rows."""
    texts = HOSTILE[::-1]
    clean = [text[:32_767].replace("\x07", "").replace("\ufffe", "") for text in texts]
    quoted = [f"'{text}" if text[0] in "=+-@" else text for text in texts]
    with Store.open(tmp_path / DATABASE) as store:
        for text in HOSTILE:
            store.add_result(page((text, text, text), name=text[:200]), 1000)
    with serving(data_dir=tmp_path) as client:
        for rows in ("values", "documents"):
            query = {"rows": rows, "format": "xlsx"}
            response = client.get("/layout/results", params=query)
            assert f'filename="{rows}.xlsx"' in response.headers["content-disposition"]
            cells = sheet_of(response)
            text = client.get("/layout/results", params={**query, "format": "csv"}).text
            plain = [[cell or None for cell in row] for row in csv.reader(io.StringIO(text))]
            assert not any((cell or "").startswith(("=", "+", "-", "@")) for row in plain for cell in row)
            assert len(cells) == len(plain) == 1 + len(HOSTILE)
            for table, expected in ((cells, clean), (plain, quoted)):
                names, *values = table
                files = [text[:200] for text in expected]
                found = [(row[names.index("file_name")] or "")[:200] for row in values]
                assert found == files
                if rows == "values":
                    for name in ("label", "value", "text"):
                        assert [row[names.index(name)] for row in values] == expected
                else:
                    assert [[each for each in row[6::2] if each] for row in values] == [
                        [each] for each in expected
                    ]


def test_a_row_a_document(tmp_path: Path) -> None:
    """Two classes, a document of three pages, and of older releases a nameless result and a page."""
    invoice = [
        page(("date", "3/3/98", None), ("total", "", None), name="stack.pdf"),
        page(("total", "EUR 5", "5.00"), of_class="invoice-later", name="stack.pdf"),
        page(("date", "March 3", "1998-03-03"), ("total", "EUR 6", "6.00"), name="stack.pdf"),
    ]
    place = ReviewDraft(1.0, 0.5, "letter", 1, "review")
    with Store.open(tmp_path / DATABASE) as store:
        old = store.add_result(page(("sender", "Ann", "Ann"), of_class="letter"), 1000, review=place)
        whole, _ = store.add_document({"document": {}}, [ResultDraft(each) for each in invoice], 1000)
        parted = store.add_result({**invoice[0], "in_document": True}, 1000)
        new = store.add_result(page(("date", "x", None), of_class="letter", name="n.png"), 1000)
    columns = ["result", "file_name", "created", "state", "class", "probability"]
    columns += ["date", "date confidence", "sender", "sender confidence", "total", "total confidence"]
    with serving(data_dir=tmp_path) as client:
        names, first, *rest = sheet_of(client.get("/layout/results?format=xlsx&rows=documents"))
        assert names == columns
        assert [first[0], *first[3:]] == [new, "open", "letter", 0.9, "x", 0.5, None, None, None, None]
        single, kept, last = rest
        assert [*single[:2], single[6]] == [parted, "stack.pdf", "3/3/98"]
        assert kept[:2] == [whole, "stack.pdf"]
        assert kept[3:] == ["open", "invoice", 0.9, "1998-03-03", 0.5, None, None, "5.00", 0.5]
        assert [*last[:2], *last[4:]] == [old, None, "letter", 0.9, None, None, "Ann", 0.5, None, None]

        # No answer ends within a document, however few were asked for.
        seen, path = [], "/layout/results?format=csv&rows=documents&limit=1"
        while path:
            response = client.get(path)
            seen += [row["result"] for row in csv.DictReader(io.StringIO(response.text))]
            path = response.links.get("next", {}).get("url", "")
        assert seen == [row[0] for row in (first, *rest)]


def cell(value: str, confidence: float = 0.9) -> dict[str, Any]:
    return {"box": [0, 0, 9, 9], "text": value, "value": value, "confidence": confidence}


def items(
    *rows: list[dict[str, Any] | None], columns: tuple[str, ...] = ("item", "amount")
) -> dict[str, Any]:
    names, types = list(columns), ["text", "amount"][: len(columns)]
    return {"columns": names, "types": types, "headers": names, "box": [0, 0, 9, 9], "rows": list(rows)}


def with_items(page: dict[str, Any], *tables: dict[str, Any]) -> dict[str, Any]:
    return {**page, "result": {**page["result"], "tables": list(tables)}}


def test_a_row_an_item(tmp_path: Path) -> None:
    """A table that goes on over two pages, a class of other columns, and a document without a table."""
    first = with_items(page(name="a.pdf"), items([cell("=Oak"), cell("4.50", 0.7)], [cell("Ash"), None]))
    second = with_items(page(name="a.pdf"), items([cell("Elm"), cell("-6.00")]))
    other = with_items(page(of_class="list/of [x]", name="b.png"), items([cell("7")], columns=("hours",)))
    with Store.open(tmp_path / DATABASE) as store:
        single = store.add_result(other, 1000)
        whole, _ = store.add_document({"document": {}}, [ResultDraft(each) for each in (first, second)], 1000)
        store.add_result(page(("date", "x", None), of_class="letter"), 1000)
    with serving(data_dir=tmp_path) as client:
        text = client.get("/layout/results?format=csv&rows=items").text
        found = [
            [
                row[name]
                for name in ("result", "table", "page", "row", "confidence", "item", "amount", "hours")
            ]
            for row in csv.DictReader(io.StringIO(text))
        ]
        assert found == [
            [whole, "1", "1", "1", "0.7", "'=Oak", "4.50", ""],
            [whole, "1", "1", "2", "0.9", "Ash", "", ""],
            [whole, "1", "2", "3", "0.9", "Elm", "-6.00", ""],
            [single, "1", "1", "1", "0.9", "", "", "7"],
        ]
        response = client.get("/layout/results?format=xlsx&rows=documents")
        book = openpyxl.load_workbook(io.BytesIO(response.content))
        assert book.sheetnames == ["documents", "items invoice", "items listof x"]
        names, *rows = book["items invoice"].values
        assert names[-2:] == ("item", "amount")
        assert [row[-2:] for row in rows] == [("=Oak", "4.50"), ("Ash", None), ("Elm", "-6.00")]
        assert {each.data_type for row in book["items invoice"] for each in row} <= {"s", "inlineStr", "n"}
        lines = client.get("/layout/results?format=jsonl").text.splitlines()
        assert [len(json.loads(line)["tables"]) for line in lines] == [0, 1, 1, 1]


def test_each_column_has_a_name_of_its_own(tmp_path: Path) -> None:
    """Labels may be called as columns that tables of results have anyway."""
    labels = ("class", "sum", "sum confidence")
    table = items([cell("x"), cell("y")], columns=("table", "amount"))
    with Store.open(tmp_path / DATABASE) as store:
        store.add_result(with_items(page(*[(label, label, None) for label in labels]), table), 1000)
    with serving(data_dir=tmp_path) as client:
        first = client.get("/layout/results?format=csv&rows=items").text.splitlines()[0]
        assert first.split(",")[3:] == ["table", "page", "row", "confidence", "table (label)", "amount"]
        [row] = csv.DictReader(io.StringIO(client.get("/layout/results?format=csv&rows=documents").text))
        assert len(row) == 6 + 2 * len(labels)
        assert (row["class"], row["class (label)"]) == ("invoice", "class")
        assert (row["sum"], row["sum confidence (label)"]) == ("sum", "sum confidence")


def test_a_document_of_no_known_class_has_no_values_in_its_row(tmp_path: Path) -> None:
    """Its labels are those of the nearest class; a row of each value shows them all the same."""
    with Store.open(tmp_path / DATABASE) as store:
        store.add_result(page(("total", "void draw() 3.2", "3.20"), of_class=None), 1000)
        store.add_result(page(("total", "EUR 5", "5.00")), 1000)
    with serving(data_dir=tmp_path) as client:
        path = "/layout/results?format=csv"
        rows = [*csv.DictReader(io.StringIO(client.get(f"{path}&rows=documents").text))]
        assert {(row["class"], row["total"], row["total confidence"]) for row in rows} == {
            ("", "", ""),
            ("invoice", "5.00", "0.5"),
        }
        values = [*csv.DictReader(io.StringIO(client.get(path).text))]
        assert {(row["class"], row["value"]) for row in values} == {("", "3.20"), ("invoice", "5.00")}


def test_rows_are_of_tables_only(client: httpx.Client) -> None:
    problem = assert_problem(client.get("/layout/results?rows=pages", headers=KEYS[0]), 422, "invalid-option")
    assert problem["field"] == "rows"
    for path in ("/layout/results?limit=2", "/layout/results?limit=2&format=jsonl"):
        plain, other = (client.get(f"{path}{more}", headers=KEYS[0]).text for more in ("", "&rows=documents"))
        assert plain == other


def test_keys_see_their_own_rows(client: httpx.Client) -> None:
    for rows in ("values", "documents"):
        query = {"format": "xlsx", "rows": rows}
        alice, bob = (sheet_of(client.get("/layout/results", params=query, headers=key)) for key in KEYS)
        assert (len(alice), len(bob)) == (1 + len(TEXTS), 2)
        assert not {row[0] for row in alice[1:]} & {row[0] for row in bob[1:]}


def test_more_labels_than_a_sheet_has_room_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("app.routes.result_tables.MOST_LABELS", 2)
    with Store.open(tmp_path / DATABASE) as store:
        store.add_result(page(*[(label, "x", None) for label in "abc"]), 1000)
        store.add_result(page(*[(label, "x", None) for label in "ab"]), 1000)
    with serving(data_dir=tmp_path) as client:
        path = "/layout/results?format=csv&rows=documents"
        assert_problem(client.get(path), 422, "invalid-option")
        assert client.get(f"{path}&limit=1").text.count(" confidence") == 2

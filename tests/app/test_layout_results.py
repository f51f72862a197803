"""GET /layout/results: pages of results with their values, as JSON, JSON lines and CSV."""

import csv
import io
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from app.storage.layout_store import DATABASE
from models.documents import decode_measured
from models.records import ReviewDraft
from models.repository import Store
from tests.app.serving import serving
from tests.app.test_problems import assert_problem

KEYS = ({"X-API-Key": "alice-secret"}, {"X-API-Key": "bob-secret"})
TEXTS = ("March 3, 1998", '=HYPERLINK("http://example.org")', 'comma, "quote"\nline', "Ärger")


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

    def count(stored: bytes) -> tuple[dict[str, Any], int]:
        decoded.append(len(stored))
        return decode_measured(stored)

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

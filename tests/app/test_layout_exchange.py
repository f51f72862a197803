"""Classes leave one service and come to another: models, settings and samples, each once."""

import io
import json
import zipfile
from collections.abc import Iterator, Mapping
from typing import Any

import httpx
import pytest

from app.routes import layout_exchange
from tests.app.scripted_layout import PAGE
from tests.app.scripted_models import model_document
from tests.app.serving import serving
from tests.app.test_problems import assert_problem

NAMES = ("fax", "letter", "letter-later")


@pytest.fixture(scope="module")
def source() -> Iterator[httpx.Client]:
    """A service with a class without a model, one with samples and a model, and one that continues it."""
    with serving() as client:
        for name in NAMES[1:]:
            client.put(f"/layout/models/{name}", json=model_document(name, "sender")).raise_for_status()
        for name, text in (("fax", "a"), ("letter", "b"), ("letter", "c")):
            page = {**PAGE, "zones": [{**PAGE["zones"][0], "label": "sender", "text": text}]}
            client.post(f"/layout/models/{name}/samples", json=page).raise_for_status()
        settings = {
            "learner": "counting",
            "genre": "mail",
            "fields": {"sender": {"type": "email"}},
            "elements": {"sender": "address"},
            "items": ["description", "amount"],
        }
        client.patch("/layout/models/letter/settings", json=settings).raise_for_status()
        client.patch("/layout/models/letter-later/settings", json={"continues": "letter"}).raise_for_status()
        yield client


def export(client: httpx.Client, **query: str) -> bytes:
    response = client.get("/layout/export", params=query)
    assert (response.status_code, response.headers["content-type"]) == (200, "application/zip")
    assert "layout-models.zip" in response.headers["content-disposition"]
    return response.content


def send(client: httpx.Client, content: bytes) -> httpx.Response:
    return client.post("/layout/import", files={"archive": ("models.zip", content)})


def contents(client: httpx.Client) -> dict[str, Any]:
    """Everything of the classes that another service should have too."""
    known: dict[str, Any] = {}
    for name in (each["name"] for each in client.get("/layout/models").json()["models"]):
        path = f"/layout/models/{name}"
        ids = [each["id"] for each in client.get(f"{path}/samples").json()["samples"]]
        pages = [client.get(f"{path}/samples/{id}").json() for id in ids]
        model = client.get(path)
        known[name] = (
            model.json() if model.status_code == 200 else None,
            client.get(f"{path}/settings").json(),
            sorted(json.dumps(page["zones"]) for page in pages),
        )
    return known


def test_another_service_has_the_same_classes(source: httpx.Client) -> None:
    archive = export(source)
    with serving() as target:
        report = send(target, archive).json()["models"]
        assert [(each["name"], each["version"], each["changed"]) for each in report] == [
            ("fax", None, False),
            ("letter", 1, True),
            ("letter-later", 1, True),
        ]
        assert [each["samples_added"] for each in report] == [1, 2, 0]
        assert [each["problems"] for each in report] == [[], [], []]
        assert contents(target) == contents(source)
        again = send(target, archive).json()["models"]
        assert [each["changed"] for each in again] == [False] * 3
        assert [(each["samples_added"], each["samples_known"]) for each in again] == [(0, 1), (0, 2), (0, 0)]
        assert contents(target) == contents(source)


def test_one_class_alone(source: httpx.Client) -> None:
    with zipfile.ZipFile(io.BytesIO(export(source, models="fax"))) as archive:
        assert {name.split("/")[1] for name in archive.namelist() if name.startswith("models/")} == {"fax"}
        assert json.loads(archive.read("manifest.json"))["models"][0]["name"] == "fax"
    assert_problem(source.get("/layout/export", params={"models": "fax,nobody"}), 404, "not-found")
    assert_problem(source.get("/layout/export", params={"models": "a b"}), 422, "invalid-option")


def test_a_class_whose_first_pages_are_missing_is_imported_and_told(source: httpx.Client) -> None:
    with serving() as target:
        [report] = send(target, export(source, models="letter-later")).json()["models"]
        assert (report["version"], [each["code"] for each in report["problems"]]) == (1, ["not-found"])


def packed(files: Mapping[str, bytes]) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return buffer.getvalue()


def manifest(**changes: Any) -> bytes:
    whole = {
        "format": "layout-models",
        "format_version": 1,
        "models": [{"name": "memo", "settings": {}}],
        **changes,
    }
    return json.dumps(whole).encode()


def test_a_file_that_cannot_be_used_does_not_stop_the_others(source: httpx.Client) -> None:
    page = {**PAGE, "zones": [{**PAGE["zones"][0], "label": "sender"}]}
    files = {
        "manifest.json": manifest(),
        "models/memo/model.json": b"{}",
        "models/memo/samples/1.json": b"no JSON",
        "models/memo/samples/2.json": json.dumps(page).encode(),
        "models/other/samples/3.json": b"not in the manifest",
    }
    [report] = send(source, packed(files)).json()["models"]
    assert (report["samples_added"], report["version"]) == (1, None)
    assert [(each["file"], each["code"]) for each in report["problems"]] == [
        ("models/memo/model.json", "invalid-model"),
        ("models/memo/samples/1.json", "invalid-option"),
    ]
    source.delete("/layout/models/memo").raise_for_status()


def test_a_report_is_short(source: httpx.Client, monkeypatch: pytest.MonkeyPatch) -> None:
    """It lists a bounded number of problems of all classes together, and begins of names."""
    assert layout_exchange._MOST_PROBLEMS == 1000
    monkeypatch.setattr(layout_exchange, "_MOST_PROBLEMS", 10)
    files = {f"models/memo/samples/{number}{'x' * 900}.json": b"" for number in range(11)}
    classes = [{"name": "memo", "settings": {}}, {"name": "fax-2", "settings": {}}]
    content = packed(
        {"manifest.json": manifest(models=classes), **files, "models/fax-2/samples/1.json": b"", "other": b""}
    )
    memo, fax = send(source, content).json()["models"]
    assert (len(memo["problems"]), memo["more_problems"]) == (10, 2), "a file's and that of the settings"
    assert (fax["problems"], fax["more_problems"]) == ([], 2)
    assert {(len(each["file"]), each["file"][-1]) for each in memo["problems"]} == {(200, "…")}
    assert not any("xx" in each["detail"] for each in memo["problems"])


def test_the_path_of_a_file_is_told_once(source: httpx.Client) -> None:
    files = {"models/memo/model.json": b" " * 9, "models/memo/samples/1.json": b"x" * 99}
    damaged = packed({"manifest.json": manifest(), **files}).replace(b"xxxx", b"yxxx", 1)
    [report] = send(source, damaged).json()["models"]
    [_, problem, _] = report["problems"]
    assert problem["file"] == "models/memo/samples/1.json"
    assert problem["detail"] == "This file of the archive is damaged; pack it again."


@pytest.mark.parametrize(
    "content",
    [
        b"no archive",
        packed({"models/letter/model.json": b"{}"}),
        packed({"manifest.json": b"[]"}),
        packed({"manifest.json": manifest(format_version=2)}),
        packed({"manifest.json": manifest(models=[{"name": "../up", "settings": {}}])}),
        packed({"manifest.json": manifest(models=[{"name": "a", "settings": {"learner": "magic"}}])}),
        packed({"manifest.json": manifest(models=[{"name": "a", "settings": {}}] * 2)}),
        packed({"manifest.json": manifest()}).replace(b"layout", b"LAYOUT", 1),
    ],
    ids=[
        "no archive",
        "no manifest",
        "a list",
        "another version",
        "a path as a name",
        "an unknown learner",
        "a class twice",
        "a damaged manifest",
    ],
)
def test_what_is_no_export_is_refused(source: httpx.Client, content: bytes) -> None:
    assert assert_problem(send(source, content), 422, "invalid-option")["field"] == "archive"

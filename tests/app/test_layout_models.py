"""/layout/models: import, export, versions, initialization; who may write what."""

import json
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import httpx
import pytest

from app.learning import samples as model_samples
from tests.app.raw import connect, head, read_answer
from tests.app.scripted_layout import PAGE
from tests.app.scripted_models import model_document
from tests.app.serving import serving
from tests.app.test_problems import assert_problem
from tests.app.test_uploads import code

LETTER = model_document("letter", "sender", "date")


@pytest.fixture
def client(empty_service: httpx.Client) -> httpx.Client:
    """A service that remembers nothing yet."""
    return empty_service


@pytest.fixture(scope="module")
def shared() -> Iterator[httpx.Client]:
    """A service for requests that leave nothing behind but models of names of their own."""
    with serving() as client:
        yield client


def labelled(*labels: str | None, text: str | None = None) -> dict[str, Any]:
    zones = [
        {"id": str(index), "box": [0, index, 9, index + 1], "label": label, "text": text}
        for index, label in enumerate(labels)
    ]
    return {"width": 10, "height": 20, "zones": zones}


def add_samples(client: httpx.Client, *pages: dict[str, Any], name: str = "letter") -> None:
    for page in pages:
        assert client.post(f"/layout/models/{name}/samples", json=page).status_code == 201


def test_what_is_exported_can_be_imported(client: httpx.Client) -> None:
    first = client.put("/layout/models/letter", json=LETTER)
    assert (first.status_code, first.headers["etag"]) == (201, '"1"')
    assert first.headers["location"] == "/layout/models/letter"
    assert first.json() == {"name": "letter", "version": 1, "labels": ["sender", "date"]}
    exported = client.get("/layout/models/letter")
    assert (exported.headers["content-type"], exported.headers["etag"]) == ("application/json", '"1"')
    assert exported.json() == LETTER
    again = client.put("/layout/models/letter", content=exported.content)
    assert (again.status_code, again.headers["etag"], again.json()["version"]) == (200, '"2"', 2)
    assert "location" not in again.headers
    assert client.get("/layout/models/letter").content == exported.content


def test_every_version_is_kept(client: httpx.Client) -> None:
    for label in ("one", "two", "three"):
        client.put("/layout/models/letter", json=model_document("letter", label))
    for version, label in ((1, "one"), (2, "two"), (3, "three")):
        response = client.get("/layout/models/letter", params={"version": version})
        assert response.headers["etag"] == f'"{version}"'
        assert response.json()["nodes"][1]["label"] == label
    assert_problem(client.get("/layout/models/letter?version=4"), 404, "not-found")
    versions = client.get("/layout/models/letter/versions").json()
    assert versions["name"] == "letter"
    assert [entry["version"] for entry in versions["versions"]] == [3, 2, 1]
    assert {entry["origin"] for entry in versions["versions"]} == {"import"}


@pytest.mark.parametrize("version", ["0", "-1", "one", "1.5", ""])
def test_versions_are_numbers(shared: httpx.Client, version: str) -> None:
    problem = assert_problem(shared.get(f"/layout/models/letter?version={version}"), 422, "invalid-option")
    assert problem["field"] == "version"


def test_the_list_is_light(client: httpx.Client) -> None:
    assert client.get("/layout/models").json() == {"models": []}
    client.put("/layout/models/letter", json=LETTER)
    add_samples(client, labelled("subject"), name="fax")
    models = client.get("/layout/models").json()["models"]
    assert [list(model) for model in models] == [
        ["name", "version", "samples", "labels", "health", "created", "updated"]
    ] * 2
    assert [(m["name"], m["version"], m["samples"], m["labels"]) for m in models] == [
        ("fax", None, 1, []),
        ("letter", 1, 0, ["sender", "date"]),
    ]
    assert models[0]["created"] <= models[0]["updated"]


@pytest.mark.parametrize("name", ["letter", "a", "A.b_c-9", "-", "x" * 60])
def test_good_names(shared: httpx.Client, name: str) -> None:
    document = model_document(name)
    assert shared.put(f"/layout/models/{name}", json=document).status_code == 201
    assert shared.get(f"/layout/models/{name}").json() == document


@pytest.mark.parametrize("name", [".hidden", "a b", "é", "x" * 61, "a,b"])
def test_bad_names(shared: httpx.Client, name: str) -> None:
    for response in (
        shared.get(f"/layout/models/{name}"),
        shared.put(f"/layout/models/{name}", json=LETTER),
        shared.delete(f"/layout/models/{name}"),
        shared.get(f"/layout/models/{name}/versions"),
        shared.post(f"/layout/models/{name}/initialize"),
        shared.post(f"/layout/models/{name}/samples", json=labelled("a")),
        shared.get(f"/layout/models/{name}/samples"),
        shared.get(f"/layout/models/{name}/samples/1"),
    ):
        problem = assert_problem(response, 422, "invalid-option")
        assert problem["field"] == "name"
        assert "1-60 letters" in str(problem["detail"])


def test_no_such_model(client: httpx.Client) -> None:
    for response in (
        client.get("/layout/models/letter"),
        client.delete("/layout/models/letter"),
        client.get("/layout/models/letter/versions"),
        client.post("/layout/models/letter/initialize"),
        client.get("/layout/models/letter/samples"),
        client.get("/layout/models/letter/samples/1"),
        client.delete("/layout/models/letter/samples/1"),
    ):
        assert "letter" in str(assert_problem(response, 404, "not-found")["detail"])


@pytest.mark.parametrize("body", [b"", b"{", b"[]", b"null", b'{"format": 1}', b'{"format": "x"}', b"\xff"])
def test_what_is_no_model(shared: httpx.Client, body: bytes) -> None:
    assert_problem(shared.put("/layout/models/nothing", content=body), 422, "invalid-model")
    assert_problem(shared.get("/layout/models/nothing"), 404, "not-found")


def test_a_model_that_kills_the_worker_is_not_kept(client: httpx.Client) -> None:
    response = client.put("/layout/models/letter", json={**LETTER, "script": "do:segfault"})
    assert_problem(response, 500, "worker-died")
    assert client.get("/layout/models").json() == {"models": []}


def test_imports_have_a_limit_of_their_own() -> None:
    with serving(max_model_bytes=2000) as client:
        assert client.put("/layout/models/a", json=model_document("a")).status_code == 201
        with connect(client) as connection:
            request = head(2001, "/layout/models/a").replace(b"POST", b"PUT", 1)
            connection.sendall(request)  # and nothing of the body
            answer = read_answer(connection)
        assert (answer.status, code(answer)) == (413, "too-large")
        assert b"MAX_MODEL_BYTES" in answer.body


def test_a_class_is_made_of_its_samples(client: httpx.Client) -> None:
    add_samples(client, labelled("sender", None, "body", "body"), labelled("sender", "date"))
    assert "no version yet, only samples (2)" in client.get("/layout/models/letter").json()["detail"]
    response = client.post("/layout/models/letter/initialize")
    assert (response.status_code, response.headers["etag"]) == (200, '"1"')
    assert response.json() == {
        "name": "letter",
        "version": 1,
        "samples": 2,
        "labels": {"sender": 2, "body": 2, "date": 1},
        "warnings": [],
    }
    assert client.get("/layout/models/letter").json() == model_document("letter", "sender", "body", "date")
    (version,) = client.get("/layout/models/letter/versions").json()["versions"]
    assert (version["origin"], version["note"]) == ("initialize", "2 samples")


def test_no_samples(client: httpx.Client) -> None:
    client.put("/layout/models/letter", json=LETTER)
    problem = assert_problem(client.post("/layout/models/letter/initialize"), 422, "no-samples")
    assert "/samples" in str(problem["detail"])
    assert client.get("/layout/models/letter").headers["etag"] == '"1"'


def test_initialization_has_a_time_limit_of_its_own() -> None:
    with serving(job_timeout_s=20, model_timeout_s=0.5) as client:
        add_samples(client, labelled("sender", text="do:hang"))
        problem = assert_problem(client.post("/layout/models/letter/initialize"), 504, "timed-out")
        assert "0.5 s (MODEL_TIMEOUT_S)" in str(problem["detail"])
        assert client.get("/layout/models").json()["models"][0]["version"] is None


def test_if_match(client: httpx.Client) -> None:
    add_samples(client, labelled("sender"))
    path = "/layout/models/letter"
    assert_problem(client.put(path, json=LETTER, headers={"If-Match": "*"}), 412, "conflict")
    assert_problem(client.post(f"{path}/initialize", headers={"If-Match": '"1"'}), 412, "conflict")
    assert client.post(f"{path}/initialize").headers["etag"] == '"1"'
    assert_problem(client.put(path, json=LETTER, headers={"If-None-Match": "*"}), 412, "conflict")
    assert client.put(path, json=LETTER, headers={"If-Match": '"1"'}).headers["etag"] == '"2"'
    problem = assert_problem(client.put(path, json=LETTER, headers={"If-Match": '"1"'}), 412, "conflict")
    assert "version 2" in str(problem["detail"])
    assert client.post(f"{path}/initialize", headers={"If-Match": '"1", "2"'}).headers["etag"] == '"3"'
    assert client.put(path, json=LETTER, headers={"If-Match": "*"}).headers["etag"] == '"4"'
    assert_problem(client.put(path, json=LETTER, headers={"If-None-Match": '"4"'}), 422, "invalid-option")
    assert_problem(client.delete(path, headers={"If-Match": 'W/"4"'}), 412, "conflict")
    assert client.delete(path, headers={"If-Match": '"4"'}).status_code == 204
    created = client.put(path, json=LETTER, headers={"If-None-Match": "*"})
    assert (created.status_code, created.headers["etag"]) == (201, '"5"')


def test_of_many_writers_that_expect_one_version_one_writes(client: httpx.Client) -> None:
    client.put("/layout/models/letter", json=LETTER)

    def write(_: int) -> int:
        return client.put("/layout/models/letter", json=LETTER, headers={"If-Match": '"1"'}).status_code

    with ThreadPoolExecutor(8) as threads:
        statuses = sorted(threads.map(write, range(8)))
    assert statuses == [200, *[412] * 7]
    with ThreadPoolExecutor(8) as threads:
        path = "/layout/models/letter"
        etags = list(threads.map(lambda _: client.put(path, json=LETTER).headers["etag"], range(8)))
    assert sorted(int(etag.strip('"')) for etag in etags) == list(range(3, 11))


def test_any_version_is_written_over_when_one_is_enough(client: httpx.Client) -> None:
    """`If-Match: *` asks for some version only: another writer who was faster does not break it."""
    client.put("/layout/models/letter", json=LETTER)

    def write(_: int) -> int:
        return client.put("/layout/models/letter", json=LETTER, headers={"If-Match": "*"}).status_code

    with ThreadPoolExecutor(8) as threads:
        assert list(threads.map(write, range(16))) == [200] * 16


def test_deleting(client: httpx.Client) -> None:
    add_samples(client, labelled("sender"))
    client.post("/layout/models/letter/initialize")
    response = client.delete("/layout/models/letter")
    assert (response.status_code, response.content) == (204, b"")
    assert client.get("/layout/models").json() == {"models": []}
    assert_problem(client.get("/layout/models/letter"), 404, "not-found")
    assert_problem(client.get("/layout/models/letter/samples"), 404, "not-found")
    assert_problem(client.delete("/layout/models/letter"), 404, "not-found")
    assert_problem(
        client.post("/layout", data={"zones": json.dumps(PAGE), "models": "letter"}), 404, "not-found"
    )


def test_a_recognition_uses_the_newest_version(client: httpx.Client) -> None:
    def competing() -> list[tuple[str, int]]:
        answer = client.post("/layout", data={"zones": json.dumps(PAGE)}).json()
        return [(match["name"], match["model_version"]) for match in answer["classes"]]

    assert competing() == []
    client.put("/layout/models/letter", json=LETTER)
    assert competing() == [("letter", 1)]
    client.put("/layout/models/letter", json=LETTER)
    client.put("/layout/models/fax", json=model_document("fax"))
    assert competing() == [("fax", 1), ("letter", 2)]
    client.delete("/layout/models/letter")
    assert competing() == [("fax", 1)]


def test_no_more_models_than_allowed() -> None:
    with serving(max_models=2) as client:
        for name in ("a", "b"):
            assert client.put(f"/layout/models/{name}", json=model_document(name)).status_code == 201
        problem = assert_problem(client.put("/layout/models/c", json=model_document("c")), 409, "store-full")
        assert "2" in str(problem["detail"])
        response = client.post("/layout/models/c/samples", json=labelled("sender"))
        assert_problem(response, 409, "store-full")
        assert client.put("/layout/models/a", json=model_document("a")).status_code == 200
        client.delete("/layout/models/b")
        assert client.put("/layout/models/c", json=model_document("c")).status_code == 201


def test_a_restart_forgets_nothing(tmp_path: Path) -> None:
    with serving(data_dir=tmp_path) as client:
        add_samples(client, labelled("sender"))
        client.post("/layout/models/letter/initialize")
        result = client.post("/layout", data={"zones": json.dumps(PAGE)}).json()
    with serving(data_dir=tmp_path) as client:
        assert client.get("/layout/models/letter").json() == model_document("letter", "sender")
        assert len(client.get("/layout/models/letter/samples").json()["samples"]) == 1
        assert client.get(f"/layout/results/{result['id']}").json() == result
        assert client.post("/layout", data={"zones": json.dumps(PAGE)}).json()["class"]["name"] == "letter"


@pytest.mark.parametrize("bound", ["MOST_ZONES", "MOST_CHARACTERS"])
def test_of_very_many_samples_the_newest_make_the_model(
    client: httpx.Client, monkeypatch: pytest.MonkeyPatch, bound: str
) -> None:
    add_samples(client, *(labelled(label, label, text="x") for label in "abcd"))
    monkeypatch.setattr(model_samples, bound, 5)
    answer = client.post("/layout/models/letter/initialize").json()
    assert (answer["samples"], answer["labels"]) == (2, {"c": 2, "d": 2})
    monkeypatch.setattr(model_samples, bound, 0)
    assert client.post("/layout/models/letter/initialize").json()["labels"] == {"d": 2}
    assert [version["note"] for version in versions(client)] == ["1 samples", "2 samples"]


def versions(client: httpx.Client) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = client.get("/layout/models/letter/versions").json()["versions"]
    return found

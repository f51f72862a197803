"""What a key has made belongs to it, and after it has deleted everything nothing of it is left."""

import base64
import json
import logging
import re
import time
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest

from app.access.authentication import OPEN_PATHS
from app.access.known_keys import name_of_key, spellings_of_key
from app.storage import backup_note
from app.storage.layout_store import DATABASE
from models.repository import Store
from tests.app.scripted_layout import PAGE
from tests.app.scripted_models import model_document
from tests.app.scripts import upload
from tests.app.serving import POLL_S, serving
from tests.app.test_problems import assert_problem
from tests.models.whole_database import everything

SECRET = "Kropotkin 4711"
"""Text of a page that must not stay anywhere."""
ALICE, BOB, ADMIN = ({"X-API-Key": key} for key in ("alice-secret", "bob-secret", "root-secret"))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("owned")


@pytest.fixture(scope="module")
def client(folder: Path) -> Iterator[httpx.Client]:
    keys = ("alice:alice-secret", "bob-secret", "admin:root-secret")
    with serving(api_keys=keys, data_dir=folder) as client:
        yield client


def recognize(client: httpx.Client, key: dict[str, str]) -> str:
    page = {**PAGE, "zones": [{**zone, "text": SECRET} for zone in PAGE["zones"]]}
    response = client.post("/layout", data={"zones": json.dumps(page)}, headers=key)
    assert response.status_code == 200, response.text
    return str(response.json()["id"])


def recognize_image(client: httpx.Client, key: dict[str, str]) -> str:
    files = {"image": ("page.png", upload(""))}
    response = client.post("/layout", files=files, data={"keep_image": "true"}, headers=key)
    assert response.status_code == 200, response.text
    return str(response.json()["id"])


def keep_photo(client: httpx.Client, key: dict[str, str]) -> str:
    data = {"keep_photo": "true", "format": "json"}
    response = client.post("/rectify", files={"image": upload("")}, data=data, headers=key)
    return str(response.json()["page_id"])


def start(client: httpx.Client, key: dict[str, str]) -> str:
    headers = {**key, "Prefer": "respond-async"}
    path = client.post("/rectify", files={"image": upload("")}, headers=headers).headers["Location"]
    deadline = time.monotonic() + 20
    while client.get(path, headers=key).json()["state"] != "succeeded":
        assert time.monotonic() < deadline
        time.sleep(POLL_S)
    return str(path)


def send_a_piece(client: httpx.Client, key: dict[str, str]) -> str:
    """The path of an upload of which a piece has come, with a secret name."""
    name = base64.b64encode(SECRET.encode()).decode()
    begin = {"Tus-Resumable": "1.0.0", "Upload-Length": "9", "Upload-Metadata": f"filename {name}"}
    path = str(client.post("/uploads", headers={**begin, **key}).headers["location"])
    piece = {"Tus-Resumable": "1.0.0", "Upload-Offset": "0", "Content-Type": "application/octet-stream"}
    assert client.patch(path, headers={**piece, **key}, content=b"piece").status_code == 204
    return path


def test_names_of_keys() -> None:
    assert name_of_key("phone:a:b") == "phone"
    assert spellings_of_key("phone:a:b") == ("phone:a:b", "a:b")
    assert spellings_of_key("plain") == ("plain",)
    assert name_of_key("plain").startswith("key-")
    assert "plain" not in name_of_key("plain")


def test_each_key_sees_its_own_and_admin_sees_all(client: httpx.Client) -> None:
    client.put("/layout/models/letter", json=model_document("letter", "sender", "date"), headers=ADMIN)
    result, job = recognize(client, ALICE), start(client, ALICE)
    path = f"/layout/results/{result}"
    assert client.post(f"{path}/feedback", json={"class": None}, headers=ALICE).status_code == 200
    [unknown] = client.get("/layout/unknown-pages", headers=ALICE).json()["pages"]
    page = f"/layout/unknown-pages/{unknown['id']}"
    for method, hidden in (
        ("GET", path), ("DELETE", path), ("DELETE", f"{path}/feedback"), ("GET", page), ("DELETE", page),
        ("GET", job), ("GET", f"{job}/result"), ("GET", f"{job}/events"), ("DELETE", job),
    ):  # fmt: skip
        assert_problem(client.request(method, hidden, headers=BOB), 404, "not-found")
    again = client.post(f"{path}/feedback", json={"class": None}, headers=BOB)
    assert_problem(again, 404, "not-found")
    assert client.get("/layout/unknown-pages", headers=BOB).json()["pages"] == []
    for key in (ALICE, ADMIN, {"X-API-Key": "alice:alice-secret"}):
        for shown in (path, page, job):
            assert client.get(shown, headers=key).status_code == 200
    assert client.get("/layout/models/letter", headers=BOB).status_code == 200
    for gone in (f"{path}/feedback", path, job):
        assert client.delete(gone, headers=ADMIN).status_code in (200, 204)


def test_an_idempotency_key_is_that_of_one_api_key(client: httpx.Client) -> None:
    path = "/layout/models/scoped/samples"

    def send(key: dict[str, str], text: str) -> httpx.Response:
        page = {**PAGE, "zones": [{**PAGE["zones"][0], "label": "date", "text": text}]}
        return client.post(path, json=page, headers={**key, "Idempotency-Key": "1"})

    assert [send(ALICE, "a").status_code, send(BOB, "b").status_code] == [201, 201]
    assert [send(ALICE, "a").status_code, send(BOB, "b").status_code] == [200, 200]
    assert_problem(send(ALICE, "b"), 409, "conflict")
    client.put("/layout/models/letter", json=model_document("letter", "sender", "date"), headers=ADMIN)
    for key in (ALICE, BOB):
        answer = client.post(
            f"/layout/results/{recognize(client, key)}/feedback",
            json={"class": "letter"},
            headers={**key, "Idempotency-Key": "1"},
        )
        assert (answer.status_code, answer.json()["created"]) == (200, True)
    for name in ("scoped", "letter"):
        client.delete(f"/layout/models/{name}", headers=ADMIN).raise_for_status()


def test_after_deletion_nothing_is_left(
    client: httpx.Client, folder: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """The retention table of docs/operations.md, row by row."""
    client.put("/layout/models/letter", json=model_document("letter", "sender", "date"), headers=ADMIN)
    # The list of changes stays, as its purpose is; it has no content of pages.
    shared = (
        "layout_models",
        "layout_model_versions",
        "store_state",
        "alembic_version",
        "layout_audit",
        "shared_values",
    )

    def rows() -> dict[str, int]:
        with Store.open(folder / DATABASE) as store:
            return {name: len(kept) for name, kept in everything(store).items() if name not in shared}

    def files() -> list[Path]:
        """All files but those of the database: pictures, and uploads and answers of jobs."""
        kept = (path for path in folder.rglob("*") if path.is_file())
        own = (path for path in kept if not path.name.startswith(DATABASE) and path.name != backup_note.NAME)
        return [path for path in own if path.suffix != ".lock"]

    before = rows()
    with caplog.at_level(logging.INFO):
        results = [recognize(client, ALICE) for _ in range(3)]
        kept = recognize_image(client, ALICE)
        photo = keep_photo(client, ALICE)
        piece = send_a_piece(client, ALICE)
        assert len(files()) == 3
        bodies = [{"class": "letter", "labels": {"z1": "date"}}, {"class": None}, {"labels": {}}]
        for result, body in zip(results, bodies, strict=True):
            response = client.post(f"/layout/results/{result}/feedback", json=body, headers=ALICE)
            assert response.status_code == 200, response.text
        job = start(client, ALICE)
        data = {"camera": "alice-s"}
        client.post("/rectify", files={"image": upload("")}, data=data, headers=ALICE).raise_for_status()
        posted = {**PAGE, "zones": [{**zone, "label": "date", "text": SECRET} for zone in PAGE["zones"]]}
        parts = {"zones": (None, json.dumps(posted)), "image": ("page.png", upload(""))}
        sample = client.post("/layout/models/letter/samples", files=parts, headers=ALICE).json()["id"]
        grown = rows()
        assert all(grown[name] > before[name] for name in before), grown
        paths = [f"/layout/results/{result}/feedback" for result in results[:2]]
        paths += [f"/layout/results/{result}" for result in (*results, kept)]
        paths += [f"/layout/results/{results[2]}/feedback"]  # also without its result
        paths += [
            job,
            f"/pages/{photo}",
            f"/layout/models/letter/samples/{sample}",
            "/cameras/alice-s",
            piece,
        ]
        for path in paths:
            response = client.delete(path, headers=ALICE)
            assert response.status_code in (200, 204), (path, response.text)
    assert rows() == before
    assert files() == []
    for path in {*paths, *(path.removesuffix("/feedback") for path in paths)}:
        assert client.get(path, headers=ALICE).status_code in (404, 405)
    assert SECRET not in caplog.text
    assert "alice-secret" not in caplog.text
    with Store.open(folder / DATABASE) as store:
        assert SECRET not in repr(store.changes(1000, model=None, before=None))
        assert store.model("letter").version is not None
        for version in store.model_versions("letter"):
            assert SECRET not in json.dumps(store.model("letter", version.version).document)


OWN = {
    "/layout/results": ("", "?format=csv", "?format=csv&rows=documents", "?format=jsonl", "?order=gain",
                        "?order=confidence", "?state=corrected", "?state=open", "?state=skipped&order=gain"),
    "/layout/results/{id}": ("", "?format=html"),
    "/layout/results/{id}/image": ("", "?width=10"),
    "/layout/models/{name}/feedback": ("", "?limit=1"),
    "/layout/unknown-pages": ("", "?limit=1"),
    "/layout/unknown-pages/{id}": ("",),
    "/pages/{id}": ("",),
    "/pages/{id}/photo": ("", "?width=10"),
    "/uploads/{id}": ("",),
    "/jobs/{id}": ("",),
    "/jobs/{id}/result": ("",),
    "/jobs/{id}/events": ("",),
    "/cameras": ("",),
}  # fmt: skip
"""Paths that show what a key has made, with the queries that are asked."""
SHARED = {
    "/layout/models", "/layout/models/{name}", "/layout/models/{name}/samples", "/layout/models/{name}/samples/{id}",
    "/layout/models/{name}/versions", "/layout/models/{name}/versions/{version}/diff", "/layout/models/{name}/health",
    "/layout/models/{name}/settings", "/layout/export", "/audit",
}  # fmt: skip
"""Paths that show models with their samples, which all keys share, and the list of changes."""


@pytest.fixture(scope="module")
def made(client: httpx.Client) -> Iterator[dict[str, str]]:
    """What Alice has made, by path; each of them with a mark by which it is recognized in an answer."""
    client.put("/layout/models/letter", json=model_document("letter", "sender", "date"), headers=ADMIN)
    results = [recognize(client, ALICE) for _ in range(4)]
    kept = recognize_image(client, ALICE)
    for result, body in zip(results, ({"class": "letter"}, {"class": None}, {"labels": {}}), strict=False):
        client.post(f"/layout/results/{result}/feedback", json=body, headers=ALICE).raise_for_status()
    client.post(f"/layout/results/{results[3]}/skip", headers=ALICE).raise_for_status()
    job = start(client, ALICE)
    data = {"camera": "alice-s"}
    client.post("/rectify", files={"image": upload("")}, data=data, headers=ALICE).raise_for_status()
    [unknown] = client.get("/layout/unknown-pages", headers=ALICE).json()["pages"]
    yield {
        "/layout/results/{id}": results[0],
        "/layout/results/{id}/image": kept,
        "/layout/unknown-pages/{id}": unknown["id"],
        "/pages/{id}": (photo := keep_photo(client, ALICE)),
        "/uploads/{id}": (piece := send_a_piece(client, ALICE)).removeprefix("/uploads/"),
        "/jobs/{id}": job.removeprefix("/jobs/"),
    }
    client.delete(f"/pages/{photo}", headers=ADMIN)
    for result in (*results, kept):
        client.delete(f"/layout/results/{result}/feedback", headers=ADMIN)
        client.delete(f"/layout/results/{result}", headers=ADMIN)
    for path in (job, piece, "/cameras/alice-s", "/layout/models/letter"):
        client.delete(path, headers=ADMIN if path.startswith("/layout") else ALICE)


@pytest.mark.parametrize("template", OWN)
def test_what_a_key_has_made_is_shown_to_no_other(
    client: httpx.Client, made: dict[str, str], template: str
) -> None:
    own = next((made[name] for name in (template, template.rpartition("/")[0]) if name in made), "")
    path = template.replace("{id}", own).replace("{name}", "letter")
    answers = [[client.get(path + query, headers=key) for query in OWN[template]] for key in (ALICE, BOB)]
    assert {shown.status_code for shown in answers[0]} == {200}
    if "{id}" in template:
        for hidden in answers[1]:
            assert_problem(hidden, 404, "not-found")
        return
    marks = set(re.findall("[0-9A-HJKMNP-TV-Z]{26}|alice-s", "".join(shown.text for shown in answers[0])))
    assert marks
    for hidden in answers[1]:
        assert hidden.status_code == 200
        assert not any(mark in hidden.text for mark in {*marks, SECRET})


def test_every_path_shows_what_is_owned_or_shared(client: httpx.Client) -> None:
    paths = client.get("/openapi.json").json()["paths"]
    assert {path for path in paths if "get" in paths[path]} - OPEN_PATHS == {*OWN, *SHARED}

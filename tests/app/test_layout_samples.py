"""Samples of a model: pages as JSON or with their image, each counted once."""

import json
from collections.abc import Iterator
from typing import Any

import httpx
import pytest

from tests.app.scripted_layout import PAGE
from tests.app.scripts import upload
from tests.app.serving import serving
from tests.app.test_layout_models import labelled
from tests.app.test_problems import assert_problem

PATH = "/layout/models/letter/samples"


@pytest.fixture
def client(empty_service: httpx.Client) -> httpx.Client:
    """A service that remembers nothing yet."""
    return empty_service


@pytest.fixture(scope="module")
def shared() -> Iterator[httpx.Client]:
    """A service for requests that leave nothing behind."""
    with serving(max_zones_bytes=50_000) as client:
        yield client


def test_a_sample_as_json(client: httpx.Client) -> None:
    page = labelled("sender", None, "body", "body")
    response = client.post(PATH, json=page)
    assert response.status_code == 201
    receipt = response.json()
    assert response.headers["location"] == f"{PATH}/{receipt['id']}"
    assert receipt == {
        "id": receipt["id"],
        "model": "letter",
        "zones": 4,
        "labels": {"body": 2, "sender": 1},
    }
    sample = client.get(response.headers["location"]).json()
    assert (sample["id"], sample["model"], sample["width"]) == (receipt["id"], "letter", 10)
    assert [zone["label"] for zone in sample["zones"]] == ["sender", None, "body", "body"]
    assert_problem(client.post(PATH, json={"id": "x"}), 422, "invalid-option")


def test_what_is_stored_may_be_sent_again(client: httpx.Client) -> None:
    sample = client.get(client.post(PATH, json=labelled("sender")).headers["location"]).json()
    assert client.post("/layout/models/memo/samples", json=sample).status_code == 201


@pytest.mark.parametrize("as_file", [True, False])
def test_a_sample_with_its_image(client: httpx.Client, as_file: bool) -> None:
    zones = json.dumps(labelled("sender"))
    files: dict[str, Any] = {"image": upload("")}
    data = {}
    if as_file:
        files["zones"] = zones
    else:
        data["zones"] = zones
    response = client.post(PATH, files=files, data=data)
    assert response.status_code == 201
    assert response.json()["labels"] == {"sender": 1}
    sample = client.get(response.headers["location"]).json()
    assert sample["found"]["zones"] == sample["zones"]
    alone = client.post(PATH, files={"zones": (None, zones)})
    assert alone.status_code == 201  # without what is seen in the image it is another sample
    assert alone.json()["id"] != response.json()["id"]


def test_a_sample_as_a_file_of_another_program(client: httpx.Client) -> None:
    zones = json.dumps(labelled("sender")).encode()
    response = client.post(PATH, files={"image": upload(""), "zones_file": ("page.xml", zones)})
    assert response.status_code == 201
    assert response.json()["warnings"] == [{"code": "file", "detail": "of zones"}]
    assert client.post(PATH, files={"zones_file": ("page.xml", zones)}).status_code == 201
    for files, field in (
        ({"zones": (None, zones), "zones_file": ("page.xml", zones)}, "zones_file"),
        ({"zones_file": (None, zones)}, "zones_file"),
        ({"image": upload("")}, "zones"),
    ):
        assert client.post(PATH, files=files).json()["field"] == field


def test_the_list_of_samples(client: httpx.Client) -> None:
    ids = [client.post(PATH, json=labelled(*["sender"] * count)).json()["id"] for count in (1, 2, 3)]
    answer = client.get(PATH).json()
    assert answer["model"] == "letter"
    assert [sample["id"] for sample in answer["samples"]] == ids
    assert [sample["zones"] for sample in answer["samples"]] == [1, 2, 3]
    assert [sample["labels"] for sample in answer["samples"]] == [{"sender": count} for count in (1, 2, 3)]


def test_deleting_a_sample(client: httpx.Client) -> None:
    location = client.post(PATH, json=labelled("sender")).headers["location"]
    assert client.delete(location).status_code == 204
    assert_problem(client.get(location), 404, "not-found")
    assert_problem(client.delete(location), 404, "not-found")
    assert client.get(PATH).json()["samples"] == []


def test_the_same_page_counts_once(client: httpx.Client) -> None:
    first, second = (client.post(PATH, json=labelled("sender")) for _ in range(2))
    assert (first.status_code, second.status_code) == (201, 200)
    assert first.json() == second.json()
    assert "location" not in second.headers
    assert len(client.get(PATH).json()["samples"]) == 1


def test_the_same_key_counts_once(client: httpx.Client) -> None:
    def post(page: dict[str, Any], key: str) -> httpx.Response:
        return client.post(PATH, json=page, headers={"Idempotency-Key": key})

    first, again = (post(labelled("sender"), "one") for _ in range(2))
    assert (first.status_code, again.status_code) == (201, 200)
    assert first.json() == again.json()
    problem = assert_problem(post(labelled("date"), "one"), 409, "conflict")
    assert "one" in str(problem["detail"])
    assert post(labelled("date"), "two").status_code == 201
    assert len(client.get(PATH).json()["samples"]) == 2


@pytest.mark.parametrize("key", ["", "x" * 201])
def test_keys_have_a_length(shared: httpx.Client, key: str) -> None:
    response = shared.post(PATH, json=labelled("sender"), headers={"Idempotency-Key": key})
    assert_problem(response, 422, "invalid-option")


def test_no_more_samples_than_allowed() -> None:
    with serving(max_samples_per_model=1) as client:
        assert client.post(PATH, json=labelled("sender")).status_code == 201
        assert client.post(PATH, json=labelled("sender")).status_code == 200
        assert_problem(client.post(PATH, json=labelled("date")), 409, "store-full")
        assert client.post("/layout/models/memo/samples", json=labelled("date")).status_code == 201


@pytest.mark.parametrize(
    ("body", "content_type"),
    [
        (b"{}", None),
        (b"a=b", "application/x-www-form-urlencoded"),
        (b"{}", "text/plain"),
        (b"", "multipart/form-data"),
        (b"nonsense", "multipart/form-data; boundary=x"),
    ],
)
def test_neither_json_nor_a_form(shared: httpx.Client, body: bytes, content_type: str | None) -> None:
    headers = {} if content_type is None else {"Content-Type": content_type}
    assert_problem(shared.post(PATH, content=body, headers=headers), 400, "bad-request")


@pytest.mark.parametrize("body", [b"", b"{", b"[]", b"1", b'{"width": 1, "height": 1, "zones": []}'])
def test_json_that_is_no_page(shared: httpx.Client, body: bytes) -> None:
    response = shared.post(PATH, content=body, headers={"Content-Type": "application/json"})
    assert assert_problem(response, 422, "invalid-option")["field"] == "zones"


def test_forms_that_are_none_of_ours(shared: httpx.Client) -> None:
    zones = json.dumps(PAGE)
    for files, status, code, field in (
        ({"image": upload("")}, 400, "bad-request", "zones"),
        ({"image": upload(""), "zones": (None, "")}, 400, "bad-request", "zones"),
        ({"image": (None, "no file"), "zones": zones}, 400, "bad-request", "image"),
        ({"label": (None, "x"), "zones": zones}, 422, "invalid-option", "label"),
    ):
        problem = assert_problem(shared.post(PATH, files=files), status, code)  # type: ignore[arg-type]
        assert problem["field"] == field
    twice = [("zones", (None, zones)), ("zones", (None, zones))]
    assert assert_problem(shared.post(PATH, files=twice), 422, "invalid-option")["field"] == "zones"  # type: ignore[arg-type]


def test_a_bad_image_leaves_nothing_behind(shared: httpx.Client) -> None:
    data = {"zones": json.dumps(labelled("sender"))}
    for script, status in (("undecodable-image", 422), ("segfault", 500), ("unsupported-media-type", 415)):
        response = shared.post(PATH, files={"image": upload(script)}, data=data)
        assert response.status_code == status
    assert shared.get("/layout/models").json() == {"models": []}


def test_zones_have_a_limit(shared: httpx.Client) -> None:
    zones = json.dumps(labelled("sender")) + " " * 50_000
    for response in (
        shared.post(PATH, content=zones, headers={"Content-Type": "application/json; charset=utf-8"}),
        shared.post(PATH, files={"zones": zones}),
        shared.post(PATH, files={"zones": (None, zones)}),
    ):
        assert "(MAX_ZONES_BYTES)" in str(assert_problem(response, 413, "too-large")["detail"])
    response = shared.post(PATH, files={"zones": (None, " " * 200_000)})
    assert assert_problem(response, 413, "too-large")["field"] == "zones"

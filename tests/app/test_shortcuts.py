"""Operations of one type of answer: what /rectify and /mosaic answer, in the form that generators type."""

import json
from typing import Any

import httpx
import jsonschema_rs
import pytest

from tests.app.scripts import upload
from tests.app.test_problems import assert_problem


def post(client: httpx.Client, path: str, *scripts: str, accept: str = "*/*", **data: str) -> httpx.Response:
    name = "images" if path.startswith("/mosaic") else "image"
    files = [(name, ("photo.jpg", upload(script))) for script in scripts or ("",)]
    return client.post(path, files=files, data=data, headers={"Accept": accept})


@pytest.fixture(scope="module")
def document(client: httpx.Client) -> dict[str, Any]:
    found: dict[str, Any] = client.get("/openapi.json").json()
    return found


def assert_documented(document: dict[str, Any], path: str, answer: object) -> None:
    schema = document["paths"][path]["post"]["responses"]["200"]["content"]["application/json"]["schema"]
    jsonschema_rs.validate({**schema, "components": document["components"]}, answer)


@pytest.mark.parametrize(
    ("path", "photos", "media_type", "body"),
    [
        ("/rectify/image", 1, "image/jpeg", b"flat as jpeg"),
        ("/rectify/pdf", 1, "application/pdf", b"flat as pdf"),
        ("/mosaic/image", 2, "image/jpeg", b"flat as jpeg"),
        ("/mosaic/pdf", 2, "application/pdf", b"flat as pdf"),
    ],
)
def test_a_file_is_bytes(client: httpx.Client, path: str, photos: int, media_type: str, body: bytes) -> None:
    response = post(client, path, *[""] * photos)
    assert (response.status_code, response.content) == (200, body)
    assert response.headers["content-type"] == media_type
    octets = post(client, path, *[""] * photos, accept="application/octet-stream")
    assert (octets.content, octets.headers["content-type"]) == (body, "application/octet-stream")


def test_the_format_is_one_of_its_type(client: httpx.Client) -> None:
    assert post(client, "/rectify/image", format="PNG").headers["content-type"] == "image/png"
    assert_problem(post(client, "/rectify/image", format="pdf"), 422, "invalid-option")
    assert_problem(post(client, "/rectify/pdf", format="json"), 422, "invalid-option")
    assert post(client, "/rectify/text", format="md").headers["content-type"].startswith("text/markdown")
    assert post(client, "/rectify/text").headers["content-type"].startswith("text/plain")


def test_options_are_those_of_the_whole_operation(client: httpx.Client) -> None:
    assert_problem(post(client, "/rectify/pdf", kind="round"), 422, "invalid-option")
    assert_problem(post(client, "/rectify/pdf", colour="red"), 422, "invalid-option")
    assert_problem(post(client, "/mosaic/json", "", "", mesh="1"), 422, "invalid-option")


def test_one_page_is_a_list(client: httpx.Client, document: dict[str, Any]) -> None:
    plain = post(client, "/rectify/pages").json()
    whole = post(client, "/rectify", format="json").json()
    assert_documented(document, "/rectify/pages", plain)
    (page,) = plain["pages"]
    assert page["state"] == "flat"
    x, y = whole["mesh"]["source"][1][0]
    assert page["mesh"]["source"][1][0] == {"x": x, "y": y}
    assert page["surface"]["type"] == whole["surface"]["type"]
    assert page["warnings"] == whole["warnings"]
    assert "null" not in json.dumps(plain)
    assert whole["image"] is None
    assert "image" not in page


def test_a_page_that_failed_is_told_by_its_state(client: httpx.Client, document: dict[str, Any]) -> None:
    plain = post(client, "/rectify/pages", "", "no-text", "").json()
    assert_documented(document, "/rectify/pages", plain)
    assert [page["state"] for page in plain["pages"]] == ["flat", "failed", "flat"]
    assert plain["pages"][1]["problem"]["code"] == "no-text"


def test_directions_are_objects_too(client: httpx.Client, document: dict[str, Any]) -> None:
    plain = post(client, "/rectify/pages", "creased").json()
    assert_documented(document, "/rectify/pages", plain)
    surface = plain["pages"][0]["surface"]
    assert surface["points"][2][1] == {"x": 8.0, "y": 8.5}
    assert surface["normals"][1][0] == {"x": 0.0, "y": -0.6, "z": 0.8}


def test_a_mosaic_is_told_by_objects(client: httpx.Client, document: dict[str, Any]) -> None:
    plain = post(client, "/mosaic/json", "", "").json()
    assert_documented(document, "/mosaic/json", plain)
    assert plain["patches"][0]["mesh"]["target"][0][1] == {"x": 19, "y": 0}
    assert "mesh" not in plain["patches"][1]


def test_it_may_be_a_job(client: httpx.Client) -> None:
    files = {"image": ("photo.jpg", upload(""))}
    accepted = client.post("/rectify/pages", files=files, headers={"Prefer": "respond-async"})
    assert accepted.status_code == 202
    path = accepted.headers["location"]
    with client.stream("GET", f"{path}/events") as events:
        events.read()
    assert client.get(f"{path}/result").json()["pages"][0]["state"] == "flat"


def test_who_accepts_bytes_gets_a_file_of_every_operation(client: httpx.Client) -> None:
    octets = "application/octet-stream"
    for path, scripts in (("/rectify", ("",)), ("/rectify", ("", "")), ("/mosaic", ("", ""))):
        response = post(client, path, *scripts, accept=octets)
        assert (response.status_code, response.headers["content-type"]) == (200, octets), path

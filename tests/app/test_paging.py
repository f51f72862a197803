"""Lists in parts: every entry once, whatever is deleted meanwhile."""

import json
from collections.abc import Iterator
from typing import Any

import httpx
import pytest

from tests.app.scripted_layout import PAGE
from tests.app.scripted_models import model_document
from tests.app.scripts import upload
from tests.app.serving import serving
from tests.app.test_problems import assert_problem

COUNT = 5
LISTS = {
    "/layout/models": ("models", "name"),
    "/layout/models/letter/samples": ("samples", "id"),
    "/layout/models/letter/versions": ("versions", "version"),
    "/layout/models/letter/feedback": ("feedback", "id"),
    "/layout/unknown-pages": ("pages", "id"),
}
"""Path -> name of the list, and what identifies an entry."""


@pytest.fixture(scope="module")
def client() -> Iterator[httpx.Client]:
    """A service under a prefix that has at least five of everything."""
    with serving(root_path="/documents", api_keys=("admin:secret",)) as client:
        client.headers["X-API-Key"] = "secret"
        for name in ("letter", "memo", "fax", "form", "note"):
            client.put(f"/layout/models/{name}", json=model_document(name, "sender")).raise_for_status()
        for number in range(COUNT):
            zones = [{"id": "z1", "box": [1, 2, 9, 8], "label": "sender", "text": f"page {number}"}]
            client.post("/layout/models/letter/samples", json={**PAGE, "zones": zones}).raise_for_status()
            for told in ("letter", None):
                result = client.post("/layout", files={"image": upload("")}).json()["id"]
                client.post(f"/layout/results/{result}/feedback", json={"class": told}).raise_for_status()
        yield client


def entries(client: httpx.Client, path: str, **query: Any) -> tuple[list[Any], str | None]:
    """The entries of a part of a list, and the path of the next part."""
    name, identity = LISTS[path.partition("?")[0].removeprefix("/documents")]
    response = client.get(path, params=query or None)
    assert response.status_code == 200, response.text
    following = response.links.get("next", {}).get("url")
    return [entry[identity] for entry in response.json()[name]], following


@pytest.mark.parametrize("path", LISTS)
@pytest.mark.parametrize("limit", [1, 2, 1000])
def test_all_parts_together_are_the_list(client: httpx.Client, path: str, limit: int) -> None:
    whole, following = entries(client, path)
    assert len(whole) >= COUNT
    assert following is None
    found, following = entries(client, path, limit=limit)
    while following is not None:
        assert following.startswith(f"/documents{path}?limit={limit}&cursor=")
        part, following = entries(client, following)
        assert 0 < len(part) <= limit
        found += part
    assert found == whole


def test_a_list_that_ends_with_a_part_has_no_next_one(client: httpx.Client) -> None:
    assert entries(client, "/layout/models", limit=5)[1] is None
    assert entries(client, "/layout/models", limit=4)[1] is not None


def test_an_entry_that_was_deleted_meanwhile_does_no_harm(client: httpx.Client) -> None:
    path = "/layout/models/letter/samples"
    whole, _ = entries(client, path)
    first, following = entries(client, path, limit=2)
    client.delete(f"{path}/{first[-1]}").raise_for_status()
    assert following is not None
    assert entries(client, following)[0] == whole[2:4]


def test_a_token_is_not_repeated_in_a_link(client: httpx.Client) -> None:
    token = client.post("/tokens").json()["token"]
    answer = httpx.get(client.base_url.join("/layout/models"), params={"limit": 1, "token": token})
    assert "next" in answer.links
    assert token not in json.dumps(dict(answer.headers))


@pytest.mark.parametrize("path", LISTS)
@pytest.mark.parametrize(
    ("option", "value"), [("limit", "0"), ("limit", "1001"), ("cursor", ""), ("cursor", "\0")]
)
def test_what_is_no_place_in_a_list(client: httpx.Client, path: str, option: str, value: str) -> None:
    problem = assert_problem(client.get(path, params={option: value}), 422, "invalid-option")
    assert problem["field"] == option

"""API keys, where they are configured."""

import os
from collections.abc import Iterator

import httpx
import pytest
from pydantic import ValidationError

from app.access.authentication import OPEN_PATHS
from app.main import create_app
from app.settings import Settings
from tests.app.scripted import OPERATIONS
from tests.app.scripts import upload
from tests.app.serving import serving
from tests.app.test_problems import assert_problem


@pytest.fixture(scope="module")
def guarded() -> Iterator[httpx.Client]:
    """A service with two keys."""
    with serving(api_keys="first, second") as client:
        yield client


def rectify(client: httpx.Client, key: str | bytes | None) -> httpx.Response:
    headers = {} if key is None else {"X-API-Key": key}
    return client.post("/rectify", files={"image": upload("")}, headers=headers)  # type: ignore[arg-type]


def test_keys_guard_the_work_and_leave_the_probes_open() -> None:
    with serving(api_keys="first, second") as client:
        response = rectify(client, None)
        assert_problem(response, 401, "unauthorized")
        assert "X-API-Key" in response.headers["www-authenticate"]
        assert_problem(rectify(client, ""), 401, "unauthorized")
        assert_problem(rectify(client, "third"), 403, "forbidden")
        assert_problem(rectify(client, "schlüssel".encode()), 403, "forbidden")
        assert_problem(client.get("/nowhere"), 401, "unauthorized")
        assert rectify(client, "first").status_code == rectify(client, "second").status_code == 200
        assert {client.get(path).status_code for path in OPEN_PATHS} == {200}


@pytest.mark.parametrize("encoding", ["utf-8", "latin-1"])
def test_a_key_may_have_any_characters(encoding: str) -> None:
    """curl sends the bytes of the terminal, other clients send Latin-1."""
    with serving(api_keys="first, schlüssel") as client:
        assert rectify(client, "schlüssel".encode(encoding)).status_code == 200
        assert_problem(rectify(client, "schlussel".encode(encoding)), 403, "forbidden")
        assert_problem(rectify(client, "schlüsseln".encode(encoding)), 403, "forbidden")


def test_a_key_of_a_foreign_locale_is_its_bytes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(os.environb, b"API_KEYS", b"schl\x99ssel")
    with serving(api_keys=Settings().api_keys) as client:
        assert rectify(client, b"schl\x99ssel").status_code == 200


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ([("X-API-Key", "first"), ("X-API-Key", "second")], 403),
        ([("X-API-Key", "first"), ("X-API-Key", "third")], 403),
        ([("Authorization", "Bearer first"), ("Authorization", "Bearer second")], 403),
        ([("Authorization", "Bearer first"), ("Authorization", "Basic Zmlyc3Q6")], 403),
        ([("X-API-Key", "first"), ("Authorization", "Bearer second")], 403),
        ([("X-API-Key", "first"), ("X-API-Key", "first"), ("Authorization", "bearer first")], 200),
        ([("X-API-Key", "first"), ("Authorization", "Basic Zmlyc3Q6")], 200),
        ([("X-API-Key", "third"), ("Authorization", "Basic Zmlyc3Q6")], 403),
        ([("Authorization", "Basic Zmlyc3Q6")], 401),
    ],
)
def test_headers_that_come_twice_or_belong_to_a_proxy(
    guarded: httpx.Client, headers: list[tuple[str, str]], status: int
) -> None:
    assert guarded.get("/layout/models", headers=headers).status_code == status


def test_a_token_counts_beside_the_credentials_of_a_proxy(guarded: httpx.Client) -> None:
    token = guarded.post("/tokens", headers={"X-API-Key": "first"}).json()["token"]
    basic = {"Authorization": "Basic Zmlyc3Q6"}
    assert guarded.get("/layout/models", params={"token": token}, headers=basic).status_code == 200


def test_no_keys_no_guard() -> None:
    assert not Settings().has_keys


@pytest.mark.parametrize("keys", ["", ",", " ", " , "])
def test_keys_that_are_set_and_empty_are_refused(keys: str) -> None:
    with pytest.raises(ValidationError, match="everybody could use the service"):
        Settings(api_keys=keys)  # type: ignore[arg-type]


def test_the_openapi_document_tells_of_keys_when_there_are_some() -> None:
    paths = create_app(Settings(api_keys=("key",)), OPERATIONS).openapi()["paths"]
    for path, operations in paths.items():
        for operation in operations.values():
            if path in OPEN_PATHS:
                assert "security" not in operation
            else:
                assert operation["security"] == [{"ApiKey": []}, {"Bearer": []}]
                assert {"401", "403"} <= operation["responses"].keys()
    operation = create_app(Settings(api_keys=()), OPERATIONS).openapi()["paths"]["/rectify"]["post"]
    assert operation["security"] == [{}, {"ApiKey": []}, {"Bearer": []}]
    assert {"401", "403"} <= operation["responses"].keys()

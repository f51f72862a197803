"""Keys with names and roles from a file, what each may do, and the list of who changed what."""

import asyncio
import json
import re
import subprocess
import sys
from collections.abc import AsyncIterator, Iterator
from itertools import product
from pathlib import Path
from unittest.mock import Mock

import httpx
import pytest
from fastapi import Request
from starlette.responses import Response
from starlette.types import Receive, Scope, Send

from app.access.authentication import OPEN_PATHS
from app.access.callers import Caller, caller_of
from app.http.middleware import METHODS
from app.jobs.stored_request import JobRun, do_request
from app.main import create_app
from app.roles import (
    NOT_FOR_READERS,
    READERS_WRITE,
    VERIFIERS_WRITE,
    InvalidKeys,
    Key,
    digest_of_key,
    read_keys_file,
)
from app.settings import Settings
from tests.app.scripted import OPERATIONS
from tests.app.scripted_layout import PAGE
from tests.app.scripted_models import model_document
from tests.app.scripts import upload
from tests.app.serving import serving
from tests.app.test_jobs import LATER, start, until
from tests.app.test_layout_feedback import give, recognize
from tests.app.test_problems import assert_problem
from tests.counts import repeats

KEYS = {
    "rita": ("reader", "key-of-rita"),
    "vera": ("verifier", "key-of-vera"),
    "anna": ("admin", "key-of-anna"),
}
LETTER = model_document("letter", "sender", "date")


def line(name: str, role: str, key: str) -> str:
    return f"{name} {role} {digest_of_key(key.encode())}"


@pytest.fixture(scope="module")
def office(tmp_path_factory: pytest.TempPathFactory) -> Iterator[httpx.Client]:
    """A service with a key of every role, in a file, and one of API_KEYS."""
    path = tmp_path_factory.mktemp("keys") / "keys.txt"
    path.write_text("# office\n\n" + "\n".join(line(name, *of) for name, of in KEYS.items()))
    with serving(api_keys_file=path, api_keys="old:key-of-old") as client:
        yield client


@pytest.fixture
def client(office: httpx.Client) -> Iterator[httpx.Client]:
    """The service as `anna`; a test changes the key."""
    use(office, "anna")
    office.put("/layout/models/letter", json=LETTER).raise_for_status()
    yield office
    use(office, "anna")
    office.delete("/layout/models/letter")


def use(client: httpx.Client, name: str) -> None:
    client.headers["X-API-Key"] = KEYS[name][1]


def imported(client: httpx.Client) -> int:
    """The first version of the class; numbers go on where an earlier class of the name was deleted."""
    versions = client.get("/layout/models/letter/versions").json()["versions"]
    return min(int(version["version"]) for version in versions)


def test_readers_work_on_photos_and_change_nothing(client: httpx.Client) -> None:
    use(client, "rita")
    assert client.post("/rectify", files={"image": upload("")}).status_code == 200
    result = recognize(client)
    assert client.get("/layout/models/letter").status_code == 200
    token = client.post("/tokens").json()["token"]
    assert client.get("/layout/models", params={"token": token}, headers={"X-API-Key": ""}).status_code == 200
    for response in (
        give(client, result, {"class": "letter"}),
        client.post(f"/layout/results/{result}/claim"),
        client.delete("/layout/models/letter"),
        client.get("/audit"),
    ):
        assert_problem(response, 403, "forbidden")
        assert "role reader" in response.json()["detail"]


def test_verifiers_teach_and_admins_do_the_rest(client: httpx.Client) -> None:
    use(client, "vera")
    result = recognize(client)
    assert give(client, result, {"labels": {"z2": "date"}}).status_code == 200
    assert_problem(
        client.post("/layout/models/letter/rollback", json={"version": imported(client)}), 403, "forbidden"
    )
    use(client, "anna")
    assert (
        client.post("/layout/models/letter/rollback", json={"version": imported(client)}).status_code == 200
    )
    assert client.get(f"/layout/results/{result}").status_code == 200  # admins see what all keys have made


def test_who_changed_what_is_listed(client: httpx.Client) -> None:
    use(client, "vera")
    give(client, recognize(client), {"labels": {"z2": "date"}})
    refused = client.post("/layout/models/letter/rollback", json={"version": imported(client)})
    use(client, "anna")
    client.post("/layout/models/letter/rollback", json={"version": imported(client)}).raise_for_status()
    entries = client.get("/audit", params={"model": "letter", "limit": 3}).json()["entries"]
    assert [(entry["who"], entry["action"]) for entry in entries] == [
        ("anna", "rollback"),
        ("vera", "feedback"),
        ("anna", "import"),
    ]
    assert refused.status_code == 403
    assert re.fullmatch(r"version \d+", entries[0]["detail"])
    first = client.get("/audit", params={"limit": 1})
    path = re.match("<([^>]+)>", first.headers["link"])
    assert path is not None
    assert client.get(path[1]).json()["entries"][0]["action"] == "feedback"


def test_a_job_is_listed_when_it_changes_something(client: httpx.Client) -> None:
    page = {"width": 20, "height": 30, "zones": [{"id": "z1", "box": [1, 2, 9, 8], "label": "date"}]}
    use(client, "vera")
    sample = client.post("/layout/models/letter/samples", json=page).json()["id"]
    use(client, "anna")
    path = "/layout/models/letter/initialize"
    accepted = client.post(path, headers={"Prefer": "respond-async"})
    until(client, accepted.headers["location"])
    version = client.get("/layout/models/letter").headers["etag"].strip('"')
    entries = client.get("/audit", params={"model": "letter", "limit": 2}).json()["entries"]
    assert [(entry["who"], entry["action"], entry["detail"]) for entry in entries] == [
        ("anna", "initialization", f"version {version}"),
        ("vera", "sample added", sample),
    ]


def test_a_path_with_a_control_character_names_nothing(tmp_path: Path) -> None:
    """Patterns of routes end with `$`, which matches before a last newline too: `/audit%0a` would be `/audit`."""
    file = tmp_path / "keys.txt"
    file.write_text("\n".join(line(name, *of) for name, of in KEYS.items()))
    app = create_app(Settings(api_keys_file=file, api_keys=("old:key-of-old",)), OPERATIONS)
    paths = {re.sub("{[^}]+}", "a", path) for path in app.openapi()["paths"]} | OPEN_PATHS | {"/nowhere"}
    keys = [*(key for _, key in KEYS.values()), "key-of-old", ""]
    every = list(product(METHODS, sorted(paths), keys))
    requests = [
        *(
            (method, path + "%0a", key) for method, path, key in every[:: repeats(3, 1)]
        ),  # of five keys: all in turn
        *(
            ("GET", f"/audit{character}", KEYS["rita"][1])
            for character in ("%00", "%1f", "%7f", "/%0A", "%0d")
        ),
        ("GET", "/au%00dit", KEYS["rita"][1]),
    ]

    async def others() -> list[tuple[str, str, str, int]]:
        async with httpx.AsyncClient(transport=httpx.ASGITransport(app), base_url="http://service") as client:
            statuses = [
                (await client.request(method, path, headers={"X-API-Key": key})).status_code
                for method, path, key in requests
            ]
            assert_problem(await client.get("/audit%0a"), 404, "not-found")
        return [(*sent, status) for sent, status in zip(requests, statuses, strict=True) if status != 404]

    assert asyncio.run(others()) == []


def test_the_digest_is_no_key(client: httpx.Client) -> None:
    digest = digest_of_key(KEYS["anna"][1].encode())
    for key in (digest, f"anna:sha256:{digest}", f"sha256:{digest}"):
        assert_problem(client.get("/layout/models", headers={"X-API-Key": key}), 403, "forbidden")
    assert client.get("/layout/models", headers={"X-API-Key": "key-of-old"}).status_code == 200


@pytest.fixture(scope="module")
def titled(tmp_path_factory: pytest.TempPathFactory) -> Iterator[httpx.Client]:
    """A service whose verifier is called as the admin of API_KEYS would be, with one unknown page of each key."""
    path = tmp_path_factory.mktemp("keys") / "keys.txt"
    keys = {name: (role, f"key-of-{name}") for name, role in (("admin", "verifier"), ("boss", "admin"))}
    path.write_text("\n".join(line(name, *of) for name, of in keys.items()))
    with serving(api_keys_file=path, max_jobs_per_key=1, workers=1) as client:
        for name in keys:
            client.headers["X-API-Key"] = f"key-of-{name}"
            client.put("/layout/models/letter", json=LETTER)
            found = client.post("/layout", data={"zones": json.dumps(PAGE)}).json()["id"]
            give(client, found, {"class": None}).raise_for_status()
        yield client


@pytest.mark.parametrize(("name", "pages"), [("admin", 1), ("boss", 2)])
@pytest.mark.parametrize("is_job", [False, True])
def test_a_job_has_the_role_of_its_key_and_a_name_is_none(
    titled: httpx.Client, name: str, pages: int, is_job: bool
) -> None:
    """Proposals look at the unknown pages that their key may see: a verifier's own, an admin's all."""
    titled.headers["X-API-Key"] = f"key-of-{name}"
    proposed = titled.post("/layout/proposals", headers=LATER if is_job else {})
    if is_job:
        assert until(titled, proposed.headers["location"])["state"] == "succeeded"
        proposed = titled.get(proposed.headers["location"] + "/result")
    assert proposed.json()["looked_at"]["unknown_pages"] == pages


def test_jobs_of_a_key_of_the_file_are_limited(titled: httpx.Client, tmp_path: Path) -> None:
    titled.headers["X-API-Key"] = "key-of-admin"
    first = start(titled, f"wait {tmp_path}")
    for _ in range(2):
        refused = titled.post("/rectify", files={"image": upload("")}, headers=LATER)
        assert_problem(refused, 503, "busy")
        assert "MAX_JOBS_PER_KEY" in refused.json()["detail"]
    own = start(titled, "", {"X-API-Key": "key-of-boss"})
    (tmp_path / "go").touch()
    assert until(titled, first)["state"] == "succeeded"
    assert titled.delete(own, headers={"X-API-Key": "key-of-boss"}).status_code == 204


def test_a_stored_job_without_a_role_has_least_rights() -> None:
    """As jobs that an earlier release has stored."""
    seen: list[Caller] = []

    async def route(scope: Scope, receive: Receive, send: Send) -> None:
        seen.append(caller_of(Request(scope)))
        await Response()(scope, receive, send)

    async def nothing() -> AsyncIterator[bytes]:
        return
        yield b""

    for caller in (None, "admin"):
        stored = {
            "method": "GET",
            "path": "/",
            "query": "",
            "headers": {},
            "request_id": "r",
            "caller": caller,
        }
        asyncio.run(do_request(route, None, stored, nothing(), JobRun(Mock())))
    assert seen == [Caller(None, sees_all=False), Caller("admin", sees_all=False)]


def test_every_request_of_a_role_exists() -> None:
    paths = create_app(Settings(data_dir=Path("unused")), OPERATIONS).openapi()["paths"]
    for method, template in (*READERS_WRITE, *VERIFIERS_WRITE):
        assert method.lower() in paths[template]
    assert set(paths) >= NOT_FOR_READERS


@pytest.mark.parametrize("text", ["anna admin", "anna boss " + "0" * 64, "anna admin " + "0" * 63])
def test_a_file_with_a_wrong_line_is_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "keys.txt"
    path.write_text(f"# fine\n{text}\n")
    with pytest.raises(InvalidKeys, match="line 2"):
        read_keys_file(path)


def test_a_key_is_made_with_its_line(tmp_path: Path) -> None:
    run = [sys.executable, "-m", "app.roles", "anna", "admin"]
    told = subprocess.run(
        run, capture_output=True, text=True, check=True, cwd=Path(__file__).parents[2]
    ).stdout
    key, made = (part.split(": ", 1)[1] for part in told.splitlines())
    path = tmp_path / "keys.txt"
    path.write_text(made)
    assert read_keys_file(path) == [Key("anna", "admin", digest_of_key(key.encode()))]

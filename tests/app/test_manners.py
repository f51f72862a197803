"""What HTTP clients, browsers and proxies expect of any service."""

import gzip
import json
import re
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest

from app.http.representations import content_disposition
from app.settings import Settings
from tests.app.scripted_models import model_document
from tests.app.scripts import upload
from tests.app.serving import serving
from tests.app.test_problems import assert_problem

LETTER = "/layout/models/letter"
ORIGIN = "https://app.example.org"
LATER = {"Prefer": "respond-async"}


@pytest.fixture(scope="module")
def service() -> Iterator[httpx.Client]:
    """A service behind a prefix, with a browser app on another origin, and a model."""
    with serving(
        root_path="/documents", cors_origins=f"{ORIGIN}, https://other.example", workers=2
    ) as client:
        labels = [f"label {number}" for number in range(400)]
        client.put(LETTER, json=model_document("letter", *labels)).raise_for_status()
        yield client


def rectify(
    client: httpx.Client, name: str = "photo.jpg", script: str = "", **send: object
) -> httpx.Response:
    path = str(send.pop("path", "/rectify"))
    return client.post(path, files={"image": (name, upload(script))}, **send)  # type: ignore[arg-type]


@pytest.mark.parametrize("path", ["/health/live", "/layout/models", LETTER, "/", "/docs", "/openapi.json"])
def test_head_is_get_without_the_body(service: httpx.Client, path: str) -> None:
    headers = {"Accept-Encoding": "identity"}
    head, get = service.head(path, headers=headers), service.get(path, headers=headers)
    assert (head.status_code, head.content) == (200, b"")
    for name in ("content-type", "content-length", "etag"):
        assert head.headers.get(name) == get.headers.get(name)


def test_head_of_what_is_not_there(service: httpx.Client) -> None:
    assert service.head("/layout/models/nobody").status_code == 404
    response = service.head("/rectify")
    assert (response.status_code, response.headers["allow"]) == (405, "OPTIONS, POST")


def test_head_of_events_does_not_wait_for_them(service: httpx.Client, tmp_path: Path) -> None:
    job = rectify(service, script=f"wait {tmp_path}", headers=LATER).json()
    response = service.head(f"/jobs/{job['id']}/events")
    assert (response.status_code, response.content) == (200, b"")
    assert response.headers["content-type"].startswith("text/event-stream")
    (tmp_path / "go").touch()


@pytest.mark.parametrize(
    ("path", "methods"),
    [
        ("/rectify", "OPTIONS, POST"),
        ("/layout/models", "GET, HEAD, OPTIONS"),
        (LETTER, "DELETE, GET, HEAD, OPTIONS, PUT"),
        ("/openapi.json", "GET, HEAD, OPTIONS"),
    ],
)
def test_options_lists_the_methods(service: httpx.Client, path: str, methods: str) -> None:
    response = service.options(path)
    assert (response.status_code, response.headers["allow"]) == (204, methods)


def test_options_of_no_path(service: httpx.Client) -> None:
    assert_problem(service.options("/nowhere"), 404, "not-found")


@pytest.mark.parametrize("path", [LETTER, "/layout/models", "/layout/models/letter/versions"])
def test_what_has_not_changed_is_not_sent_again(service: httpx.Client, path: str) -> None:
    tag = service.get(path).headers["etag"]
    for known in (tag, f'"other", W/{tag}', "*"):
        again = service.get(path, headers={"If-None-Match": known})
        assert (again.status_code, again.content, again.headers["etag"]) == (304, b"", tag)
    assert service.get(path, headers={"If-None-Match": '"other"'}).status_code == 200


def test_large_json_is_compressed_and_images_are_not(service: httpx.Client) -> None:
    packed = service.get(LETTER, headers={"Accept-Encoding": "gzip"})
    plain = service.get(LETTER, headers={"Accept-Encoding": "identity"})
    assert packed.headers["content-encoding"] == "gzip"
    assert "content-encoding" not in plain.headers
    assert packed.content == plain.content
    assert (
        int(packed.headers["content-length"]) < len(gzip.compress(plain.content)) * 1.1 < len(plain.content)
    )
    assert packed.headers["etag"] == plain.headers["etag"] == '"1"'
    assert "content-encoding" not in rectify(service, headers={"Accept-Encoding": "gzip"}).headers


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("photo.heic", 'inline; filename="photo-flat.jpg"'),
        ("C:\\scans\\page 1.png", 'inline; filename="page 1-flat.jpg"'),
        ("../../etc/passwd", 'inline; filename="passwd-flat.jpg"'),
        ('a"b\r\n.jpg', "inline; filename=\"a_b-flat.jpg\"; filename*=UTF-8''a%22b-flat.jpg"),
        ("Müller.jpg", "inline; filename=\"M_ller-flat.jpg\"; filename*=UTF-8''M%C3%BCller-flat.jpg"),
        ("", 'inline; filename="page-flat.jpg"'),
        (None, 'inline; filename="page-flat.jpg"'),
    ],
)
def test_a_saved_page_is_named_after_its_photo(name: str | None, expected: str) -> None:
    assert content_disposition(name, "-flat", "image/jpeg") == {"Content-Disposition": expected}


def test_answers_carry_the_name(service: httpx.Client) -> None:
    assert rectify(service, "a.png").headers["content-disposition"] == 'inline; filename="a-flat.jpg"'
    assert "content-disposition" not in rectify(service, data={"format": "json"}).headers
    two = [("images", ("left.jpg", upload(""))), ("images", ("right.jpg", upload("")))]
    joined = service.post("/mosaic", files=two, data={"format": "pdf"})
    assert joined.headers["content-disposition"] == 'inline; filename="left-mosaic.pdf"'
    labelled = service.post("/layout", files={"image": ("p.png", upload(""))}, data={"format": "png"})
    assert labelled.headers["content-disposition"] == 'inline; filename="p-labelled.png"'


@pytest.mark.parametrize("format_", ["jpg", "JPEG", " Jpg ", "jpeg"])
def test_formats_as_people_write_them(service: httpx.Client, format_: str) -> None:
    assert rectify(service, data={"format": format_}).headers["content-type"] == "image/jpeg"
    assert rectify(service, path=f"/rectify?format={format_}").text == "flat as jpeg"


def test_the_format_in_the_query(service: httpx.Client) -> None:
    assert rectify(service, path="/rectify?format=PDF").text == "flat as pdf"
    assert rectify(service, path="/rectify?format=pdf", data={"format": "pdf"}).text == "flat as pdf"
    two = [("images", ("left.jpg", upload("")))] * 2
    assert service.post("/mosaic?format=tif", files=two).text == "flat as tiff"
    page = {"image": ("p.png", upload(""))}
    assert service.post("/layout?format=ALTO", files=page).text == "page as alto"


@pytest.mark.parametrize("accept", [None, "*/*", "application/json", "image/gif, application/*;q=0.1"])
def test_a_stored_result_is_json(service: httpx.Client, accept: str | None) -> None:
    result = service.post("/layout", files={"image": ("p.png", upload(""))}).headers["document-result"]
    assert result.startswith("/documents/layout/results/")
    headers = {} if accept is None else {"Accept": accept}
    assert service.get(result, headers=headers).headers["content-type"] == "application/json"


def test_paths_in_answers_begin_with_the_prefix(service: httpx.Client) -> None:
    accepted = rectify(service, headers=LATER)
    status = accepted.json()
    assert accepted.headers["location"] == f"/documents/jobs/{status['id']}"
    assert status["links"] == {
        "result": f"/documents/jobs/{status['id']}/result",
        "events": f"/documents/jobs/{status['id']}/events",
    }
    events = service.get(status["links"]["events"]).text  # with the prefix: the proxy may leave it
    last = json.loads(events.strip().splitlines()[-1].removeprefix("data: "))
    assert (last["state"], last["poll_after_s"]) == ("succeeded", None)
    assert service.get(status["links"]["result"]).text == "flat as jpeg"
    assert service.get("/openapi.json").json()["servers"] == [{"url": "/documents"}]


def test_a_job_says_when_to_ask_again(service: httpx.Client, tmp_path: Path) -> None:
    job = rectify(service, script=f"wait {tmp_path}", headers=LATER).json()
    response = service.get(f"/jobs/{job['id']}")
    assert response.headers["retry-after"] == str(response.json()["poll_after_s"]) == "1"
    (tmp_path / "go").touch()
    service.get(f"/jobs/{job['id']}/events")
    assert "retry-after" not in service.get(f"/jobs/{job['id']}").headers


def test_the_same_upload_is_one_job(service: httpx.Client, tmp_path: Path) -> None:
    headers = {**LATER, "Idempotency-Key": "mine"}
    first, again = (rectify(service, script=f"wait {tmp_path}", headers=headers) for _ in range(2))
    assert (first.status_code, again.status_code) == (202, 202)
    assert first.headers["location"] == again.headers["location"]
    new = rectify(service, script=f"wait {tmp_path}", headers={**LATER, "Idempotency-Key": "new"})
    assert new.headers["location"] != first.headers["location"]
    (tmp_path / "go").touch()
    service.get(first.json()["links"]["events"])
    later = rectify(service, script=f"wait {tmp_path}", headers=headers)
    assert (later.headers["location"], later.json()["state"]) == (first.headers["location"], "succeeded")


def test_browser_apps_of_named_origins_may_read_the_facts(service: httpx.Client) -> None:
    response = rectify(service, headers={"Origin": ORIGIN})
    assert response.headers["access-control-allow-origin"] == ORIGIN
    exposed = set(response.headers["access-control-expose-headers"].split(", "))
    assert exposed >= {"Document-Kind", "Document-Warnings", "Document-Unplaced", "Document-Result"}
    assert exposed >= {"Location", "ETag", "X-Request-ID", "Retry-After"}
    refused = rectify(service, headers={"Origin": ORIGIN}, data={"kind": "round"})
    assert refused.headers["access-control-allow-origin"] == ORIGIN
    assert (
        "access-control-allow-origin"
        not in rectify(service, headers={"Origin": "https://evil.example"}).headers
    )


def test_a_browser_may_ask_first(service: httpx.Client) -> None:
    asked = {"Access-Control-Request-Method": "POST", "Access-Control-Request-Headers": "x-api-key, prefer"}
    answer = service.options("/rectify", headers={"Origin": ORIGIN, **asked})
    assert answer.status_code == 200
    assert answer.headers["access-control-allow-headers"] == "x-api-key, prefer"
    assert service.options("/rectify", headers={"Origin": "https://evil.example", **asked}).status_code == 400


def test_no_origin_without_the_setting() -> None:
    with serving() as client:
        assert (
            "access-control-allow-origin"
            not in client.get("/health/live", headers={"Origin": ORIGIN}).headers
        )


def test_the_documentation_needs_no_other_host(service: httpx.Client) -> None:
    for path in ("/", "/docs"):
        page = service.get(path)
        assert page.headers["content-type"].startswith("text/html")
        links = re.findall(r"""(?:src|href|url)\s*[=:]\s*["']([^"']+)["']""", page.text)
        assert links
        for link in (link for link in links if not link.startswith("#")):
            assert link.startswith("/documents/")
            assert service.get(link).status_code == 200


def test_keys_in_every_way_that_clients_know() -> None:
    with serving(api_keys="first, second") as client:
        with_key = {"X-API-Key": "first"}
        assert client.get("/layout/models", headers={"Authorization": "Bearer second"}).status_code == 200
        assert (
            client.get("/layout/models", headers={**with_key, "Authorization": "bearer first"}).status_code
            == 200
        )
        both = {**with_key, "Authorization": "Bearer second"}
        assert_problem(client.get("/layout/models", headers=both), 403, "forbidden")
        basic = client.get("/layout/models", headers={"Authorization": "Basic Zmlyc3Q6"})
        assert_problem(basic, 401, "unauthorized")
        assert "Bearer" in basic.headers["www-authenticate"]
        assert_problem(client.post("/tokens"), 401, "unauthorized")
        token = client.post("/tokens", headers=with_key).json()["token"]
        assert "first" not in token
        job = rectify(client, headers={**with_key, **LATER}).json()
        events = client.get(job["links"]["events"], params={"token": token})
        assert "succeeded" in events.text
        assert client.get(job["links"]["result"], params={"token": token}).text == "flat as jpeg"
        assert client.head(job["links"]["result"], params={"token": token}).status_code == 200
        stranger = client.post("/tokens", headers={"X-API-Key": "second"}).json()["token"]
        assert_problem(client.get(job["links"]["result"], params={"token": stranger}), 404, "not-found")
        assert_problem(client.get("/layout/models", params={"token": token + "x"}), 403, "forbidden")
        assert_problem(rectify(client, path=f"/rectify?token={token}"), 401, "unauthorized")
        assert_problem(client.delete(f"/jobs/{job['id']}?token={token}"), 401, "unauthorized")


@pytest.mark.parametrize("prefix", ["documents", "/documents/", "/a b", "//"])
def test_a_prefix_has_one_form(prefix: str) -> None:
    with pytest.raises(ValueError, match="root_path"):
        Settings(root_path=prefix)

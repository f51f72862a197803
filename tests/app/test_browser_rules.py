"""Security headers of every kind of response, and requests that pages of other sites send."""

import json

import httpx
import pytest

from tests.app.scripts import upload
from tests.app.serving import serving
from tests.app.test_problems import assert_problem

OTHER = "https://app.example.org"
PHOTO = {"image": upload("")}
FROM_ELSEWHERE = [
    {"Sec-Fetch-Site": "cross-site", "Origin": OTHER},
    {"Sec-Fetch-Site": "same-site", "Origin": OTHER},
    {"Sec-Fetch-Site": "cross-site"},
    {"Origin": OTHER},
    {"Origin": "null"},
]


def policy(response: httpx.Response) -> dict[str, str]:
    parts = (part.partition(" ") for part in response.headers["content-security-policy"].split("; "))
    return {name: sources for name, _, sources in parts}


@pytest.mark.parametrize("path", ["/", "/static/main.js"])
def test_the_page_runs_only_its_own_files(client: httpx.Client, path: str) -> None:
    response = client.get(path)
    rules = policy(response)
    assert response.status_code == 200
    assert rules["default-src"] == rules["frame-ancestors"] == rules["base-uri"] == "'none'"
    assert rules["script-src"] == rules["style-src"] == rules["connect-src"] == "'self'"
    assert "unsafe" not in response.headers["content-security-policy"]


def test_the_page_has_no_inline_script_or_style(client: httpx.Client) -> None:
    html = client.get("/").text
    assert "<style" not in html
    assert " style=" not in html
    assert all(' src="' in tag for tag in html.split("<script")[1:])


@pytest.mark.parametrize(
    "path",
    ["/", "/docs", "/static/main.js", "/layout/models", "/nowhere", "/jobs/1", "/static/%2e%2e/main.py"],
)
def test_no_response_is_framed_or_sniffed(client: httpx.Client, path: str) -> None:
    response = client.get(path)
    assert policy(response)["frame-ancestors"] == "'none'"
    assert response.headers["x-frame-options"] == "DENY"
    assert response.headers["x-content-type-options"] == "nosniff"
    assert response.headers["referrer-policy"] == "no-referrer"


def test_an_image_is_for_pages_of_this_service_unless_other_origins_are_named(client: httpx.Client) -> None:
    name = "cross-origin-resource-policy"
    response = client.post("/rectify", files=PHOTO)
    assert response.headers[name] == "same-origin"
    assert policy(response)["default-src"] == "'none'"
    with serving(cors_origins=OTHER) as open_client:
        assert name not in open_client.post("/rectify", files=PHOTO).headers


@pytest.mark.parametrize(
    "path", ["../main.py", "%2e%2e/main.py", "..%2fmain.py", "vendor/%2e%2e/%2e%2e/main.py", "//etc/passwd"]
)
def test_only_static_files_are_static(client: httpx.Client, path: str) -> None:
    response = client.get(httpx.URL(str(client.base_url).rstrip("/"), raw_path=b"/static/" + path.encode()))
    assert response.status_code == 404
    assert "create_app" not in response.text


@pytest.mark.parametrize("headers", FROM_ELSEWHERE, ids=str)
def test_another_site_cannot_write(client: httpx.Client, headers: dict[str, str]) -> None:
    assert_problem(client.post("/rectify", files=PHOTO, headers=headers), 403, "forbidden")
    assert_problem(client.delete("/layout/models/letter", headers=headers), 403, "forbidden")


def test_the_own_page_named_origins_and_other_programs_write() -> None:
    with serving(cors_origins=OTHER) as client:
        own = f"{client.base_url.scheme}://{client.base_url.netloc.decode()}"
        for headers in (
            {},
            {"Sec-Fetch-Site": "none"},
            {"Sec-Fetch-Site": "same-origin", "Origin": own},
            {"Origin": own},
            {"Sec-Fetch-Site": "cross-site", "Origin": OTHER},
        ):
            assert client.post("/rectify", files=PHOTO, headers=headers).status_code == 200
        elsewhere = {"Sec-Fetch-Site": "cross-site", "Origin": "https://evil.example"}
        assert_problem(client.post("/rectify", files=PHOTO, headers=elsewhere), 403, "forbidden")


def test_a_key_in_the_address_is_no_key() -> None:
    with serving(api_keys="secret") as client:
        for name in ("key", "api_key", "X-API-Key", "token"):
            response = client.get("/layout/models", params={name: "secret"})
            assert response.status_code in (401, 403)
            assert "secret" not in response.text


def test_what_shows_the_page_without_a_network_is_there_and_needs_no_key() -> None:
    with serving(api_keys="secret") as client:
        worker = client.get("/service-worker.js")
        assert worker.headers["content-type"].startswith("text/javascript")
        assert policy(worker)["default-src"] == "'none'"
        files = json.loads(worker.text.split("const FILES = ")[1].split(";\n")[0])
        manifest = client.get("/static/manifest.json").json()
        icons = [f"static/{icon['src']}" for icon in manifest["icons"]]
        assert {"static/main.js", "static/scan/view.js", "static/manifest.json", *icons} <= set(files)
        assert [file for file in files if client.get(f"/{file}").status_code != 200] == []

"""Many samples at once: pages by their names, and a report that says what became of each."""

import io
import json
import zipfile
from collections.abc import Iterator, Mapping
from typing import Any

import httpx
import pytest

from app.http.archives import MOST_FILES
from tests.app.scripted_layout import PAGE
from tests.app.scripts import upload
from tests.app.serving import serving
from tests.app.test_problems import assert_problem

PATH = "/layout/models/letter/samples/archive"


@pytest.fixture(scope="module")
def client() -> Iterator[httpx.Client]:
    with serving(max_samples_per_model=50, max_zones_file_bytes=2000, max_upload_bytes=50_000) as client:
        yield client


def page(text: str) -> bytes:
    zones = [{"id": "z1", "box": [1, 2, 9, 8], "label": "sender", "text": text}]
    return json.dumps({**PAGE, "zones": zones}).encode()


def archive(files: Mapping[str, bytes]) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as packed:
        for name, content in files.items():
            packed.writestr(name, content)
    return buffer.getvalue()


def send(client: httpx.Client, content: bytes, **headers: str) -> httpx.Response:
    return client.post(PATH, files={"archive": ("samples.zip", content)}, headers=headers)


def report_of(client: httpx.Client, files: Mapping[str, bytes]) -> dict[str, Any]:
    response = send(client, archive(files))
    assert response.status_code == 200, response.text
    report: dict[str, Any] = response.json()
    assert report["added"] + report["known"] + report["failed"] + report["ignored"] == len(report["pages"])
    return report


def test_pages_are_files_of_one_name(client: httpx.Client) -> None:
    files = {
        "scans/1.PNG": upload(""),
        "page/1.xml": page("one"),
        "2.json": page("two"),
        "readme.txt": b"hello",
    }
    report = report_of(client, {**files, "__MACOSX/._1.PNG": b"", "a/.DS_Store": b""})
    assert [(each["files"], each["status"]) for each in report["pages"]] == [
        (["page/1.xml", "scans/1.PNG"], "added"),
        (["2.json"], "added"),
        (["readme.txt"], "ignored"),
    ]
    first, second = (
        client.get(f"/layout/models/letter/samples/{each['id']}") for each in report["pages"][:2]
    )
    assert first.json()["found"] is not None, "measured in its image"
    assert second.json()["found"] is None
    again = report_of(client, files)
    assert [each["status"] for each in again["pages"]] == ["known", "known", "ignored"]
    assert [each["id"] for each in again["pages"]] == [each["id"] for each in report["pages"]]


@pytest.mark.parametrize(
    ("files", "code", "words"),
    [
        ({"3.json": b"{"}, "invalid-option", "JSON"),
        ({"3.json": page("x" * 3000)}, "too-large", "2000 bytes"),
        ({"3.json": page("3"), "3.png": upload("undecodable-image")}, "undecodable-image", "scripted"),
        ({"3.json": page("3"), "3.png": upload("fail")}, "internal", "Its log has the cause"),
        ({"3.json": page("3"), "3.png": upload("kill")}, "worker-died", ""),
        ({"3.json": page("3"), "3.png": upload(" " * 60_000)}, "too-large", "50000 bytes"),
        ({"a/3.json": page("3"), "b/3.json": page("4")}, "invalid-option", "a name of its own"),
    ],
)
def test_a_page_that_fails_does_not_stop_the_others(
    client: httpx.Client, files: Mapping[str, bytes], code: str, words: str
) -> None:
    report = report_of(client, {**files, "good.json": page("good")})
    bad, good = report["pages"]
    assert (bad["status"], bad["id"], bad["problem"]["code"]) == ("failed", None, code)
    assert words in bad["problem"]["detail"]
    assert good["status"] in {"added", "known"}


def test_names_in_a_report_are_cut(client: httpx.Client) -> None:
    path = f"{'x' * 900}.json"
    [bad, _] = report_of(client, {path: page("y" * 3000), "good.json": page("good")})["pages"]
    assert bad["files"] == [f"{'x' * 199}…"]
    assert bad["problem"]["detail"] == "A file of the archive may have 2000 bytes."


def test_a_full_class_takes_no_more() -> None:
    with serving(max_samples_per_model=2) as client:
        report = report_of(client, {f"{number}.json": page(str(number)) for number in range(3)})
        assert [each["status"] for each in report["pages"]] == ["added", "added", "failed"]
        assert report["pages"][2]["problem"]["code"] == "store-full"


@pytest.mark.parametrize(
    ("content", "status", "code"),
    [
        (b"no archive", 422, "invalid-option"),
        (archive({"1.json": page("1")})[:-30], 422, "invalid-option"),
        (archive({}), 422, "invalid-option"),
        (archive({"1.png": upload("")}), 422, "invalid-option"),
        (archive({f"{number}.json": b"" for number in range(MOST_FILES + 1)}), 413, "too-large"),
    ],
    ids=["no archive", "cut off", "empty", "images alone", "too many files"],
)
def test_what_is_no_archive_of_samples_is_refused(
    client: httpx.Client, content: bytes, status: int, code: str
) -> None:
    problem = assert_problem(send(client, content), status, code)
    assert problem["field"] == "archive"


def test_a_bomb_is_inflated_only_as_far_as_a_file_may_go(client: httpx.Client) -> None:
    report = report_of(client, {"bomb.json": b" " * 20_000_000, "good.json": page("good")})
    assert report["pages"][0]["problem"]["code"] == "too-large"


def test_it_may_be_a_job(client: httpx.Client) -> None:
    accepted = send(client, archive({"5.json": page("five")}), Prefer="respond-async")
    assert accepted.status_code == 202
    path = accepted.headers["location"]
    with client.stream("GET", f"{path}/events") as events:
        last = [line for line in events.iter_lines() if line.startswith("data: ")][-1]
    assert json.loads(last.removeprefix("data: "))["state"] == "succeeded"
    assert client.get(f"{path}/result").json()["added"] == 1

"""The Python client against the scripted service, on a network on which things go wrong. Each test runs for both
clients."""

import dataclasses
import re
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from email.utils import format_datetime
from pathlib import Path
from typing import Any

import httpx
import pytest

from document_rectification_client import DocumentResult, Job, LayoutResult, ProblemError, calls, uploading
from document_rectification_client.models import (
    JobStatus,
    PlainCreasedSheet,
    PlainFailedPage,
    PlainRectifyResult,
)
from document_rectification_client.waiting import retry_after
from tests.app.scripted_layout import PAGE
from tests.app.scripts import upload
from tests.clients.unreliable import Network, on
from tests.end_to_end.forked import ROOT

ADDRESS = "http://127.0.0.1:8000"
FLAT, NO_TEXT = upload(""), upload("no-text")
BUSY = {
    "type": "about:blank",
    "title": "Busy",
    "status": 503,
    "code": "busy",
    "detail": "Full.",
    "request_id": "r",
}


def busy(**headers: str) -> httpx.Response:
    return httpx.Response(503, headers={"Content-Type": "application/problem+json", **headers}, json=BUSY)


@pytest.fixture
def network() -> Network:
    return Network()


@pytest.fixture(params=["sync", "async"])
def client(
    request: pytest.FixtureRequest, url: str, network: Network, monkeypatch: pytest.MonkeyPatch
) -> Iterator[Any]:
    with on(network, request.param, url, monkeypatch) as client:
        yield client


def plain(value: Any) -> Any:
    """JSON without null, of JSON or of an object."""
    if dataclasses.is_dataclass(value):
        names = {field.name: field.name.rstrip("_") for field in dataclasses.fields(value)}
        value = {said: getattr(value, name) for name, said in names.items()}
    if isinstance(value, dict):
        return {key: plain(each) for key, each in value.items() if each is not None}
    return [*map(plain, value)] if isinstance(value, (list, tuple)) else value


def test_photos_become_a_file(client: Any, tmp_path: Path) -> None:
    photo = tmp_path / "photo.jpg"
    photo.write_bytes(FLAT)
    file = client.flatten([photo, FLAT], text=True)
    assert (file.content, file.media_type) == (b"2 as pdf", "application/pdf")
    file.save(tmp_path / "pages.pdf")
    assert [path.name for path in sorted(tmp_path.iterdir())] == ["pages.pdf", "photo.jpg"]
    assert client.flatten(photo, "png").content == b"flat as png"
    partly = client.flatten([FLAT, NO_TEXT])
    assert partly.failed == ("2 no-text",)
    assert client.mosaic([FLAT, FLAT], "jpeg").media_type == "image/jpeg"


def test_answers_are_objects_with_all_that_was_told(client: Any, url: str) -> None:
    pages = client.flatten_pages([upload("creased"), NO_TEXT, FLAT])
    assert [type(page) for page in pages.pages] == [PlainRectifyResult, PlainFailedPage, PlainRectifyResult]
    assert pages.pages[1].problem.code == "no-text"
    call = calls.flatten_pages([upload("creased"), NO_TEXT, FLAT])
    told = httpx.post(url + call.path, files=call.files).json()
    told["pages"][1]["problem"]["request_id"] = pages.pages[1].problem.request_id
    assert plain(pages) == told
    assert isinstance(client.flatten_pages([upload("creased")]).pages[0].surface, PlainCreasedSheet)
    whole = client.mosaic_page([FLAT, FLAT])
    call = calls.mosaic_page([FLAT, FLAT])
    assert plain(whole) == httpx.post(url + call.path, files=call.files).json()


def test_pages_with_labels_are_objects(client: Any, url: str) -> None:
    page = client.layout(zones=PAGE)
    assert isinstance(page, LayoutResult)
    told = httpx.get(f"{url}/layout/results/{page.id}").json()
    assert plain(page) == plain(told)
    assert len(page.zones[0].box) == 4
    document = client.layout([upload("pages-2")])
    assert isinstance(document, DocumentResult)
    assert len(document.pages) == 2


def test_a_problem_says_what_the_service_says(client: Any, network: Network) -> None:
    with pytest.raises(ProblemError, match="scripted no-text") as caught:
        client.flatten([NO_TEXT])
    problem = caught.value
    assert (problem.code, problem.field, problem.status) == ("no-text", "image", 422)
    assert problem.request_id
    with pytest.raises(ProblemError) as caught:
        client.flatten([FLAT], ilumination="bw")
    assert (caught.value.code, caught.value.field) == ("invalid-option", "ilumination")
    assert network.pauses == []


def test_a_busy_service_is_asked_again_when_it_says(client: Any, network: Network) -> None:
    later = format_datetime(datetime.now(UTC) + timedelta(seconds=90), usegmt=True)
    refused = httpx.Response(429, headers={"Retry-After": later})
    network.fates = [httpx.ConnectError("refused"), busy(**{"Retry-After": "7"}), busy(), refused]
    assert client.flatten([FLAT]).content == b"flat as pdf"
    assert network.pauses[:3] == [0.5, 7.0, 2.0]
    assert 80 < network.pauses[3] <= 90
    assert [FLAT in request.read() for request in network.sent] == [True] * 5


@pytest.mark.parametrize(
    ("fates", "code", "wait"),
    [
        ([httpx.ConnectError("refused")] * 5, "unreachable", None),
        ([httpx.ReadTimeout("too long")], "unreachable", None),
        ([busy(**{"Retry-After": "0"}) for _ in range(5)], "busy", 0.0),
        ([busy(**{"Retry-After": "3600"})], "busy", 3600.0),
        ([httpx.Response(500, text="<html>")], "unexpected-answer", None),
        ([httpx.Response(200, text="no JSON")], "unexpected-answer", None),
    ],
)
def test_it_gives_up(client: Any, network: Network, fates: list[Any], code: str, wait: float | None) -> None:
    network.fates = list(fates)
    with pytest.raises(ProblemError) as caught:
        client.flatten_pages([FLAT])
    assert (caught.value.code, caught.value.retry_after_s) == (code, wait)
    assert network.fates == []
    assert len(network.sent) == len(fates)


def test_a_lost_answer_starts_no_second_job(client: Any, network: Network) -> None:
    network.fates = [("after", httpx.RemoteProtocolError("cut off"))]
    job = client.start(calls.flatten([FLAT]))
    assert f'"{job.id}"'.encode() in network.lost[0]
    states: list[JobStatus] = []
    assert client.result(job, states.append).content == b"flat as pdf"
    assert states[-1].state == "succeeded"
    assert (
        client.start(calls.flatten([FLAT]), key="mine").id
        == client.start(calls.flatten([FLAT]), key="mine").id
    )


def test_progress_is_told_until_the_answer(client: Any, network: Network) -> None:
    states: list[JobStatus] = []
    pages = client.flatten_pages([FLAT], progress=states.append)
    assert len(pages.pages) == 1
    assert (states[-1].state, states[-1].progress) == ("succeeded", 1.0)
    assert set(network.pauses) <= {1}
    with pytest.raises(ProblemError, match="scripted no-text") as caught:
        client.flatten([NO_TEXT], progress=states.append)
    assert (states[-1].state, caught.value.code) == ("failed", "no-text")


def test_a_job_is_found_again_and_cancelled(client: Any, tmp_path: Path) -> None:
    started = client.start(calls.flatten([upload(f"wait {tmp_path}")]))
    job = Job(started.id, calls.read_file)
    assert client.look(job).state in ("queued", "running")
    client.cancel(job)
    with pytest.raises(ProblemError) as caught:
        client.result(job)
    assert (caught.value.code, caught.value.status) == ("cancelled", 410)
    with pytest.raises(ProblemError) as caught:
        client.look(Job("../health/live", calls.read_file))
    assert caught.value.code == "not-found"


@pytest.mark.parametrize("page", ["README.md", "clients/README.md"])
def test_what_is_told_runs_as_written(
    page: str, url: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, network: Network
) -> None:
    (code,) = re.findall(r"^```python\n(.*?)^```", (ROOT / page).read_text("utf-8"), re.MULTILINE | re.DOTALL)
    assert ADDRESS in code
    for name in ("a.jpg", "b.jpg", "c.jpg"):
        (tmp_path / name).write_bytes(FLAT)
    monkeypatch.chdir(tmp_path)
    with on(network, "sync", url, monkeypatch):
        exec(code.replace(ADDRESS, url.rstrip("/")), {})
    assert (tmp_path / "pages.pdf").read_bytes().endswith(b"as pdf")


@pytest.mark.parametrize(
    ("header", "seconds"), [("0", 0.0), ("", None), ("soon", None), ("Thu, 01 Jan 1970 00:00:00 GMT", 0.0)]
)
def test_retry_after(header: str, seconds: float | None) -> None:
    assert retry_after(httpx.Response(503, headers={"Retry-After": header})) == seconds


@pytest.fixture(params=["sync", "async"])
def thrifty(
    request: pytest.FixtureRequest, url: str, network: Network, monkeypatch: pytest.MonkeyPatch
) -> Iterator[Any]:
    """A client that sends in pieces of 16 bytes what has more than 64."""
    monkeypatch.setattr(uploading, "PIECE_BYTES", 16)
    with on(network, request.param, url, monkeypatch, pieces_above=64) as client:
        yield client


def methods(network: Network) -> list[str]:
    """Of what was sent since the last call of this."""
    sent, network.sent = network.sent, []
    return [request.method for request in sent]


def test_what_is_large_is_sent_in_pieces_and_goes_on_after_breaks(thrifty: Any, network: Network) -> None:
    photos = [FLAT + b" " * 13, FLAT]
    lost = ("after", httpx.ReadError("cut off"))
    network.fates = [None, httpx.WriteError("cut off"), None, lost, None, busy(), None, None, None]
    direct = calls.flatten_pages(photos)
    assert thrifty.answer(direct) is not None
    # The first photo: a piece is lost, its second try is kept though its answer is lost, the third one meets a busy
    # service. Nothing that was kept is sent again.
    first = ["POST", "PATCH", "HEAD", "PATCH", "HEAD", "PATCH", "HEAD", "PATCH", "PATCH"]
    assert methods(network) == [*first, "POST", *["PATCH"] * 3, "POST", "DELETE", "DELETE"]
    assert network.pauses == [0.5, 1, 0.5]  # the second piece of the first photo came after all
    assert thrifty.flatten([FLAT], "png").content == b"flat as png"
    assert methods(network) == ["POST"]


def test_an_upload_stands_for_a_photo_until_it_is_forgotten(thrifty: Any, tmp_path: Path) -> None:
    path = tmp_path / "my photo.png"
    path.write_bytes(FLAT)
    photo = thrifty.upload(path)
    for _ in range(2):
        assert thrifty.mosaic([photo, FLAT], "png").content == b"flat as png"
    assert thrifty.flatten(photo).content == b"flat as pdf"
    assert thrifty.flatten([photo, FLAT], "pdf", progress=lambda job: None).content == b"2 as pdf"
    thrifty.forget(photo)
    with pytest.raises(ProblemError) as caught:
        thrifty.flatten([photo])
    assert caught.value.code == "not-found"


def test_a_network_that_stays_away_and_a_refusal_are_told(thrifty: Any, network: Network) -> None:
    network.fates = [None, *[httpx.ConnectError("refused"), None] * 5]
    with pytest.raises(ProblemError) as caught:
        thrifty.upload(FLAT)
    assert (caught.value.code, network.pauses) == ("unreachable", [0.5, 1, 2, 4])
    network.fates = [None, httpx.Response(415)]
    with pytest.raises(ProblemError) as caught:
        thrifty.upload(FLAT)
    assert caught.value.status == 415
    methods(network)
    with pytest.raises(ProblemError, match="scripted no-text"):
        thrifty.flatten([NO_TEXT + b" " * 64])
    assert methods(network)[-2:] == ["POST", "DELETE"]


def test_a_service_that_knows_no_uploads_gets_the_photos_as_ever(thrifty: Any, network: Network) -> None:
    network.fates = [httpx.Response(404)]
    assert thrifty.flatten([FLAT, FLAT], "pdf").content == b"2 as pdf"
    assert methods(network) == ["POST", "POST"]

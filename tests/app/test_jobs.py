"""`Prefer: respond-async` and /jobs: the same work and the same answers, later."""

import json
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from threading import Thread
from typing import Any

import httpx
import psutil
import pytest
from starlette.datastructures import Headers

from app.http.wishes import prefers_async
from tests.app.scripted_layout import PAGE
from tests.app.scripts import upload
from tests.app.serving import POLL_S, serving
from tests.app.test_health import sample
from tests.app.test_problems import assert_problem

LATER = {"Prefer": "respond-async"}
ROUTES: list[tuple[str, Callable[[bytes], dict[str, Any]]]] = [
    ("/rectify", lambda photo: {"files": {"image": photo}}),
    ("/mosaic", lambda photo: {"files": [("images", photo), ("images", upload(""))]}),
    ("/layout", lambda photo: {"files": {"image": photo}, "data": {"format": "png"}}),
]


def start(client: httpx.Client, script: str, headers: dict[str, str] | None = None) -> str:
    """Path of a new job of /rectify."""
    sent = {**LATER, **(headers or {})}
    response = client.post("/rectify", files={"image": upload(script)}, headers=sent)
    assert response.status_code == 202
    return response.headers["location"]


def until(client: httpx.Client, path: str, *states: str) -> dict[str, Any]:
    """The job when it has come to one of the states, by default to its end."""
    deadline = time.monotonic() + 10
    while True:
        job: dict[str, Any] = client.get(path).json()
        if job["state"] in (states or {"succeeded", "failed", "cancelled"}):
            return job
        assert time.monotonic() < deadline, job
        time.sleep(POLL_S)


def events(lines: Iterator[str]) -> Iterator[tuple[str, dict[str, Any]]]:
    """Ids and data of server-sent events."""
    event: dict[str, str] = {}
    for line in lines:
        if line:
            name, _, value = line.partition(": ")
            event[name] = value
        elif event:
            yield event["id"], json.loads(event["data"])
            event = {}


@pytest.mark.parametrize(("path", "body"), ROUTES)
def test_the_answer_is_the_same_later(
    client: httpx.Client, path: str, body: Callable[[bytes], dict[str, Any]]
) -> None:
    now = client.post(path, **body(upload("")))
    accepted = client.post(path, **body(upload("")), headers=LATER)
    assert accepted.status_code == 202
    assert accepted.headers["preference-applied"] == "respond-async"
    assert accepted.json()["state"] == "queued"
    assert accepted.headers["location"] == f"/jobs/{accepted.json()['id']}"
    job = until(client, accepted.headers["location"])
    assert (job["state"], job["progress"], job["problem"]) == ("succeeded", 1.0, None)
    assert job["created"] <= job["started"] <= job["ended"]
    for _ in range(2):
        later = client.get(f"{accepted.headers['location']}/result")
        assert (later.status_code, later.content) == (now.status_code, now.content)
        own = {"x-request-id", "date", "document-result", "etag"}
        assert {name: later.headers[name] for name in later.headers if name not in own} == {
            name: now.headers[name] for name in now.headers if name not in own
        }


def test_a_form_of_encoded_fields_may_be_a_job(client: httpx.Client) -> None:
    fields = {"zones": json.dumps(PAGE), "format": "json"}
    headers = {**LATER, "Idempotency-Key": "encoded fields"}
    accepted, repeated = (client.post("/layout", data=fields, headers=headers) for _ in range(2))
    assert accepted.status_code == 202, accepted.text
    assert repeated.headers["location"] == accepted.headers["location"]
    assert until(client, accepted.headers["location"])["state"] == "succeeded"
    zones = client.get(f"{accepted.headers['location']}/result").json()["zones"]
    assert zones == client.post("/layout", data=fields).json()["zones"]
    fields["callback_url"] = "https://other.example.org/"
    assert_problem(client.post("/layout", data=fields, headers=LATER), 422, "invalid-option")


def test_models_are_made_and_trained_later(client: httpx.Client) -> None:
    path = "/layout/models/made-later"
    page = {"width": 20, "height": 30, "zones": [{"id": "z1", "box": [1, 2, 9, 8], "label": "date"}]}
    assert_problem(client.post(f"{path}/train", headers=LATER), 404, "not-found")
    assert_problem(client.post(f"{path}/initialize", headers=LATER), 404, "not-found")
    assert client.post(f"{path}/samples", json=page).status_code == 201
    for version, action in enumerate(("initialize", "train"), 1):
        accepted = client.post(f"{path}/{action}", headers=LATER)
        assert accepted.status_code == 202
        job = accepted.headers["location"]
        assert until(client, job)["state"] == "succeeded"
        result = client.get(f"{job}/result")
        assert (result.status_code, result.json()["version"]) == (200, version)
        assert result.headers["etag"] == f'"{version}"'
    stale = client.post(f"{path}/train", headers={**LATER, "If-Match": '"1"'})
    assert_problem(stale, 412, "conflict")


def test_a_job_says_how_far_it_is(client: httpx.Client, tmp_path: Path) -> None:
    path = start(client, f"wait {tmp_path}")
    with client.stream("GET", f"{path}/events") as stream:
        assert stream.headers["content-type"].startswith("text/event-stream")
        heard = events(stream.iter_lines())
        while (told := next(heard)[1])["stage"] != "waiting":
            assert told["state"] in {"queued", "running"}
        assert (told["state"], told["progress"], told["ended"]) == ("running", 0.25, None)
        assert client.get(path).json() == told
        assert_problem(client.get(f"{path}/result"), 409, "not-finished")
        (tmp_path / "go").touch()
        *_, (last_id, last) = heard
    assert last == client.get(path).json()
    assert last["state"] == "succeeded"
    with client.stream("GET", f"{path}/events") as stream:
        assert list(events(stream.iter_lines())) == [(last_id, last)]
    assert client.get(f"{path}/events", headers={"Last-Event-ID": last_id}).status_code == 204


def test_files_live_as_long_as_their_job(tmp_path: Path) -> None:
    with serving() as client:
        first = start(client, f"wait {tmp_path}")
        until(client, first, "running")
        large = upload("") + b" " * 3_000_000  # more than stays in memory
        accepted = client.post("/rectify", files={"image": large}, headers=LATER)
        second = accepted.headers["location"]
        assert client.get(second).json()["state"] == "queued"
        (tmp_path / "go").touch()
        assert until(client, second)["state"] == "succeeded"
        assert client.get(f"{second}/result").content == b"flat as jpeg"


def test_a_job_that_fails_tells_why(client: httpx.Client) -> None:
    path = start(client, "no-text", {"X-Request-ID": "the-request"})
    job = until(client, path)
    assert (job["state"], job["problem"]["code"]) == ("failed", "no-text")
    assert job["problem"]["request_id"] == "the-request"
    result = client.get(f"{path}/result")
    assert (result.status_code, result.json()) == (422, job["problem"])
    assert result.headers["content-type"] == "application/problem+json"


def test_a_defect_is_not_told_more_of_later(client: httpx.Client) -> None:
    job = until(client, start(client, "fail"))
    assert job["problem"]["code"] == "internal"
    assert "secret" not in str(job)


def test_what_can_be_judged_at_once_is_no_job(client: httpx.Client) -> None:
    response = client.post(
        "/rectify", files={"image": upload("")}, data={"region": "nonsense"}, headers=LATER
    )
    assert_problem(response, 422, "invalid-option")
    assert_problem(client.post("/rectify", headers=LATER), 400, "bad-request")


def test_cancelling_stops_the_worker_and_frees_the_seat(tmp_path: Path) -> None:
    with serving(queue_length=1) as client:
        running = start(client, f"wait {tmp_path}")
        until(client, running, "running")
        queued = start(client, "")
        deadline = time.monotonic() + 10
        while not (tmp_path / "running").exists():
            assert time.monotonic() < deadline
            time.sleep(POLL_S)
        worker = psutil.Process(int((tmp_path / "running").read_text()))
        for path in (queued, running):
            assert client.delete(path).status_code == 204
            assert client.get(path).json()["state"] == "cancelled"
        worker.wait(10)
        assert_problem_of(client.get(f"{running}/result"), 410, "cancelled")
        assert client.get(queued).json()["started"] is None
        assert client.post("/rectify", files={"image": upload("")}).status_code == 200
        done = start(client, "")
        until(client, done)
        for path in (done, running):  # finished jobs are deleted
            assert client.delete(path).status_code == 204
            assert_problem_of(client.get(path), 404, "not-found")
            assert_problem_of(client.get(f"{path}/result"), 404, "not-found")


def assert_problem_of(response: httpx.Response, status: int, code: str) -> None:
    assert (response.status_code, response.json()["code"]) == (status, code)


def test_the_queue_of_jobs_is_bounded_apart_from_seats(tmp_path: Path) -> None:
    with serving(max_jobs=2, queue_length=0) as client:
        paths = [start(client, f"wait {tmp_path}") for _ in range(2)]
        refused = client.post("/rectify", files={"image": upload("")}, headers=LATER)
        assert_problem(refused, 503, "busy")
        assert "MAX_JOBS" in refused.json()["detail"]
        (tmp_path / "go").touch()
        for path in paths:
            assert until(client, path)["state"] == "succeeded"
        until(client, start(client, ""))


def test_a_full_queue_finds_the_job_of_a_key(tmp_path: Path) -> None:
    with serving(max_jobs=1, api_keys=("mine", "yours")) as client:
        client.headers["X-API-Key"] = "mine"
        headers = {**LATER, "Idempotency-Key": "once"}

        def send(**others: str) -> httpx.Response:
            files = {"image": upload(f"wait {tmp_path}")}
            return client.post("/rectify", files=files, headers={**headers, **others})

        path = send().headers["location"]
        again = send()
        assert (again.status_code, again.headers.get("location")) == (202, path)
        for others in ({"Idempotency-Key": "another"}, {"X-API-Key": "yours"}):
            assert_problem(send(**others), 503, "busy")
        other_body = client.post("/rectify", files={"image": upload("")}, headers=headers)
        assert_problem(other_body, 409, "conflict")
        client.delete(path)


def test_metrics_tell_the_queue(tmp_path: Path) -> None:
    with serving() as client:
        first, second = (start(client, f"wait {tmp_path}") for _ in range(2))
        until(client, first, "running")
        text = client.get("/metrics").text
        names = ("job_queue_depth", "job_queue_running", "job_attempts_total")
        assert [sample(text, name) for name in names] == [1, 1, 1]
        assert sample(text, "job_queue_oldest_seconds") > 0
        assert sample(text, "job_blob_bytes") > 0
        ready = client.get("/health/ready").json()
        assert (ready["blobs"], ready["queue"], ready["job_runners"]) == ("ready", "ready", 1)
        for path in (first, second):
            client.delete(path)


def test_the_oldest_finished_job_gives_way_to_a_new_one() -> None:
    with serving(max_jobs=2) as client:
        paths = []
        for _ in range(3):
            paths.append(start(client, ""))
            until(client, paths[-1])
        deadline = time.monotonic() + 20
        while client.get(paths[0]).status_code != 404:
            assert time.monotonic() < deadline
            time.sleep(POLL_S)


def test_a_listener_that_leaves_makes_room(tmp_path: Path) -> None:
    with serving(max_job_listeners=1) as client:
        path = start(client, f"wait {tmp_path}")
        with client.stream("GET", f"{path}/events") as stream:
            lines = stream.iter_lines()  # kept, for it closes the stream when it goes
            next(lines)
            refused = client.get(f"{path}/events")
            assert_problem(refused, 503, "busy")
            assert "MAX_JOB_LISTENERS" in refused.json()["detail"]
        deadline = time.monotonic() + 10
        status = 503
        while status != 200:
            with client.stream("GET", f"{path}/events") as stream:
                status = stream.status_code
            assert time.monotonic() < deadline
            time.sleep(POLL_S)
        client.delete(path)


def test_a_job_belongs_to_its_key() -> None:
    with serving(api_keys=("mine", "yours")) as client:
        path = start(client, "", {"X-API-Key": "mine"})
        yours = {"X-API-Key": "yours"}
        for resource in (path, f"{path}/result", f"{path}/events"):
            assert_problem(client.get(resource, headers=yours), 404, "not-found")
            assert_problem(client.get(resource), 401, "unauthorized")
        assert_problem(client.delete(path, headers=yours), 404, "not-found")
        assert client.get(path, headers={"X-API-Key": "mine"}).status_code == 200


def test_no_such_job(client: httpx.Client) -> None:
    for resource in ("/jobs/nothing", "/jobs/nothing/result", "/jobs/nothing/events"):
        assert_problem(client.get(resource), 404, "not-found")
    assert_problem(client.delete("/jobs/nothing"), 404, "not-found")


def test_the_service_stops_when_its_jobs_have_ended(tmp_path: Path) -> None:
    heard: list[str] = []

    def listen(url: httpx.URL, path: str) -> None:
        with httpx.Client(base_url=url, timeout=30) as own, own.stream("GET", f"{path}/events") as stream:
            for _, job in events(stream.iter_lines()):
                heard.append(job["state"])

    with ExitStack() as service:
        client = service.enter_context(serving())
        path = start(client, f"wait {tmp_path}")
        until(client, path, "running")
        listener = Thread(target=listen, args=(client.base_url, path))
        listener.start()
        deadline = time.monotonic() + 10
        while not heard:
            assert time.monotonic() < deadline
            time.sleep(POLL_S)
        stopping = Thread(target=service.pop_all().close)
        stopping.start()
        url = client.base_url
        while True:
            try:
                httpx.get(url.join("/health/live"))
            except httpx.TransportError:
                break  # it takes nothing new any more
            assert time.monotonic() < deadline
            time.sleep(POLL_S)
        assert stopping.is_alive()
        (tmp_path / "go").touch()
        stopping.join(10)
        listener.join(10)
    assert heard[-1] == "succeeded"


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ([], False),
        (["respond-async"], True),
        (["Respond-Async"], True),
        (["return=minimal, respond-async; x=1"], True),
        (["wait=10", "respond-async"], True),
        (["respond-asynchronously"], False),
        (['foo="respond-async"'], False),
        ([""], False),
    ],
)
def test_the_preference_among_others(values: list[str], expected: bool) -> None:
    headers = Headers(raw=[(b"prefer", value.encode()) for value in values])
    assert prefers_async(headers) is expected


@pytest.mark.parametrize("path", ["/rectify", "/layout"])
def test_an_empty_upload_is_refused_at_once(client: httpx.Client, path: str) -> None:
    response = client.post(path, files={"image": ("page.jpg", b"")}, headers=LATER)
    assert assert_problem(response, 415, "unsupported-media-type")["field"] == "image"

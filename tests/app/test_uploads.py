"""Bodies that are too large, too slow or not wanted, and refusals that can be read all the same."""

import json
import socket
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from threading import Thread

import httpx
import pytest

from tests.app.raw import Answer, connect, form, head, read_answer
from tests.app.scripted_layout import PAGE
from tests.app.scripts import upload
from tests.app.serving import POLL_S, serving
from tests.app.test_health import sample

LIMIT = 100_000


def code(answer: Answer) -> str:
    assert answer.headers["content-type"] == "application/problem+json"
    problem: dict[str, str] = json.loads(answer.body)
    return problem["code"]


def until_sample(client: httpx.Client, name: str, value: float) -> None:
    deadline = time.monotonic() + 60
    while sample(client.get("/metrics").text, name) != value:
        assert time.monotonic() < deadline, name
        time.sleep(POLL_S)


def post_until_taken(client: httpx.Client, folder: Path) -> None:
    """Post a photo that waits for `folder/go`, again where a slow machine sent it too late (408) or the seat of
    an earlier one is not free yet (503)."""
    files = {"image": upload(f"wait {folder}")}
    while client.post("/rectify", files=files).status_code in (408, 503):
        time.sleep(POLL_S)


@contextmanager
def occupied(client: httpx.Client, folder: Path, jobs: int) -> Iterator[None]:
    """All `jobs` seats are taken inside of the block."""
    threads = [Thread(target=post_until_taken, args=(client, folder)) for _ in range(jobs)]
    for thread in threads:
        thread.start()
    try:
        until_sample(client, "engine_admitted", jobs)
        yield
    finally:
        (folder / "go").touch()
        for thread in threads:
            thread.join()


@pytest.fixture(scope="module")
def small() -> Iterator[httpx.Client]:
    """A service with small limits."""
    with serving(
        max_upload_bytes=LIMIT,
        max_document_upload_bytes=LIMIT,
        queue_length=1,
        body_timeout_s=0.4,
        max_drain_bytes=4_000_000,
        drain_timeout_s=1,
    ) as client:
        yield client


def test_a_declared_size_over_the_limit_is_refused_before_the_body(small: httpx.Client) -> None:
    with connect(small) as connection:
        connection.sendall(head(LIMIT + 1))  # and nothing of the body
        answer = read_answer(connection)
    assert (answer.status, code(answer)) == (413, "too-large")
    assert b"MAX_DOCUMENT_UPLOAD_BYTES" in answer.body
    assert answer.headers["connection"] == "close"


def test_a_client_that_sends_first_can_read_the_refusal(small: httpx.Client) -> None:
    body = form(upload("") + b" " * 3_000_000)
    with connect(small) as connection:
        connection.sendall(head(len(body)) + body)
        time.sleep(0.05)  # the answer is there and the client has not looked yet
        answer = read_answer(connection)
        assert (answer.status, code(answer)) == (413, "too-large")
        assert connection.recv(1) == b""  # closed in order, not reset


def test_chunks_are_counted(small: httpx.Client) -> None:
    with connect(small) as connection:
        connection.sendall(head(None))
        chunk = b"x" * 60_000
        for piece in (form(b"")[:-12], chunk, chunk):
            connection.sendall(f"{len(piece):x}\r\n".encode() + piece + b"\r\n")
        answer = read_answer(connection)
    assert (answer.status, code(answer)) == (413, "too-large")


def test_a_chunked_body_within_the_limit_is_taken(small: httpx.Client) -> None:
    with connect(small) as connection:
        body = form(upload(""))
        connection.sendall(head(None) + f"{len(body):x}\r\n".encode() + body + b"\r\n0\r\n\r\n")
        assert read_answer(connection).body == b"flat as jpeg"


def test_the_rest_of_a_refused_body_is_read_only_so_far(small: httpx.Client) -> None:
    with connect(small) as connection:
        connection.sendall(head(1_000_000_000))
        begin = time.monotonic()
        sent = 0
        try:
            while time.monotonic() - begin < 10:
                sent += connection.send(b" " * 65_536)
        except OSError:  # closed upon us
            pass
    assert time.monotonic() - begin < 5
    assert sent < 60_000_000  # what is read is bounded by 4 MB; the rest sits in the sockets' buffers


def test_a_slow_body_loses_its_seat(small: httpx.Client) -> None:
    with connect(small) as connection:
        begin = time.monotonic()
        connection.sendall(head(1000) + form(b"")[:50])
        answer = read_answer(connection)
    assert (answer.status, code(answer)) == (408, "request-timeout")
    assert 0.4 <= time.monotonic() - begin < 3
    assert b"BODY_TIMEOUT_S" in answer.body
    assert sample(small.get("/metrics").text, "engine_admitted") == 0


def test_dripping_does_not_extend_the_time(small: httpx.Client) -> None:
    with connect(small) as connection:
        connection.sendall(head(1000) + form(b"")[:50])
        connection.settimeout(0.05)
        begin = time.monotonic()
        while time.monotonic() - begin < 5:
            try:
                connection.sendall(b"x")
                first = connection.recv(20)
                break
            except TimeoutError:
                continue
    assert first.startswith(b"HTTP/1.1 408")


def test_a_full_queue_refuses_before_the_body(small: httpx.Client, tmp_path: Path) -> None:
    with occupied(small, tmp_path, 2), connect(small) as connection:
        connection.sendall(head(50_000))  # and nothing of the body
        answer = read_answer(connection)
    assert (answer.status, code(answer)) == (503, "busy")
    assert 1 <= int(answer.headers["retry-after"]) <= 60
    assert b"QUEUE_LENGTH" in answer.body


def test_a_full_queue_does_not_ask_for_the_body(small: httpx.Client, tmp_path: Path) -> None:
    with occupied(small, tmp_path, 2), connect(small) as connection:
        connection.sendall(head(50_000, extra="Expect: 100-continue\r\n"))
        assert read_answer(connection).status == 503  # and no 100 before it


def test_a_full_queue_leaves_the_rest_of_the_service_alone(small: httpx.Client, tmp_path: Path) -> None:
    with occupied(small, tmp_path, 2):
        assert small.post("/rectify", files={"image": upload("")}).json()["code"] == "busy"
        assert small.get("/health/live").status_code == 200
        assert small.get("/health/ready").json()["admitted"] == 2
        assert small.post("/health/live").status_code == 405
    assert small.post("/rectify", files={"image": upload("")}).status_code == 200


def test_other_refusals_can_be_read_too(small: httpx.Client) -> None:
    body = form(b" " * 2_000_000)
    for path, status in (("/nowhere", 404), ("/health/live", 405)):
        with connect(small) as connection:
            connection.sendall(head(len(body), path) + body)
            assert read_answer(connection).status == status


def test_a_connection_is_kept_where_nothing_is_left_unread(small: httpx.Client) -> None:
    body = form(upload(""))
    with connect(small) as connection:
        for _ in range(2):
            connection.sendall(head(len(body)) + body)
            answer = read_answer(connection)
            assert answer.body == b"flat as jpeg"
            assert "connection" not in answer.headers


def test_a_client_that_leaves_stops_its_job() -> None:
    with serving(queue_length=0) as client:
        body = form(upload("hang"))
        connection = connect(client)
        connection.sendall(head(len(body)) + body)
        until_sample(client, "engine_running", 1)
        connection.close()
        until_sample(client, "engine_admitted", 0)
        assert client.post("/rectify", files={"image": upload("")}).status_code == 200
        text = client.get("/metrics").text
        assert sample(text, 'jobs_total{outcome="cancelled"}') == 1
        assert sample(text, 'http_requests_total{method="POST",path="/rectify",status="499"}') == 1


def test_unfinished_bodies_take_no_seat() -> None:
    """18 uploads at one byte a second kept all other clients out for a minute."""
    with serving(queue_length=0) as client, ExitStack() as open_connections:
        for _ in range(18):
            connection = open_connections.enter_context(connect(client))
            connection.sendall(head(1000) + form(b"")[:50])
        assert client.post("/rectify", files={"image": upload("")}).status_code == 200
        assert sample(client.get("/metrics").text, "engine_admitted") == 0


def test_a_full_service_refuses_a_body_that_arrives_too_late(tmp_path: Path) -> None:
    body = form(upload(""))
    with serving(queue_length=1) as client, connect(client) as connection:
        connection.sendall(head(len(body)) + body[:50])
        with occupied(client, tmp_path, 2):
            connection.sendall(body[50:])
            answer = read_answer(connection)
    assert (answer.status, code(answer)) == (503, "busy")


def test_a_client_that_leaves_in_the_middle_of_its_body_frees_its_place() -> None:
    with serving(max_uploads=1) as client:
        for _ in range(3):
            connection = connect(client)
            connection.sendall(head(1000) + form(b"")[:50])
            connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\1\0\0\0\0\0\0\0")  # a reset
            connection.close()
        deadline = time.monotonic() + 10
        while client.post("/rectify", files={"image": upload("")}).status_code != 200:
            assert time.monotonic() < deadline
            time.sleep(POLL_S)


def test_a_body_below_the_least_rate_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("app.http.uploads._RATE_HOLDS_AFTER_S", 0.1)
    with serving(min_body_bytes_per_s=1e6) as client, connect(client) as connection:
        connection.sendall(head(1000) + form(b"")[:50])
        answer = read_answer(connection)
    assert (answer.status, code(answer)) == (408, "request-timeout")
    assert b"MIN_BODY_BYTES_PER_S" in answer.body


def test_a_slow_upload_gives_its_place_to_another(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("app.http.upload_places._JUDGED_AFTER_S", 0.0)
    with serving(max_uploads=1) as client, connect(client) as connection:
        connection.sendall(head(1000) + form(b"")[:50])
        deadline = time.monotonic() + 10
        while (answer := client.post("/rectify", files={"image": upload("")})).status_code != 200:
            assert answer.json()["code"] == "busy"
            assert "MAX_UPLOADS" in answer.json()["detail"]
            assert time.monotonic() < deadline
            time.sleep(POLL_S)
        slow = read_answer(connection)
    assert (slow.status, code(slow)) == (408, "request-timeout")


@pytest.mark.parametrize(
    ("method", "path", "setting"),
    [
        ("PATCH", "/layout/models/letter/settings", b"65536 bytes;"),
        ("POST", "/layout/models/letter/train", b"65536 bytes;"),
        ("POST", "/layout/models/letter/rollback", b"65536 bytes;"),
        ("POST", "/layout/models/letter/initialize", b"65536 bytes;"),
        ("POST", "/layout/proposals", b"65536 bytes;"),
        ("POST", "/layout/results/{id}/feedback", b"MAX_ZONES_BYTES"),
        ("PUT", "/layout/models/letter", b"MAX_MODEL_BYTES"),
    ],
)
@pytest.mark.parametrize("length", [32_000_000, None], ids=["declared", "chunks"])
def test_every_route_limits_its_body_before_it_is_kept(
    client: httpx.Client, method: str, path: str, setting: bytes, length: int | None
) -> None:
    """40 bodies of 32 MB, as a form or not, made the server keep 1.4 GB."""
    chunk = b"10000\r\n" + b" " * 65_536 + b"\r\n"
    if "{id}" in path:
        path = path.format(id=client.post("/layout", files={"zones": json.dumps(PAGE).encode()}).json()["id"])
    with connect(client) as connection:
        connection.sendall(head(length, path).replace(b"POST", method.encode(), 1))
        if length is None:
            connection.sendall(chunk * 140)  # 9 MB
        answer = read_answer(connection)
    assert (answer.status, code(answer)) == (413, "too-large")
    assert setting in answer.body


def test_a_body_that_is_no_form_is_small(client: httpx.Client) -> None:
    for content_type in ("application/x-www-form-urlencoded", "application/json"):
        answer = client.post("/rectify", content=b"x" * 70_000, headers={"content-type": content_type})
        assert answer.status_code in (400, 413)
    zones = client.post(
        "/layout/models/letter/samples",
        content=b" " * 3_000_000,
        headers={"content-type": "application/json"},
    )
    assert (zones.status_code, zones.json()["code"]) == (413, "too-large")


def test_a_refusal_of_a_large_body_can_be_read(client: httpx.Client) -> None:
    """Many clients send all of it before they read; the connection used to be reset after 8 MB."""
    with connect(client) as connection:
        connection.sendall(head(110_000_000))
        for _ in range(110):
            connection.sendall(b" " * 1_000_000)
        answer = read_answer(connection)
    assert (answer.status, code(answer)) == (413, "too-large")

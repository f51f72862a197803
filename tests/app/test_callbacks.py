"""Callbacks: signed, repeated, and never to the own network."""

import base64
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

import pytest
from standardwebhooks import Webhook

from app.jobs import callbacks
from app.jobs.callback_request import CallbackFailed, CallbackRequest, is_public, parse_callback_url
from app.settings import Settings
from services.errors import InvalidOption
from tests.app.scripts import upload
from tests.app.serving import serving
from tests.app.test_jobs import LATER, until
from tests.app.test_problems import assert_problem

SECRET = "whsec_" + base64.b64encode(b"a secret of thirty-two bytes....").decode()


class Receiver(ThreadingHTTPServer):
    """A client's server: it answers with the next of `statuses`, the last one again and again."""

    daemon_threads = True

    def __init__(self, statuses: list[int]) -> None:
        super().__init__(("127.0.0.1", 0), _Handler)
        self.statuses = statuses
        self.heard: list[tuple[dict[str, str], bytes]] = []

    @property
    def url(self) -> str:
        return f"http://localhost:{self.server_port}/hook?for=me"


class _Handler(BaseHTTPRequestHandler):
    server: Receiver

    def do_POST(self) -> None:
        body = self.rfile.read(int(self.headers["content-length"]))
        status = self.server.statuses[min(len(self.server.heard), len(self.server.statuses) - 1)]
        self.server.heard.append(({name.lower(): value for name, value in self.headers.items()}, body))
        self.send_response(status)
        if 300 <= status < 400:
            self.send_header("Location", self.server.url + "&redirected")
        self.send_header("Content-Length", "0")
        self.end_headers()

    def log_message(self, format: str, *arguments: object) -> None:
        pass


@contextmanager
def receiving(*statuses: int) -> Iterator[Receiver]:
    receiver = Receiver(list(statuses) or [204])
    thread = threading.Thread(target=receiver.serve_forever)
    thread.start()
    try:
        yield receiver
    finally:
        receiver.shutdown()
        thread.join()
        receiver.server_close()


def hosts(**more: object) -> dict[str, object]:
    return {
        "callback_hosts": ("localhost",),
        "callback_internal_hosts": ("localhost",),
        "callback_secret": SECRET,
        **more,
    }


def log_of(client: Any, path: str, deliveries: int) -> list[dict[str, Any]]:
    deadline = time.monotonic() + 30
    while len(log := client.get(path).json()["deliveries"]) < deliveries:
        assert time.monotonic() < deadline, log
        time.sleep(0.05)
    return list(log)


def test_the_end_of_a_job_is_signed_and_repeated_until_it_is_heard(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(callbacks.CallbackSettings, "__init__", _hasty(callbacks.CallbackSettings.__init__))
    with receiving(500, 302, 204) as receiver, serving(**hosts()) as client:
        for script, state in (("", "succeeded"), ("no-text", "failed")):
            receiver.heard.clear()
            accepted = client.post(
                "/rectify",
                files={"image": upload(script)},
                data={"callback_url": receiver.url},
                headers=LATER,
            )
            assert accepted.json()["callback_url"] == receiver.url
            path = accepted.headers["location"]
            assert until(client, path)["state"] == state
            log = log_of(client, path, 3)
            assert [each["status"] for each in log] == [500, 302, 204]
            assert [each["failure"] is None for each in log] == [False, False, True]
            assert len({headers["webhook-id"] for headers, _ in receiver.heard}) == 1
            for headers, body in receiver.heard:
                message = Webhook(SECRET).verify(body, headers)
                assert (message["type"], message["data"]["id"]) == (f"job.{state}", path.rpartition("/")[2])
                assert message["data"]["links"]["result"] == f"{path}/result"
        assert len(receiver.heard) == 3  # no redirect was followed
        by_query = client.post(
            "/rectify",
            params={"callback_url": receiver.url},
            files={"image": upload("")},
            headers=LATER,
        )
        assert log_of(client, by_query.headers["location"], 1)[0]["status"] == 204


def _hasty(init: Any) -> Any:
    def hasty(self: Any, *arguments: Any, **named: Any) -> None:
        init(self, *arguments, **{**named, "pauses_s": (0.0, 0.0)})

    return hasty


@pytest.mark.parametrize(
    ("url", "headers"),
    [
        ("https://elsewhere.example.org/", LATER),
        ("ftp://localhost/", LATER),
        ("http://me:word@localhost/", LATER),
        ("http://localhost:99999/", LATER),
        ("http://local host/", LATER),
        ("//localhost/", LATER),
        ("http://localhost/", {}),
    ],
)
def test_a_url_that_may_not_be_called_is_refused_at_once(
    callback_client: Any, url: str, headers: dict[str, str]
) -> None:
    answer = callback_client.post(
        "/rectify", files={"image": upload("")}, data={"callback_url": url}, headers=headers
    )
    assert_problem(answer, 422, "invalid-option")
    assert answer.json()["field"] == "callback_url"


@pytest.fixture(scope="module")
def callback_client() -> Iterator[Any]:
    with serving(**hosts()) as client:
        yield client


@pytest.mark.parametrize(
    "host",
    [
        "127.0.0.1",
        "localhost",
        "2130706433",
        "0x7f000001",
        "017700000001",
        "127.1",
        "0.0.0.0",
        "10.1.2.3",
        "172.16.0.1",
        "192.168.1.1",
        "169.254.169.254",
        "100.64.0.1",
        "224.0.0.1",
        "[::1]",
        "[::]",
        "[::ffff:127.0.0.1]",
        "[fe80::1]",
        "[fd00::1]",
        "[64:ff9b::7f00:1]",
        "[2002:7f00:1::]",
    ],
)
def test_the_own_network_is_never_called(host: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever form the address has. Connections are counted where they are made."""
    reached: list[object] = []
    monkeypatch.setattr(socket.socket, "connect", lambda self, address: reached.append(address))
    with pytest.raises((CallbackFailed, InvalidOption)):
        CallbackRequest(f"http://{host}:8080/", ["*"], ["*"]).send(b"{}", {}, 1.0)
    assert reached == []


@pytest.mark.parametrize("inside", ["127.0.0.1", "169.254.169.254", "::1", "10.0.0.9"])
def test_a_name_that_leads_inside_is_not_called(inside: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """All addresses of a name are judged, and the name is looked up once, so that it cannot change between."""
    looked_up: list[str] = []

    def resolve(host: str, port: int, **_: object) -> list[object]:
        looked_up.append(host)
        families = {True: socket.AF_INET6, False: socket.AF_INET}
        return [
            (families[":" in address], socket.SOCK_STREAM, 6, "", (address, port))
            for address in ("93.184.215.14", inside)
        ]

    monkeypatch.setattr(socket, "getaddrinfo", resolve)
    reached: list[object] = []
    monkeypatch.setattr(socket.socket, "connect", lambda self, address: reached.append(address))
    with pytest.raises(CallbackFailed, match="private"):
        CallbackRequest("https://hooks.example.org/", ["*"], []).send(b"{}", {}, 1.0)
    assert (reached, looked_up) == ([], ["hooks.example.org"])


@pytest.mark.parametrize("address", ["93.184.215.14", "2606:2800:21f:cb07::1", "::ffff:93.184.215.14"])
def test_the_internet_may_be_called(address: str) -> None:
    assert is_public(address)


def test_hosts_are_allowed_by_name() -> None:
    names = ["hooks.example.org", "*.example.com"]
    for allowed in ("https://HOOKS.example.org./x", "http://a.b.example.com:8080"):
        parse_callback_url(allowed, names)
    for refused in ("https://example.com", "https://hooks.example.org.evil.net", "https://evilexample.com"):
        with pytest.raises(InvalidOption):
            parse_callback_url(refused, names)


def test_a_server_that_does_not_answer_is_left(monkeypatch: pytest.MonkeyPatch) -> None:
    with socket.create_server(("127.0.0.1", 0)) as silent:
        request = CallbackRequest(f"http://localhost:{silent.getsockname()[1]}/", ["*"], ["localhost"])
        threading.Timer(0.2, request.abort).start()
        begin_s = time.monotonic()
        with pytest.raises(CallbackFailed):
            request.send(b"{}", {}, 30.0)
        assert time.monotonic() - begin_s < 10


@pytest.mark.parametrize("secret", ["", "whsec_short", "whsec_????"])
def test_hosts_need_a_secret(secret: str) -> None:
    with pytest.raises(ValueError, match="CALLBACK_SECRET"):
        Settings(callback_hosts="hooks.example.org", callback_secret=secret)  # type: ignore[arg-type]

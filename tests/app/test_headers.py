"""No header makes the service fail, whatever bytes a client sends in it."""

import random
import socket
from collections.abc import Iterator
from itertools import product

import httpx
import pytest

from tests.app.raw import connect
from tests.app.scripted_models import model_document
from tests.app.serving import serving
from tests.counts import repeats

HEADERS = (
    "Accept", "Accept-Encoding", "Authorization", "Connection", "Content-Disposition", "Content-Encoding",
    "Content-Length", "Content-Type", "Cookie", "Expect", "Forwarded", "Host", "Idempotency-Key", "If-Match",
    "If-None-Match", "Last-Event-ID", "Origin", "Prefer", "Range", "Referer", "Sec-Fetch-Site", "traceparent",
    "Transfer-Encoding", "Upgrade", "X-API-Key", "X-Forwarded-For", "X-Forwarded-Host", "X-Request-ID",
)  # fmt: skip
VALUES = (
    b"", b"http://[", b"http://[::1", b"//", b"http://a:b:c", b"[", b"a@b:99999", b"\xff\xfe", "ä".encode(),
    b"9" * 5000, b"-1", b"1e999", b"nan", b"\xb2", b"0x10", b"+5", b"bytes=9-1", b"*/*;q=nan", b"text/html;q=\xb2",
    b'"', b'W/"', b"*", b"," * 1000, b"=" * 1000, b"a;" * 1000, b"Bearer ", b"Bearer \xff", b"Basic =",
    b"multipart/form-data; boundary=", b"multipart/form-data; boundary=\xff", b'multipart/form-data; boundary="',
    b"application/x-www-form-urlencoded; charset=nonsense", b"xn--\xff", b"null", b"100-continue", b"chunked, gzip",
)  # fmt: skip
REQUESTS = (
    ("POST", "/rectify"), ("GET", "/layout/models"), ("PUT", "/layout/models/letter"), ("POST", "/layout"),
    ("GET", "/layout/results"), ("POST", "/layout/proposals"), ("PATCH", "/layout/models/letter/settings"),
    ("POST", "/layout/models/letter/samples"), ("GET", "/jobs/none/events"), ("POST", "/tokens"),
)  # fmt: skip


@pytest.fixture(scope="module", params=[(), ("key",)], ids=["open", "with keys"])
def service(request: pytest.FixtureRequest) -> Iterator[httpx.Client]:
    with serving(cors_origins="https://app.example.org", api_keys=request.param) as client:
        letter = model_document("letter", "date")
        client.put("/layout/models/letter", json=letter, headers={"X-API-Key": "key"}).raise_for_status()
        yield client


def status(client: httpx.Client, method: str, path: str, name: str, value: bytes) -> int:
    """Status of the answer; 0: the server closed the connection, as it may if it cannot read the request."""
    headers = {
        "Host": b"test",
        "Content-Length": b"2",
        "Content-Type": b"application/json",
        "Connection": b"close",
    }
    if name == "Transfer-Encoding":
        del headers["Content-Length"]
    lines = [each.encode() + b": " + sent for each, sent in {**headers, name: value}.items()]
    with connect(client) as connection:
        connection.sendall(b"\r\n".join((f"{method} {path} HTTP/1.1".encode(), *lines, b"", b"{}")))
        if name in ("Content-Length", "Transfer-Encoding"):
            connection.shutdown(socket.SHUT_WR)  # no more of the body comes than these two bytes
        first = connection.makefile("rb").readline().split()
        return int(first[1]) if first else 0


def test_no_header_is_a_defect(service: httpx.Client) -> None:
    chosen = random.Random(34)
    told = list(product(HEADERS, VALUES))
    chosen.shuffle(told)
    random_bytes = [
        (
            chosen.choice(HEADERS),
            bytes(chosen.choice(range(0x21, 0x100)) for _ in range(chosen.randrange(1, 40))),
        )
        for _ in range(repeats(50, 2000))
    ]
    failed = []
    for name, value in [("Origin", b"http://["), *told[: repeats(150, len(told))], *random_bytes]:
        method, path = chosen.choice(REQUESTS) if name != "Origin" else ("POST", "/rectify")
        answer = status(service, method, path, name, value)
        if answer >= 500 and answer != 503:
            failed.append((method, path, name, value, answer))
    assert failed == []

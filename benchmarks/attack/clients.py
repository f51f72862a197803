"""Clients that misbehave on the wire."""

import json
import socket
import time
from contextlib import ExitStack
from dataclasses import dataclass
from urllib.parse import urlsplit

import httpx

from benchmarks.attack.images import picture

BOUNDARY = "edge"
_LONGEST_S = 70.0


@dataclass(frozen=True, slots=True)
class Answer:
    """Status and problem code; `code` is "ok" without a problem, and "closed" without an answer."""

    status: int
    code: str


def answer_of(response: httpx.Response) -> Answer:
    """The answer in a response; a client or server error that is no problem document has the code "not-a-problem"."""
    if response.status_code < 400:
        return Answer(response.status_code, "ok")
    is_problem = response.headers.get("content-type", "").startswith("application/problem+json")
    return Answer(response.status_code, response.json()["code"] if is_problem else "not-a-problem")


def request_head(path: str, length: int | None, method: str = "POST", content_type: str = "") -> bytes:
    """Head of a request; `length` None: chunks."""
    size = "Transfer-Encoding: chunked" if length is None else f"Content-Length: {length}"
    kind = content_type or f"multipart/form-data; boundary={BOUNDARY}"
    return f"{method} {path} HTTP/1.1\r\nHost: attack\r\nContent-Type: {kind}\r\n{size}\r\n\r\n".encode()


def part_head(name: str = "image") -> bytes:
    """How a file of a form begins."""
    return f'--{BOUNDARY}\r\nContent-Disposition: form-data; name="{name}"; filename="a"\r\n\r\n'.encode()


def file_part(name: str = "image", data: bytes = b"") -> bytes:
    """A file of a form, with the form's end."""
    return part_head(name) + data + f"\r\n--{BOUNDARY}--\r\n".encode()


def send_raw(url: str, *pieces: bytes, pause_s: float = 0.0) -> Answer:
    """The answer to bytes as they are; the client reads only when it has sent all."""
    place = urlsplit(url)
    with socket.create_connection((place.hostname, place.port), timeout=_LONGEST_S) as connection:
        try:
            for piece in pieces:
                connection.sendall(piece)
                time.sleep(pause_s)
            return _read(connection)
        except OSError:
            return Answer(0, "closed")


def leave_early(url: str) -> Answer:
    """A client that leaves in the middle of its body, then one that sends all."""
    place = urlsplit(url)
    for _ in range(20):
        with socket.create_connection((place.hostname, place.port), timeout=_LONGEST_S) as connection:
            connection.sendall(request_head("/rectify", 100_000) + file_part()[:60])
    return answer_of(httpx.post(url + "/rectify", files={"image": picture()}, timeout=_LONGEST_S))


def hold_slowly(url: str, clients: int = 18) -> Answer:
    """What an honest client is answered while others send a byte a second."""
    place = urlsplit(url)
    with ExitStack() as connections:
        slow = [
            connections.enter_context(
                socket.create_connection((place.hostname, place.port), timeout=_LONGEST_S)
            )
            for _ in range(clients)
        ]
        for connection in slow:
            connection.sendall(request_head("/rectify", 100_000) + file_part()[:60])
        return answer_of(httpx.post(url + "/rectify", files={"image": picture()}, timeout=_LONGEST_S))


def _read(connection: socket.socket) -> Answer:
    with connection.makefile("rb") as stream:
        line = stream.readline().split()
        if len(line) < 2:
            return Answer(0, "closed")
        status, headers = int(line[1]), {}
        while (header := stream.readline().strip()) != b"":
            name, _, value = header.decode("latin-1").partition(":")
            headers[name.lower()] = value.strip()
        body = stream.read(int(headers.get("content-length", "0")))
    if status < 400:
        return Answer(status, "ok")
    if not headers.get("content-type", "").startswith("application/problem+json"):
        return Answer(status, "not-a-problem")
    return Answer(status, json.loads(body)["code"])

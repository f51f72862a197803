"""HTTP by hand, for what no well-behaved client does."""

import socket
from dataclasses import dataclass

import httpx

BOUNDARY = "edge"


@dataclass(frozen=True, slots=True)
class Answer:
    """A response as it came off the wire."""

    status: int
    headers: dict[str, str]
    body: bytes


def connect(client: httpx.Client) -> socket.socket:
    """A connection to the service that `client` talks to."""
    return socket.create_connection((client.base_url.host, client.base_url.port), timeout=20)


def form(*images: bytes, field: str = "image") -> bytes:
    """A multipart body of files, all in one field."""
    head = f'--{BOUNDARY}\r\nContent-Disposition: form-data; name="{field}"; filename="photo.jpg"\r\n\r\n'
    parts = b"".join(head.encode() + image + b"\r\n" for image in images)
    return parts + f"--{BOUNDARY}--\r\n".encode()


def head(length: int | None, path: str = "/rectify", extra: str = "") -> bytes:
    """Head of a POST; `length` None means chunks."""
    size = "Transfer-Encoding: chunked" if length is None else f"Content-Length: {length}"
    return (
        f"POST {path} HTTP/1.1\r\nHost: test\r\nContent-Type: multipart/form-data; boundary={BOUNDARY}\r\n"
        f"{size}\r\n{extra}\r\n"
    ).encode()


def read_answer(connection: socket.socket) -> Answer:
    """The next response, read to its end."""
    with connection.makefile("rb") as stream:
        status = int(stream.readline().split()[1])
        headers = {}
        while (line := stream.readline().strip()) != b"":
            name, _, value = line.decode("latin-1").partition(":")
            headers[name.lower()] = value.strip()
        return Answer(status, headers, stream.read(int(headers["content-length"])))

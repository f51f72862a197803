"""A small server of the S3 protocol in this process: objects, uploads in parts, lists. It keeps all in memory.

All objects are as new as the question for them. It judges no signature. A test can have it refuse parts, and take it
away.
"""

import hashlib
import re
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from datetime import UTC, datetime
from email.utils import formatdate
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from urllib.parse import parse_qs, unquote, urlsplit
from xml.sax.saxutils import escape

BUCKET = "documents"
_XMLNS = 'xmlns="http://s3.amazonaws.com/doc/2006-03-01/"'


@dataclass
class Bucket:
    """What the server keeps. `refused_parts` are numbers of parts that it answers with 403."""

    objects: dict[str, bytes] = field(default_factory=dict)
    uploads: dict[str, dict[int, bytes]] = field(default_factory=dict)
    refused_parts: set[int] = field(default_factory=set)
    aborted: int = 0
    requests: list[str] = field(default_factory=list)
    """Method and query of each request."""
    lock: threading.Lock = field(default_factory=threading.Lock)


class _Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    bucket: Bucket

    def log_message(self, *_: object) -> None:
        """Nothing is printed."""

    def _handle(self) -> None:
        url = urlsplit(self.path)
        query = {key: values[0] for key, values in parse_qs(url.query, keep_blank_values=True).items()}
        name, _, key = unquote(url.path).removeprefix("/").partition("/")
        body = self.rfile.read(int(self.headers.get("content-length", "0")))
        with self.bucket.lock:
            self.bucket.requests.append(f"{self.command} {' '.join(sorted(query))}".strip())
            if name != BUCKET or "authorization" not in self.headers:
                return self._answer(403, b"<Error><Code>AccessDenied</Code></Error>")
            return (self._do_part if "uploadId" in query else self._do)(query, key, body)

    do_GET = do_PUT = do_POST = do_DELETE = do_HEAD = _handle

    def _do(self, query: dict[str, str], key: str, body: bytes) -> None:
        bucket = self.bucket
        match self.command:
            case "GET" if "list-type" in query:
                self._list(query.get("prefix", ""))
            case "GET" | "HEAD" if key in bucket.objects:
                self._answer(200, bucket.objects[key])
            case "PUT":
                bucket.objects[key] = body
                self._answer(200, b"", etag=_etag(body))
            case "POST" if "uploads" in query:
                upload = f"upload-{len(bucket.requests)}"
                bucket.uploads[upload] = {}
                self._answer(200, _xml("InitiateMultipartUploadResult", f"<UploadId>{upload}</UploadId>"))
            case "POST" if "delete" in query:
                keys = [found.decode() for found in re.findall(rb"<Key>([^<]*)</Key>", body)]
                for each in keys:
                    bucket.objects.pop(each, None)
                deleted = "".join(f"<Deleted><Key>{each}</Key></Deleted>" for each in keys)
                self._answer(200, _xml("DeleteResult", deleted))
            case "DELETE":
                bucket.objects.pop(key, None)
                self._answer(204, b"")
            case _:
                self._answer(404, b"<Error><Code>NoSuchKey</Code></Error>")

    def _do_part(self, query: dict[str, str], key: str, body: bytes) -> None:
        """A part of an upload, its end, or its abort."""
        bucket, upload = self.bucket, query["uploadId"]
        match self.command:
            case "PUT" if int(query["partNumber"]) in bucket.refused_parts:
                self._answer(403, b"<Error><Code>AccessDenied</Code></Error>")
            case "PUT":
                bucket.uploads[upload][int(query["partNumber"])] = body
                self._answer(200, b"", etag=_etag(body))
            case "POST":
                parts = bucket.uploads.pop(upload)
                numbers = [int(found) for found in re.findall(rb"<PartNumber>(\d+)</PartNumber>", body)]
                bucket.objects[key] = b"".join(parts[number] for number in numbers)
                etag = f"<ETag>{_etag(bucket.objects[key])}</ETag>"
                self._answer(200, _xml("CompleteMultipartUploadResult", etag))
            case _:
                del bucket.uploads[upload]
                bucket.aborted += 1
                self._answer(204, b"")

    def _list(self, prefix: str) -> None:
        now = datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%S.000Z")
        entries = "".join(
            f"<Contents><Key>{escape(key)}</Key><LastModified>{now}</LastModified>"
            f"<ETag>{_etag(content)}</ETag><Size>{len(content)}</Size></Contents>"
            for key, content in sorted(self.bucket.objects.items())
            if key.startswith(prefix)
        )
        self._answer(200, _xml("ListBucketResult", f"<IsTruncated>false</IsTruncated>{entries}"))

    def _answer(self, status: int, body: bytes, etag: str = "") -> None:
        first, last = 0, len(body) - 1
        wanted = re.fullmatch(r"bytes=(\d+)-(\d+)", self.headers.get("range", ""))
        if wanted and status == 200:
            status, first, last = 206, int(wanted[1]), min(int(wanted[2]), last)
        part = body[first : last + 1]
        self.send_response(status)
        self.send_header("Content-Length", str(len(part)))
        self.send_header("Last-Modified", formatdate(usegmt=True))
        self.send_header("ETag", etag or _etag(body))
        if status == 206:
            self.send_header("Content-Range", f"bytes {first}-{last}/{len(body)}")
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(part)


def _etag(content: bytes) -> str:
    return f'"{hashlib.md5(content, usedforsecurity=False).hexdigest()}"'


def _xml(name: str, content: str) -> bytes:
    return f'<?xml version="1.0" encoding="UTF-8"?><{name} {_XMLNS}>{content}</{name}>'.encode()


class _Server(ThreadingHTTPServer):
    """Its connections end with it; those that are kept alive would else be answered on."""

    daemon_threads = True

    def __init__(self, port: int, handler: type[_Handler]) -> None:
        super().__init__(("127.0.0.1", port), handler)
        self._connections: set[socket.socket] = set()

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        self._connections.add(request)
        super().process_request_thread(request, client_address)
        self._connections.discard(request)

    def close_all(self) -> None:
        """Stop listening, and close the connections."""
        self.shutdown()
        self.server_close()
        for connection in list(self._connections):
            with suppress(OSError):
                connection.shutdown(socket.SHUT_RDWR)


class S3Server:
    """A server on a free port of the loopback; `away` takes it away and brings it back."""

    def __init__(self) -> None:
        self.bucket = Bucket()
        self._port = 0
        self._start()

    @property
    def environment(self) -> dict[str, str]:
        """What `BLOB_URL=s3://documents/...` needs beside it."""
        return {
            "AWS_ENDPOINT_URL": f"http://127.0.0.1:{self._port}",
            "AWS_ALLOW_HTTP": "true",
            "AWS_REGION": "us-east-1",
            "AWS_ACCESS_KEY_ID": "documents",
            "AWS_SECRET_ACCESS_KEY": "documents-secret",
        }

    def _start(self) -> None:
        handler = type("Handler", (_Handler,), {"bucket": self.bucket})
        self._server = _Server(self._port, handler)
        self._port = self._server.server_address[1]
        self._thread = threading.Thread(target=self._server.serve_forever, args=(0.02,))
        self._thread.start()

    def stop(self) -> None:
        """End."""
        self._server.close_all()
        self._thread.join()

    @contextmanager
    def away(self) -> Iterator[None]:
        """Nothing listens inside of the block."""
        self.stop()
        try:
            yield
        finally:
            self._start()

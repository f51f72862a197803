"""The words of tus 1.0.0, the protocol of uploads in pieces: headers of its requests, and of every answer."""

import base64
import binascii
import hashlib
from collections.abc import Callable, Coroutine, Mapping
from email.utils import format_datetime
from typing import TYPE_CHECKING, Any

from fastapi import Request, Response
from fastapi.exceptions import RequestValidationError
from fastapi.routing import APIRoute

from app.http.octets import OCTETS
from app.http.preconditions import PreconditionFailed
from app.http.problems import problem_response
from models.errors import StoreError
from models.records import StoredUpload
from services.errors import DocumentError, InvalidOption

if TYPE_CHECKING:
    from hashlib import _Hash

VERSION = "1.0.0"
PIECE_TYPE = "application/offset+octet-stream"
PIECE_TYPES = (PIECE_TYPE, OCTETS)
"""The second one is that of generated clients, whose generators refuse the first."""
ALGORITHMS = ("sha1", "sha256")
"""Of checksums; every server has SHA-1. Both take less time than the network: 1 MB in 1 to 2 ms."""
EXTENSIONS = "creation,expiration,checksum,termination"
MOST_NAME_CHARACTERS = 255
HEADERS: Mapping[str, str] = {"Tus-Resumable": VERSION, "Tus-Version": VERSION}
"""Of every answer."""


class WrongVersion(PreconditionFailed):
    """The request speaks no version of the protocol that is known here."""


class ChecksumMismatch(DocumentError):
    """What came is not what its checksum says."""

    code = "checksum-mismatch"


class TusRoute(APIRoute):
    """A route whose answers, also its problems, have the headers of the protocol."""

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """The handler of the route, after the check of the version."""
        handle = super().get_route_handler()

        async def handle_tus(request: Request) -> Response:
            try:
                _check_version(request)
                response = await handle(request)
            except (DocumentError, StoreError, RequestValidationError) as error:
                response = problem_response(error, request.scope)
            response.headers.update(HEADERS)
            return response

        return handle_tus


def options_headers(most_bytes: int) -> Mapping[str, str]:
    """What OPTIONS tells of the server."""
    return {
        **HEADERS,
        "Tus-Extension": EXTENSIONS,
        "Tus-Max-Size": str(most_bytes),
        "Tus-Checksum-Algorithm": ",".join(ALGORITHMS),
    }


def upload_headers(upload: StoredUpload) -> dict[str, str]:
    """How far an upload has come, for the answers about it."""
    headers = {
        "Upload-Offset": str(upload.received),
        "Upload-Length": str(upload.length),
        "Upload-Expires": format_datetime(upload.expires_at, usegmt=True),
        "Cache-Control": "no-store",
    }
    if upload.name is not None:
        headers["Upload-Metadata"] = f"filename {base64.b64encode(upload.name.encode()).decode()}"
    return headers


def name_in(metadata: str) -> str | None:
    """The name of the file in `Upload-Metadata`, pairs `key base64` separated by commas; None without one.

    Raises
    ------
    InvalidOption
    """
    for pair in metadata.split(","):
        key, _, value = pair.strip().partition(" ")
        if key != "filename":
            continue
        try:
            name = base64.b64decode(value, validate=True).decode()
        except (binascii.Error, UnicodeDecodeError):
            raise InvalidOption(
                "Upload-Metadata: send the name of the file in base64, of UTF-8.", "Upload-Metadata"
            ) from None
        if len(name) > MOST_NAME_CHARACTERS or "\0" in name:
            raise InvalidOption(
                f"Upload-Metadata: a name has at most {MOST_NAME_CHARACTERS} characters, and not NUL.",
                "Upload-Metadata",
            )
        return name or None
    return None


class Checksum:
    """The checksum that a piece must have, and the one that it has so far."""

    def __init__(self, header: str) -> None:
        """`header` is `Upload-Checksum`: the algorithm, and the digest in base64.

        Raises
        ------
        InvalidOption
        """
        algorithm, _, digest = header.strip().partition(" ")
        try:
            self._wanted = base64.b64decode(digest, validate=True)
        except binascii.Error:
            self._wanted = b""
        if algorithm not in ALGORITHMS or not self._wanted:
            raise InvalidOption(
                f"Upload-Checksum: send {' or '.join(ALGORITHMS)}, a space, and the digest in base64.",
                "Upload-Checksum",
            )
        self._digest: _Hash = hashlib.new(algorithm, usedforsecurity=False)

    def add(self, data: bytes) -> None:
        """Add the next bytes of the piece."""
        self._digest.update(data)

    def check(self) -> None:
        """Raise `ChecksumMismatch` unless the piece is what it must be."""
        if self._digest.digest() != self._wanted:
            raise ChecksumMismatch(
                "The piece is not what Upload-Checksum says. Send it again.", "Upload-Checksum"
            )


def _check_version(request: Request) -> None:
    """Check the version of the protocol; who sends nothing needs not name one.

    Raises
    ------
    WrongVersion
    """
    version = request.headers.get("tus-resumable", VERSION if request.method in ("GET", "DELETE") else "")
    if version != VERSION:
        raise WrongVersion(f"Send the header Tus-Resumable: {VERSION}.", "Tus-Resumable")

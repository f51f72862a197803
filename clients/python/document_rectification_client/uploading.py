"""Files in pieces (tus 1.0.0): where the connection breaks, sending goes on with what the service has not kept."""

from base64 import b64encode
from collections.abc import Callable
from dataclasses import replace
from typing import TypeVar
from urllib.parse import quote

import httpx

from document_rectification_client.calls import Answer, Call, Part, Upload, part_of
from document_rectification_client.flows import (
    LONGEST_WAIT_S,
    RETRIED,
    Flow,
    Pause,
    Request,
    read_answer,
    send,
)
from document_rectification_client.models import UploadState
from document_rectification_client.problems import ProblemError, problem_of
from document_rectification_client.reading import read
from document_rectification_client.waiting import wait_before

Result = TypeVar("Result")
PIECE_BYTES = 4 << 20
"""Proxies that keep a body until it is whole lose no more."""
_TUS = {"Tus-Resumable": "1.0.0"}
_RESUMED = {*RETRIED, 408, 409}
"""In addition: the body came too slowly, or what came before was kept after all."""
_UNKNOWN = {404, 405}
"""What a service answers that knows no uploads yet."""


def upload(name: str, content: bytes, tries: int) -> Flow[Upload]:
    """A file that the service keeps for forms, sent in pieces. `tries` counts those in a row that bring nothing."""
    headers = {
        **_TUS,
        "Upload-Length": str(len(content)),
        "Upload-Metadata": f"filename {b64encode(name.encode()).decode()}",
    }
    response = yield from send(Request("POST", "/uploads", headers), tries)
    made = read_answer(lambda answer: Upload(read(UploadState, answer.json()).id), response)
    offset, failures = 0, 0
    while offset < len(content):
        headers = {
            **_TUS,
            "Upload-Offset": str(offset),
            "Content-Type": "application/offset+octet-stream",
        }
        piece = content[offset : offset + PIECE_BYTES]
        received = yield Request("PATCH", _path(made), headers, content=piece)
        assert received is not None
        if isinstance(received, httpx.Response) and received.is_success:
            offset, failures = offset + len(piece), 0
            continue
        if isinstance(received, httpx.Response) and received.status_code not in _RESUMED:
            raise problem_of(received)
        failures += 1
        wait = wait_before(failures, received)
        if failures >= tries or wait > LONGEST_WAIT_S:
            raise problem_of(received)
        yield Pause(wait)
        kept = int((yield from send(Request("HEAD", _path(made), _TUS), tries)).headers["Upload-Offset"])
        offset, failures = kept, 0 if kept > offset else failures
    return made


def forget(made: Upload, tries: int) -> Flow[None]:
    """Delete an upload before its time."""
    yield from send(Request("DELETE", _path(made), _TUS), tries)


def sent_before(
    call: Call[Answer], above: int | None, tries: int, then: Callable[[Call[Answer]], Flow[Result]]
) -> Flow[Result]:
    """What `then` makes of the call. Files of more than `above` bytes are sent in pieces before, and deleted after."""
    call, uploads = yield from _with_uploads(call, above, tries)
    try:
        result = yield from then(call)
    except ProblemError:
        yield from _forget_all(uploads)
        raise
    yield from _forget_all(uploads)
    return result


def _with_uploads(
    call: Call[Answer], above: int | None, tries: int
) -> Flow[tuple[Call[Answer], list[Upload]]]:
    """The call, with uploads where its files are large, and these."""
    size = sum(len(content) for _, (name, content) in call.files if name is not None)
    if above is None or size <= above:
        return call, []
    files: list[Part] = []
    made: list[Upload] = []
    for part, (name, content) in call.files:
        if name is None:
            files.append((part, (name, content)))
            continue
        try:
            made.append((yield from upload(name, content, tries)))
        except ProblemError as problem:
            if problem.status in _UNKNOWN and not made:
                return call, []
            raise
        files.append(part_of(made[-1]))
    return replace(call, files=tuple(files)), made


def _forget_all(uploads: list[Upload]) -> Flow[None]:
    """Delete uploads that nobody needs any more. What cannot be deleted now ends by itself."""
    for made in uploads:
        try:
            yield from forget(made, tries=1)
        except ProblemError:
            return


def _path(made: Upload) -> str:
    return f"/uploads/{quote(made.id, safe='')}"

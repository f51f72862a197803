"""The course of requests, without any input or output: both clients follow these steps in their own way."""

from collections.abc import Callable, Generator, Mapping
from dataclasses import dataclass, field
from typing import Generic
from urllib.parse import quote
from uuid import uuid4

import httpx

from document_rectification_client.calls import Answer, Call, Part
from document_rectification_client.models import JobStatus
from document_rectification_client.problems import ProblemError, problem_of
from document_rectification_client.reading import read
from document_rectification_client.waiting import wait_before

ACCEPTED = 202
RETRIED = {429, 502, 503}
"""The service is busy or starts, or a proxy does not reach it."""
LONGEST_WAIT_S = 120.0
"""A longer wait is the caller's to decide: the problem says for how long (`retry_after_s`)."""


@dataclass(frozen=True, slots=True)
class Request:
    """One request to send."""

    method: str
    path: str
    headers: Mapping[str, str] = field(default_factory=dict)
    files: tuple[Part, ...] = ()
    data: Mapping[str, str] = field(default_factory=dict)
    content: bytes | None = None


@dataclass(frozen=True, slots=True)
class Pause:
    """Time to wait."""

    seconds: float


Received = httpx.Response | httpx.TransportError | None
"""What a request gave: the answer, or why there is none; after a pause None."""
Flow = Generator[Request | Pause, Received, Answer]
"""Steps that end in an answer, or in a `ProblemError`."""
Progress = Callable[[JobStatus], None]


@dataclass(frozen=True, slots=True)
class Job(Generic[Answer]):
    """Work that the service goes on with; its id and its call's `read` are all that is needed to fetch the answer."""

    id: str
    read: Callable[[httpx.Response], Answer]


def send(request: Request, tries: int) -> Flow[httpx.Response]:
    """The answer to a request; it is sent again where that may help, when the service asks for it."""
    for attempt in range(1, tries + 1):
        received = yield request
        assert received is not None
        if isinstance(received, httpx.Response) and received.status_code not in RETRIED:
            break
        wait = wait_before(attempt, received)
        # Who has waited for an answer in vain would wait in vain again: the work is too long for the time limit.
        if attempt == tries or wait > LONGEST_WAIT_S or isinstance(received, httpx.ReadTimeout):
            raise problem_of(received)
        yield Pause(wait)
    assert isinstance(received, httpx.Response)
    if not received.is_success:
        raise problem_of(received)
    return received


def answer(call: Call[Answer], progress: Progress | None, tries: int) -> Flow[Answer]:
    """The answer to a call; where its progress is wanted, it is a job."""
    if progress is not None:
        job = yield from start(call, None, tries)
        return (yield from result(job, progress, tries))
    response = yield from send(Request("POST", call.path, {}, call.files, call.fields), tries)
    return read_answer(call.read, response)


def start(call: Call[Answer], key: str | None, tries: int) -> Flow[Job[Answer]]:
    """The job of a call. With a key, which is a random one unless it is given, a repeated request finds its job."""
    headers = {"Prefer": "respond-async", "Idempotency-Key": key or uuid4().hex}
    response = yield from send(Request("POST", call.path, headers, call.files, call.fields), tries)
    return Job(read_answer(_status, response).id, call.read)


def look(job: Job[Answer], tries: int) -> Flow[JobStatus]:
    """The state of a job."""
    response = yield from send(Request("GET", _path(job)), tries)
    return read_answer(_status, response)


def result(job: Job[Answer], progress: Progress | None, tries: int) -> Flow[Answer]:
    """The answer of a job, when it has one.

    The job is asked about as often as the service advises. That passes every proxy, and holds no connection.
    """
    while True:
        status = yield from look(job, tries)
        if progress is not None:
            progress(status)
        if status.ended is not None:
            break
        yield Pause(status.poll_after_s or 1)
    response = yield from send(Request("GET", f"{_path(job)}/result"), tries)
    return read_answer(job.read, response)


def cancel(job: Job[Answer], tries: int) -> Flow[None]:
    """Stop the work of a job."""
    yield from send(Request("DELETE", _path(job)), tries)


def _path(job: Job[Answer]) -> str:
    return f"/jobs/{quote(job.id, safe='')}"


def _status(response: httpx.Response) -> JobStatus:
    return read(JobStatus, response.json())


def read_answer(reader: Callable[[httpx.Response], Answer], response: httpx.Response) -> Answer:
    """What the reader makes of an answer. Raises `ProblemError` when it cannot be read."""
    try:
        return reader(response)
    except ValueError as error:
        raise ProblemError(str(error), "unexpected-answer", response.status_code) from error

"""Records of jobs, as the store returns them. Times are aware and in UTC."""

from dataclasses import dataclass
from datetime import datetime
from typing import Final, Literal, NotRequired, TypedDict

JobState = Literal["queued", "running", "succeeded", "failed", "cancelled"]
FINAL_STATES: Final = ("succeeded", "failed", "cancelled")
JOB_BLOBS: Final = "jobs"
"""First part of the keys of all blobs of jobs."""
MOST_WAIT_S: Final = 60.0
"""Longest time for which a job that was handed back waits."""
MOST_CALLBACK_WAIT_S: Final = 3600.0
"""Longest time until a callback is sent, or sent again."""
CHANGES: Final = "document_job_changes"
"""Channel on which PostgreSQL notifies of changes of jobs, as `ID REVISION`."""


class RequestJson(TypedDict):
    """A request without its body: what a job is to do. `headers` are those that change an answer or trace it."""

    method: str
    path: str
    query: str
    headers: dict[str, str]
    request_id: str
    caller: str | None
    role: NotRequired[str | None]


class HeadJson(TypedDict):
    """The head of a job's answer. A problem's answer is whole: it has its `body` as well."""

    status: int
    headers: list[tuple[str, str]]
    body: NotRequired[str]


class ProblemJson(TypedDict):
    """A problem document (RFC 9457), as it was answered."""

    type: str
    title: str
    status: int
    code: str
    detail: str
    field: NotRequired[str]
    request_id: str


@dataclass(frozen=True, slots=True)
class JobDraft:
    """A job to be stored. Its input is in the blobs already.

    `repeat_key` is equal for requests that ask for the same job, and
    `digest` shows whether they ask for the same work; None: the job is never repeated. Jobs of a higher `priority` run
    first.
    """

    id: str
    owner: str | None
    operation: str
    request: RequestJson
    input_key: str | None
    input_bytes: int
    repeat_key: str | None = None
    digest: str | None = None
    priority: int = 0
    callback_url: str | None = None


@dataclass(frozen=True, slots=True)
class JobBounds:
    """Most unfinished jobs, of one owner and of all, and most bytes of their inputs."""

    most_jobs: int
    most_jobs_of_owner: int
    most_input_bytes: int


class DeliveryJson(TypedDict):
    """A `Delivery` as it is stored."""

    at: str
    status: int | None
    failure: str | None
    seconds: float


class DeliveriesJson(TypedDict):
    """The log of the deliveries of a job's callback."""

    log: list[DeliveryJson]


@dataclass(frozen=True, slots=True)
class Delivery:
    """One attempt to call a job's `callback_url`: the status of the answer (None: there was none), and what failed."""

    at: datetime
    status: int | None
    failure: str | None
    seconds: float


@dataclass(frozen=True, slots=True, eq=False)
class StoredJob:
    """A job. `attempts` counts its starts; `revision` counts its changes.

    `answer` is the head of the response (status and headers), `answer_key` the blob of its body; `problem` is the body
    of a job that failed or was cancelled.
    """

    id: str
    owner: str | None
    request: RequestJson
    input_key: str | None
    state: JobState
    stage: str | None
    progress: float
    revision: int
    attempts: int
    created_at: datetime
    started_at: datetime | None
    ended_at: datetime | None
    answer: HeadJson | None
    answer_key: str | None
    problem: ProblemJson | None
    callback_url: str | None
    deliveries: tuple[Delivery, ...] = ()

    @property
    def is_over(self) -> bool:
        """Whether its state is final."""
        return self.state in FINAL_STATES


@dataclass(frozen=True, slots=True, eq=False)
class Lease:
    """A job that a worker may run until the lease ends. Only who knows the `token` can change the job."""

    job: StoredJob
    token: str


@dataclass(frozen=True, slots=True)
class Progress:
    """What a worker reports of a job that it runs."""

    job_id: str
    token: str
    stage: str | None
    progress: float


@dataclass(frozen=True, slots=True, eq=False)
class JobEnd:
    """The end of a job. See `StoredJob`."""

    state: JobState
    answer: HeadJson | None = None
    answer_key: str | None = None
    answer_bytes: int = 0
    problem: ProblemJson | None = None


@dataclass(frozen=True, slots=True)
class QueueStatus:
    """Unfinished jobs: how many wait and run, bytes of their inputs, and seconds since the oldest one was accepted."""

    queued: int
    running: int
    input_bytes: int
    oldest_s: float


def blob_key(job_id: str, part: str) -> str:
    """Key of a blob of a job."""
    return f"{JOB_BLOBS}/{job_id}/{part}"


def job_of_blob(key: str) -> str:
    """Id of the job that a blob belongs to."""
    return key.split("/")[1] if key.count("/") else ""

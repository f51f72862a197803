"""The seam behind which work runs, and what can befall a job there."""

from dataclasses import dataclass
from typing import Protocol, TypeVar, runtime_checkable

from services.contract.operations import Operation
from services.errors import DocumentError
from services.progress import ProgressSink

T = TypeVar("T")


class Busy(DocumentError):
    """No seat is free; the detail names the limit, `retry_after_s` says when to come again."""

    code = "busy"

    def __init__(self, detail: str, retry_after_s: int = 1) -> None:
        super().__init__(detail)
        self.args = (detail, retry_after_s)
        self.retry_after_s = retry_after_s


class ShuttingDown(Busy):
    """The service is stopping and takes no new work."""

    code = "shutting-down"


class JobTimedOut(DocumentError):
    """The work ran past its limit and was stopped."""

    code = "timed-out"


class WorkerDied(DocumentError):
    """The process that did the work ended before it was done (a crash, a kill)."""

    code = "worker-died"


class OutOfMemory(DocumentError):
    """The work needed more memory than a worker may take."""

    code = "out-of-memory"


class JobFailed(DocumentError):
    """The work raised what nobody foresaw: a defect. `traceback` is for the log, never for a client."""

    code = "internal"

    def __init__(self, detail: str, traceback: str = "") -> None:
        super().__init__(detail)
        self.args = (detail, traceback)
        self.traceback = traceback


class EngineFailed(Exception):
    """The engine could not start."""


@dataclass(frozen=True, slots=True)
class TimeLimit:
    """Longest that a job may run, and the setting that an operator would change."""

    seconds: float
    setting: str


@runtime_checkable
class Spooled(Protocol):
    """Bytes that wait outside of memory until a worker is free to take them."""

    async def read(self) -> bytes:
        """All the bytes."""
        ...


async def unspool(argument: object) -> object:
    """What a worker gets for `argument`: bytes for what is spooled, one after another for a list of it."""
    if isinstance(argument, Spooled):
        return await argument.read()
    if isinstance(argument, list) and all(isinstance(part, Spooled) for part in argument):
        return [await part.read() for part in argument]
    return argument


STARTED = "started"
"""Stage of a job that a worker has taken and that has said nothing itself yet."""


class Admission(Protocol):
    """A seat in the engine, held from before a body is read until its job is over."""

    def release(self) -> None:
        """Give the seat back; more than once is harmless."""
        ...


@dataclass(frozen=True, slots=True)
class EngineStatus:
    """What the engine holds right now, and what it has lost since it started.

    `admitted` of `capacity` seats are taken; `waiting` jobs wait for a worker and `running` jobs have one.
    `facts` is what the workers said of themselves when they were warm.
    """

    ready: bool
    workers: int
    live_workers: int
    capacity: int
    admitted: int
    waiting: int
    running: int
    worker_deaths: int
    recycled_workers: int
    facts: dict[str, object]


@dataclass(frozen=True, slots=True)
class JobRecord:
    """How one job went: `done` or the `code` of its error, and its seconds in queue and at work."""

    outcome: str
    queue_s: float
    work_s: float


class Engine(Protocol):
    """Runs operations, by their names, away from the event loop."""

    async def start(self) -> None:
        """Return when workers are warm.

        Raises
        ------
        EngineFailed
            When no worker can be brought up.
        """
        ...

    def admit(self) -> Admission:
        """A seat, at once.

        Raises
        ------
        Busy
            When every seat is taken, or when the engine is draining.
        """
        ...

    async def submit(
        self,
        operation: Operation[T],
        *arguments: object,
        time_limit: TimeLimit | None = None,
        progress: ProgressSink | None = None,
    ) -> T:
        """Answer of `operation(*arguments)`, run in a worker within `time_limit` (None: the engine's own).

        The worker imports the function that `operation` names; arguments and answer pickle. A `Spooled` argument
        arrives as its bytes, which are read only when a worker is free, and a list of them as a list of theirs.
        Cancelling the caller stops the work. `progress` is called in the event loop: with `STARTED` when a worker
        takes the job, then with what the operation reports, never after the answer.

        Raises
        ------
        DocumentError
            What the operation raised on purpose, and Busy, JobTimedOut, WorkerDied, OutOfMemory, JobFailed.
        """
        ...

    def status(self) -> EngineStatus:
        """The engine as it stands."""
        ...

    async def drain(self, grace_s: float) -> None:
        """Take no more work, let what runs end within `grace_s` seconds, then stop every worker."""
        ...

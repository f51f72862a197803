"""Interface of the engine that runs work, and the errors of its jobs."""

from dataclasses import dataclass
from typing import Protocol, TypeVar, runtime_checkable

from services.contract.operations import Operation
from services.contract.worker_facts import WorkerFacts
from services.errors import DocumentError
from services.progress import ProgressSink

T = TypeVar("T")


class Busy(DocumentError):
    """No seat is free. The detail names the limit; `retry_after_s` is the recommended wait, seconds."""

    code = "busy"

    def __init__(self, detail: str, retry_after_s: int = 1) -> None:
        super().__init__(detail)
        self.args = (detail, retry_after_s)
        self.retry_after_s = retry_after_s


class ShuttingDown(Busy):
    """The service is stopping and takes no new work."""

    code = "shutting-down"


class JobTimedOut(DocumentError):
    """The work exceeded its time limit and was stopped."""

    code = "timed-out"


class WorkerDied(DocumentError):
    """The worker process ended before the work was done (crash or kill)."""

    code = "worker-died"


class OutOfMemory(DocumentError):
    """The work needed more memory than a worker may use."""

    code = "out-of-memory"


class JobFailed(DocumentError):
    """The work raised an unexpected exception: a defect. `traceback` is for the log, never for a client."""

    code = "internal"

    def __init__(self, detail: str, traceback: str = "") -> None:
        super().__init__(detail)
        self.args = (detail, traceback)
        self.traceback = traceback


class EngineFailed(Exception):
    """The engine could not start."""


@dataclass(frozen=True, slots=True)
class TimeLimit:
    """Longest run time of a job, and the name of the setting that limits it."""

    seconds: float
    setting: str


@runtime_checkable
class Spooled(Protocol):
    """Bytes that stay outside of memory until a worker is free."""

    async def read(self) -> bytes:
        """All the bytes."""
        ...


async def unspool(argument: object) -> object:
    """The value that a worker gets for `argument`: the bytes of a `Spooled`, a list of bytes for a list of them."""
    if isinstance(argument, Spooled):
        return await argument.read()
    if isinstance(argument, list) and all(isinstance(part, Spooled) for part in argument):
        return [await part.read() for part in argument]
    return argument


STARTED = "started"
"""Stage of a job that a worker has started and that has not reported a stage yet."""


class Admission(Protocol):
    """A seat in the engine, taken before a body is read and held until its job has ended."""

    def release(self) -> None:
        """Release the seat; repeated calls have no effect."""
        ...


@dataclass(frozen=True, slots=True)
class EngineStatus:
    """Present state of the engine, and counts since its start.

    `admitted` of `capacity` seats are taken; `waiting` jobs wait for a worker and `running` jobs have one.
    `facts` is what the workers reported after their warm-up.
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
    facts: WorkerFacts


@dataclass(frozen=True, slots=True)
class JobRecord:
    """Record of one job: `done` or the `code` of its error, seconds in the queue, and seconds of work."""

    outcome: str
    queue_s: float
    work_s: float


class Engine(Protocol):
    """Runs operations, given by name, outside the event loop."""

    async def start(self) -> None:
        """Return when the workers have warmed up.

        Raises
        ------
        EngineFailed
            When no worker can be started.
        """
        ...

    def admit(self) -> Admission:
        """A seat, without waiting.

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
        """Result of `operation(*arguments)`, run in a worker.

        Cancelling the caller stops the work.

        Parameters
        ----------
        operation
            "module:function"; the worker imports it.
        arguments
            They must pickle, as must the result. A `Spooled` arrives as its bytes, a list of them as a list of bytes;
            they are read only when a worker is free.
        time_limit
            None: the engine's own.
        progress
            Called in the event loop: with `STARTED` when a worker takes the job, then with the operation's own reports,
            never after the result.

        Raises
        ------
        DocumentError
            An error that the operation raised on purpose; Busy, JobTimedOut, WorkerDied, OutOfMemory, JobFailed.
        """
        ...

    def status(self) -> EngineStatus:
        """The present state of the engine."""
        ...

    async def drain(self, grace_s: float) -> None:
        """Accept no more work, wait up to `grace_s` seconds for running jobs, then stop every worker."""
        ...

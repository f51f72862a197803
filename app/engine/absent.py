"""The engine of a service without workers: its work is done by workers elsewhere, through the queue of jobs."""

from typing import TypeVar

from app.engine.base import Busy, EngineStatus, ShuttingDown, TimeLimit
from services.contract.operations import Operation
from services.contract.worker_facts import WorkerFacts
from services.progress import ProgressSink

T = TypeVar("T")


class _NoSeat:
    def release(self) -> None:
        """There is nothing to release."""


class AbsentEngine:
    """Runs nothing. Requests do not come here: they are forwarded before."""

    def __init__(self) -> None:
        self._draining = False

    async def start(self) -> None:
        """There is nothing to start."""

    def admit(self) -> _NoSeat:
        """A seat: the queue of jobs limits what is accepted."""
        if self._draining:
            raise ShuttingDown("The service is shutting down. Send the request again.", 1)
        return _NoSeat()

    async def submit(
        self,
        operation: Operation[T],
        *arguments: object,
        time_limit: TimeLimit | None = None,
        progress: ProgressSink | None = None,
    ) -> T:
        """Raises `Busy`."""
        raise Busy("This service has no workers (WORKERS=0). Send the request to another one.")

    def status(self) -> EngineStatus:
        """Ready, as far as this process is concerned."""
        return EngineStatus(not self._draining, 0, 0, 0, 0, 0, 0, 0, 0, WorkerFacts())

    async def drain(self, grace_s: float) -> None:
        """Take no more."""
        self._draining = True

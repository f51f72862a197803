"""Errors of jobs: from what a worker answered, and from how it ended without an answer."""

import signal
from contextlib import suppress
from pathlib import Path
from typing import cast

from app.engine import worker as inside
from app.engine.base import JobFailed, OutOfMemory, WorkerDied
from services.errors import DocumentError


def error_of(outcome: str, value: object, memory_bytes: int) -> DocumentError | None:
    """Error of a worker's answer; None if the work is done. `memory_bytes` is the worker's limit."""
    if outcome == inside.DONE:
        return None
    if outcome == inside.REFUSED:
        return cast(DocumentError, value)
    if outcome == inside.OUT_OF_MEMORY:
        return _out_of_memory(memory_bytes)
    detail, traceback = cast(tuple[str, str], value)
    return JobFailed(detail, traceback)


class Losses:
    """Workers that ended without an answer."""

    def __init__(self, memory_bytes: int) -> None:
        self._memory_bytes = memory_bytes
        self._memory_kills = memory_kills()

    def error_of(self, exit_code: int | None) -> DocumentError:
        """Error of the job of such a worker.

        The kernel kills a process where the machine's memory is used up. Native code aborts its process where an
        allocation fails. The same work would fail again, so that the error must not recommend to send it again.
        """
        kills, self._memory_kills = self._memory_kills, memory_kills()
        if exit_code == -signal.SIGABRT or (exit_code == -signal.SIGKILL and self._memory_kills > kills):
            return _out_of_memory(self._memory_bytes)
        return WorkerDied(
            "The worker process ended before the work was done. Other requests are not affected."
        )


def _out_of_memory(memory_bytes: int) -> OutOfMemory:
    return OutOfMemory(
        f"The work needs more memory than a worker may use ({memory_bytes} bytes, WORKER_MEMORY_BYTES). "
        "Send a smaller image."
    )


def memory_kills(root: Path = Path("/")) -> int:
    """Number of processes that the kernel has killed for lack of memory since the machine started."""
    with suppress(OSError):
        for line in (root / "proc/vmstat").read_text(encoding="ascii").splitlines():
            if line.startswith("oom_kill "):
                return int(line.split()[1])
    return 0

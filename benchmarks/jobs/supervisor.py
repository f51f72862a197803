"""Processes that are kept running, as an operator has them kept: one that ends is started again."""

import time
from collections.abc import Sequence
from threading import Event, Thread
from types import TracebackType
from typing import Self

from benchmarks.jobs.processes import NotStarted, Process

RESTART_PAUSE_S = 1.0
"""After a start that failed, for example because the database was away."""
_LOOK_EVERY_S = 0.05


class Supervisor:
    """Keeps processes running inside of the block, whoever ends them and however often a start fails."""

    def __init__(self, processes: Sequence[Process]) -> None:
        self.processes = processes
        self.failed_starts = 0
        self._is_over = Event()
        self._threads = [Thread(target=self._keep, args=(process,), daemon=True) for process in processes]

    def __enter__(self) -> Self:
        for process, thread in zip(self.processes, self._threads, strict=True):
            thread.start()
            self.await_up(process)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._is_over.set()
        for process in self.processes:
            process.stop()
        for thread in self._threads:
            thread.join()

    def await_up(self, process: Process) -> None:
        """Return when the process is up, or the block ends."""
        while not process.is_up and not self._is_over.is_set():
            time.sleep(_LOOK_EVERY_S)

    def await_all(self) -> None:
        """Return when all processes are up."""
        for process in self.processes:
            self.await_up(process)

    def restart(self, process: Process) -> None:
        """Stop the process as a rolling deployment does, and return when its successor is up."""
        process.stop()
        self.await_up(process)

    def _keep(self, process: Process) -> None:
        while not self._is_over.is_set():
            try:
                process.start()
            except NotStarted as failure:
                if not self._is_over.is_set():
                    self.failed_starts += 1
                    print(f"A start failed, and is repeated: {failure}", flush=True)
                    self._is_over.wait(RESTART_PAUSE_S)
                continue
            if self._is_over.is_set():
                process.stop()
            process.wait()

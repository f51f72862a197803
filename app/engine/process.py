"""The engine's side of one worker process.

Every worker has its own pipe. Pools whose workers share one pipe were tried first. In pebble 5.2, killing a worker
that was idle or was sending its result broke the whole pool. concurrent.futures abandons a pool by design when one
worker dies.
"""

import multiprocessing
import os
import pickle
import signal
import threading
from contextlib import suppress
from pathlib import Path
from typing import cast

from app.engine import worker as inside
from app.engine.busy_workers import BusyWorkers
from services.contract.worker_facts import WorkerFacts
from services.progress import ProgressSink


class WorkerGone(Exception):
    """The worker closed its end of the pipe. `exit_code` is negative for a signal, None if it is not known."""

    exit_code: int | None = None


class WorkerProcess:
    """The engine's side of one worker process. `start`, `call` and `stop` block, so they run in threads."""

    _starting = threading.Lock()

    def __init__(self, memory_bytes: int, warm_up: inside.NamedCall | None, busy: BusyWorkers) -> None:
        context = multiprocessing.get_context("forkserver")
        self._connection, far_end = context.Pipe()
        self._far_end = far_end
        self._process = context.Process(
            target=inside.serve,
            args=(far_end, memory_bytes, warm_up, busy),
            name="document-worker",
            daemon=True,
        )
        self._killed = self._stopped = False

    def start(self) -> WorkerFacts:
        """Start the process and wait for its warm-up; the facts that it reports."""
        with self._starting:  # multiprocessing's list of children is not thread-safe
            self._process.start()
        self._far_end.close()
        if self._killed:
            self.kill()
        outcome, facts = self._receive()
        if outcome != inside.READY:
            raise WorkerGone
        return cast(WorkerFacts, facts)

    def call(
        self,
        operation: str,
        arguments: list[object],
        limit_s: float = float("inf"),
        listen: ProgressSink | None = None,
    ) -> inside.Outcome:
        """Outcome of `operation(*arguments)`; empties `arguments`.

        Uploads are large, so the server's copy is deleted once the worker has it. The operation can ask how much of
        `limit_s` is left; the caller stops it after that time. `listen` receives the progress, in the calling thread.
        """
        call = pickle.dumps(
            (operation, tuple(arguments), limit_s, listen is not None), protocol=pickle.HIGHEST_PROTOCOL
        )
        arguments.clear()
        try:
            self._connection.send_bytes(call)
        except OSError as error:
            raise WorkerGone from error
        del call
        try:
            return self._outcome(listen)
        except WorkerGone as gone:
            self._process.join(timeout=1)
            gone.exit_code = self._process.exitcode
            raise

    def _outcome(self, listen: ProgressSink | None) -> inside.Outcome:
        while (outcome := self._receive())[0] == inside.PROGRESS:
            if listen is not None:
                listen(*cast(tuple[str, float], outcome[1]))
        return outcome

    def _receive(self) -> inside.Outcome:
        try:
            answer = self._connection.recv_bytes()
        except (EOFError, OSError) as error:
            raise WorkerGone from error
        return cast(inside.Outcome, pickle.loads(answer))

    def kill(self) -> None:
        """Kill the process and its children now; a blocked `start` or `call` in another thread returns."""
        self._killed = True
        # Not `is_alive`: it is False for a running worker whose fork server was killed.
        if self._process.pid is None or self._stopped:
            return
        with suppress(ProcessLookupError):
            os.kill(self._process.pid, signal.SIGKILL)
        with suppress(ProcessLookupError):  # the worker is not yet the leader of its process group
            os.killpg(self._process.pid, signal.SIGKILL)

    def stop(self) -> int | None:
        """Kill, wait, close; the exit code (negative: the signal)."""
        self.kill()
        if self._process.pid is not None:
            self._process.join(timeout=10)
        self._stopped = True
        self._connection.close()
        return self._process.exitcode if self._process.pid is not None else None

    @property
    def pid(self) -> int | None:
        """Process id; None before the start."""
        return self._process.pid

    def resident_bytes(self) -> int:
        """Memory that the process has at present; 0 if it has ended."""
        with suppress(OSError, ValueError, IndexError):
            pages = Path(f"/proc/{self._process.pid}/statm").read_text(encoding="ascii").split()[1]
            return int(pages) * os.sysconf("SC_PAGE_SIZE")
        return 0

    def used_ticks(self) -> int:
        """Processor time that the process has used, in ticks of the system's clock; 0 if it does not run."""
        fields = self._status()
        return int(fields[11]) + int(fields[12]) if fields else 0

    def is_runnable(self) -> bool:
        """Whether the process computes, waits for a processor or for a disk."""
        fields = self._status()
        return bool(fields) and fields[0] in {"R", "D"}

    def _status(self) -> list[str]:
        """The fields of proc(5)'s `stat` from the process's state on; none if it does not run."""
        with suppress(OSError):
            # The second field is the program's name, in parentheses, which may contain anything.
            return Path(f"/proc/{self._process.pid}/stat").read_text().rpartition(")")[2].split()
        return []

    def fileno(self) -> int:
        """Descriptor of the pipe. While the worker is idle, it is readable only if the worker has died."""
        return self._connection.fileno()

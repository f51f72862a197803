"""The engine's end of one worker process.

Every worker has a pipe of its own. Pools whose workers share one pipe were tried first: in pebble 5.2 a
worker that was killed while idle, or in the middle of sending its result, took the whole pool along, and
concurrent.futures gives a pool up by design.
"""

import multiprocessing
import os
import pickle
import signal
import threading
from contextlib import suppress
from typing import cast

from app.engine import worker as inside
from services.progress import ProgressSink


class WorkerGone(Exception):
    """The worker hung up."""


class WorkerProcess:
    """The engine's end of one worker process. `start`, `call` and `bury` block and run in threads."""

    _starting = threading.Lock()

    def __init__(self, memory_bytes: int, warm_up: inside.NamedCall | None) -> None:
        context = multiprocessing.get_context("forkserver")
        self._connection, far_end = context.Pipe()
        self._far_end = far_end
        self._process = context.Process(
            target=inside.serve, args=(far_end, memory_bytes, warm_up), name="document-worker", daemon=True
        )
        self._killed = self._buried = False

    def start(self) -> dict[str, object]:
        """Facts that the worker tells when it is warm."""
        with self._starting:  # multiprocessing's bookkeeping of children is not made for threads
            self._process.start()
        self._far_end.close()
        if self._killed:
            self.kill()
        outcome, facts = self._receive()
        if outcome != inside.READY:
            raise WorkerGone
        return cast(dict[str, object], facts)

    def call(
        self, operation: str, arguments: list[object], listen: ProgressSink | None = None
    ) -> inside.Outcome:
        """What became of `operation(*arguments)`; leaves `arguments` empty.

        Uploads are large and work is long: this end forgets them when the worker has them. `listen` is told the
        work's progress, in the calling thread.
        """
        call = pickle.dumps(
            (operation, tuple(arguments), listen is not None), protocol=pickle.HIGHEST_PROTOCOL
        )
        arguments.clear()
        try:
            self._connection.send_bytes(call)
        except OSError as error:
            raise WorkerGone from error
        del call
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
        """Stop the process and all it started, now; any thread inside of `start` or `call` comes back."""
        self._killed = True
        # Not if it `is_alive`: a worker whose fork server has been killed counts as dead, and is not.
        if self._process.pid is None or self._buried:
            return
        with suppress(ProcessLookupError):
            os.kill(self._process.pid, signal.SIGKILL)
        with suppress(ProcessLookupError):  # not yet the leader of its group
            os.killpg(self._process.pid, signal.SIGKILL)

    def bury(self) -> int | None:
        """Kill, wait, close; the exit code (negative: the signal)."""
        self.kill()
        if self._process.pid is not None:
            self._process.join(timeout=10)
        self._buried = True
        self._connection.close()
        return self._process.exitcode if self._process.pid is not None else None

    @property
    def pid(self) -> int | None:
        """Of the process; None before it was started."""
        return self._process.pid

    def fileno(self) -> int:
        """Readable while idle only when the worker has gone."""
        return self._connection.fileno()

"""The worker's side: it runs one call after another, received over one pipe from the engine.

A worker imports nothing else of `app` but the count of busy workers, so that it starts fast and uses little memory.
"""

import errno
import faulthandler
import gc
import os
import pickle
import resource
import select
import signal
import time
import traceback
from contextlib import suppress
from importlib import import_module
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Literal

from app.engine.busy_workers import BusyWorkers
from services.contract.worker_facts import WorkerFacts
from services.deadline import answered_within
from services.errors import DocumentError
from services.heap import keep_few_heaps, keep_freed_memory, release_freed_memory, release_if_large
from services.progress import progress_to
from services.side_by_side import spare_processors

READY, DONE, REFUSED, FAILED, OUT_OF_MEMORY = "ready", "done", "refused", "failed", "out-of-memory"
PROGRESS = "progress"
Outcome = tuple[Literal["ready", "done", "refused", "failed", "out-of-memory", "progress"], object]
"""A worker's message: one after its warm-up, one for each call, and before that any number of `PROGRESS`."""

NamedCall = tuple[str, tuple[object, ...]]
"""A function as "module:function", and its arguments."""

REPORT_EVERY_S = 0.1
"""Shortest time between two reports of one stage; clients do not read faster."""
MOST_REPORTS = 2000
"""Largest number of reports of one call, including the starts of stages. Later ones are dropped."""

SINGLE_THREAD_ENVIRONMENT = {
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    "OPENCV_FOR_THREADS_NUM": "1",
}
"""There is one worker for each processor, so several threads in one worker would only slow each other down. Where
workers are idle, `services.side_by_side` uses a second one."""

COLLECTED_AFTER = 50_000
"""New container objects before Python's garbage collector runs. A model has a tenth of that. One run over the 200
models that a worker caches takes longer than learning from a page."""

IDLE_S = 1.0
"""After so long without a call, freed memory is given back."""

OPENCV_NO_MEMORY = -4
"""cv::Error::StsNoMem: OpenCV's code of a failed allocation."""
_MOST_CAUSES = 8


def serve(connection: Connection, memory_bytes: int, warm_up: NamedCall | None, busy: BusyWorkers) -> None:
    """Report the end of the warm-up, then run calls until the engine closes the pipe."""
    _settle(memory_bytes)
    facts = run(*warm_up) if warm_up is not None else WorkerFacts()
    collect_seldom()
    connection.send_bytes(pickle.dumps((READY, facts)))
    while (answer := _answer_next(connection, busy)) is not None:
        connection.send_bytes(answer)
        del answer
        # What one call has freed serves the next, if that follows.
        if not connection.poll(IDLE_S):
            release_freed_memory()


def run(operation: str, arguments: tuple[object, ...]) -> object:
    """Result of the function that `operation` names as "module:function"."""
    module, _, function = operation.partition(":")
    return getattr(import_module(module), function)(*arguments)


def collect_seldom() -> None:
    """Exclude the objects loaded so far from garbage collection; they live as long as the process."""
    gc.freeze()
    gc.set_threshold(COLLECTED_AFTER)


def _settle(memory_bytes: int) -> None:
    """Prepare the process so that it can be killed at any time without effect on other processes."""
    # An own process group. The terminal's Ctrl-C and the supervisor's SIGTERM then reach only the server, which lets
    # jobs finish. Killing the group also kills the worker's children.
    os.setsid()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    os.environ.update(SINGLE_THREAD_ENVIRONMENT)
    faulthandler.enable()
    keep_few_heaps(1)  # a second thread would keep 40 MB of a heap of its own
    keep_freed_memory()
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    if memory_bytes:
        resource.setrlimit(resource.RLIMIT_AS, (memory_bytes, memory_bytes))
    with suppress(OSError):
        # If the machine runs out of memory, the kernel should kill a worker before the server.
        Path("/proc/self/oom_score_adj").write_text("500", encoding="ascii")


def _answer_next(connection: Connection, busy: BusyWorkers) -> bytes | None:
    """Pickled `Outcome` of the next call, a pickled (operation, arguments, seconds, whether progress is wanted).

    None when the engine has closed the pipe. Errors of the operation are returned as outcomes, not raised.
    """
    try:
        call = connection.recv_bytes()
    except (EOFError, OSError):
        return None
    try:
        operation, arguments, limit_s, listens = pickle.loads(call)
        size = len(call)
        del call  # uploads are large: this leaves one copy while the operation runs
        release_if_large(size)
        reports = ProgressReports(connection).send if listens else None
        with progress_to(reports), answered_within(limit_s), spare_processors(busy.spare_for_each):
            return pickle.dumps((DONE, run(operation, arguments)))
    except DocumentError as error:
        return pickle.dumps((REFUSED, error))
    except BaseException as error:
        if _is_out_of_memory(error):
            return pickle.dumps((OUT_OF_MEMORY, None))
        # Sent as text: the server need not import the exception's class, and cannot fail to unpickle it.
        return pickle.dumps((FAILED, (f"{type(error).__name__}: {error}", traceback.format_exc())))


def _is_out_of_memory(error: BaseException | None) -> bool:
    """Whether a failed allocation is the error or its cause."""
    for _ in range(_MOST_CAUSES):
        if error is None:
            return False
        if isinstance(error, MemoryError) or getattr(error, "errno", None) == errno.ENOMEM:
            return True
        if getattr(error, "code", None) == OPENCV_NO_MEMORY:
            return True
        error = error.__cause__ or error.__context__
    return False


class ProgressReports:
    """Sends progress to the engine, before the answer, over the same pipe.

    Work must neither wait for a reader nor fail without one, so reports that do not fit into the pipe are dropped.
    """

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._room = select.poll()
        self._room.register(connection.fileno(), select.POLLOUT)
        self._left = MOST_REPORTS
        self._stage: str | None = None
        self._next_s = 0.0

    def send(self, stage: str, fraction: float) -> None:
        now = time.monotonic()
        if not self._left or (stage == self._stage and now < self._next_s):
            return
        self._stage, self._next_s = stage, now + REPORT_EVERY_S
        self._left -= 1
        with suppress(OSError):
            if self._room.poll(0):
                self._connection.send_bytes(pickle.dumps((PROGRESS, (stage, fraction))))

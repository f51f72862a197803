"""The inside of a worker process: one call after another, over one pipe to the engine.

This module is all that a worker imports of `app`, so that a worker starts fast and stays small.
"""

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

from services.errors import DocumentError
from services.progress import progress_to

READY, DONE, REFUSED, FAILED, OUT_OF_MEMORY = "ready", "done", "refused", "failed", "out-of-memory"
PROGRESS = "progress"
Outcome = tuple[Literal["ready", "done", "refused", "failed", "out-of-memory", "progress"], object]
"""What a worker says: one word when it is warm, one for each call, and before that any number of `PROGRESS`."""

NamedCall = tuple[str, tuple[object, ...]]
"""A function as "module:function", and its arguments."""

REPORT_EVERY_S = 0.1
"""Reports within one stage are no closer than this; nobody reads faster."""
MOST_REPORTS = 2000
"""Of one call, beginnings of stages included; then it goes on in silence."""

SINGLE_THREAD_ENVIRONMENT = {
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    "OPENCV_FOR_THREADS_NUM": "1",
}
"""Workers are as many as processors; threads inside of them would only fight each other."""

COLLECTED_AFTER = 50_000
"""Containers that come to stay before Python looks for cycles among them: a model has a tenth of that, and every look
at 200 models that a worker keeps takes longer than learning from a page."""

OPENCV_NO_MEMORY = -4
"""cv::Error::StsNoMem: OpenCV's own word for a failed allocation."""


def serve(connection: Connection, memory_bytes: int, warm_up: NamedCall | None) -> None:
    """Say that this worker is warm, then answer calls until the engine hangs up."""
    _settle(memory_bytes)
    facts = run(*warm_up) if warm_up is not None else {}
    collect_seldom()
    connection.send_bytes(pickle.dumps((READY, facts)))
    while (answer := _answer_next(connection)) is not None:
        connection.send_bytes(answer)


def run(operation: str, arguments: tuple[object, ...]) -> object:
    """Answer of the function that `operation` names as "module:function"."""
    module, _, function = operation.partition(":")
    return getattr(import_module(module), function)(*arguments)


def collect_seldom() -> None:
    """Spare what is loaded now, which stays, from being looked at for cycles again and again."""
    gc.freeze()
    gc.set_threshold(COLLECTED_AFTER)


def _settle(memory_bytes: int) -> None:
    """Make the process one that can be killed at any moment without harm to its neighbours."""
    # A group of its own: the terminal's Ctrl-C and the supervisor's SIGTERM reach the server, which lets
    # jobs end; and a kill of the group takes whatever the worker may have started along.
    os.setsid()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    os.environ.update(SINGLE_THREAD_ENVIRONMENT)
    faulthandler.enable()
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    if memory_bytes:
        resource.setrlimit(resource.RLIMIT_AS, (memory_bytes, memory_bytes))
    with suppress(OSError):
        # When the machine itself runs out of memory, a worker shall go before the server.
        Path("/proc/self/oom_score_adj").write_text("500", encoding="ascii")


def _answer_next(connection: Connection) -> bytes | None:
    """Pickled `Outcome` of the next call, a pickled (operation, arguments, whether progress is asked for).

    None when the engine hung up.

    Never raises what can be told instead.
    """
    try:
        call = connection.recv_bytes()
    except (EOFError, OSError):
        return None
    try:
        operation, arguments, listens = pickle.loads(call)
        del call  # uploads are large; while the operation runs they are here once
        with progress_to(ProgressReports(connection).send if listens else None):
            return pickle.dumps((DONE, run(operation, arguments)))
    except DocumentError as error:
        return pickle.dumps((REFUSED, error))
    except BaseException as error:
        if isinstance(error, MemoryError) or getattr(error, "code", None) == OPENCV_NO_MEMORY:
            return pickle.dumps((OUT_OF_MEMORY, None))
        # Told as text: the server need not import what raised it, and cannot stumble over its pickle.
        return pickle.dumps((FAILED, (f"{type(error).__name__}: {error}", traceback.format_exc())))


class ProgressReports:
    """Progress on its way to the engine, before the answer, over the same pipe.

    Work must not wait for a reader and must not fail for want of one: what does not fit into the pipe is left out.
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

"""Steps of one work in two threads, where a processor has nothing else to do.

A worker has one thread, since there is a worker for each processor. While others are idle, steps that do not need each
other run side by side: OpenCV, NumPy's larger loops and the codecs do not hold Python's lock. Where none is idle, such
a step runs when its result is asked for. Results are the same to the byte.

Spare processors belong to the context that set them, so what runs in a second thread starts no third one, reports no
progress and knows no deadline.
"""

import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from types import TracebackType
from typing import Generic, Self, TypeVar

T = TypeVar("T")

SWITCH_S = 0.0005
"""After so long a thread that computes in Python lets the other one go on; by itself it keeps it waiting for 5 ms, and
an image is a hundred short steps of OpenCV."""


class _Spare:
    """Processors that have nothing to do, and those of them that steps of this work use."""

    def __init__(self, count: Callable[[], int]) -> None:
        self._count = count
        self._taken = 0
        self._lock = threading.Lock()

    def take(self) -> bool:
        """Take one, if one is left now."""
        with self._lock:
            is_left = self._taken < self._count()
            self._taken += is_left
            return is_left

    def give_back(self) -> None:
        """Give one back."""
        with self._lock:
            self._taken -= 1


_SPARE: ContextVar[_Spare | None] = ContextVar("spare_processors", default=None)
_joined = threading.local()


@contextmanager
def spare_processors(count: Callable[[], int]) -> Iterator[None]:
    """Let the block use as many processors besides its own as `count` says each time a step could begin."""
    token, usual_s = _SPARE.set(_Spare(count)), sys.getswitchinterval()
    sys.setswitchinterval(SWITCH_S)
    try:
        yield
    finally:
        sys.setswitchinterval(usual_s)
        _SPARE.reset(token)


def cpu_seconds() -> float:
    """CPU time of this thread, with that of the threads it has waited for."""
    return time.thread_time() + float(getattr(_joined, "seconds", 0.0))


class SideStep(Generic[T]):
    """A step that runs beside its caller's, if a processor is spare, else when `result` is asked for.

    Leaving a `with` block ends it without a result: the caller goes on when its thread has ended.
    """

    def __init__(self, step: Callable[[], T]) -> None:
        self._step: Callable[[], T] | None = step
        self._value: T | None = None
        self._error: BaseException | None = None
        self.cpu_s = 0.0
        """CPU time of its thread, once that has ended."""
        self._is_counted = False
        self._thread: threading.Thread | None = None
        spare = _SPARE.get()
        if spare is None or not spare.take():
            return
        thread = threading.Thread(target=self._run_beside, args=(spare,), name="side-step", daemon=True)
        try:
            thread.start()
        except RuntimeError:  # no memory for another stack: it runs later, in this thread
            spare.give_back()
        else:
            self._thread = thread

    @property
    def is_beside(self) -> bool:
        """Whether it runs, or ran, in a thread of its own."""
        return self._thread is not None

    def result(self) -> T:
        """What the step returns, or raises."""
        if self._thread is None:
            self._run()
        else:
            self._join()
        if self._error is not None:
            raise self._error
        return self._value  # type: ignore[return-value]

    def end(self) -> None:
        """Wait for the thread, if there is one, and forget the step."""
        self._join()
        self._step = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.end()

    def _run(self) -> None:
        step, self._step = self._step, None
        if step is None:
            return
        try:
            self._value = step()
        except BaseException as error:
            self._error = error

    def _run_beside(self, spare: _Spare) -> None:
        self._run()
        self.cpu_s = time.thread_time()
        spare.give_back()

    def _join(self) -> None:
        if self._thread is not None:
            self._thread.join()
            if not self._is_counted:
                _joined.seconds = getattr(_joined, "seconds", 0.0) + self.cpu_s
                self._is_counted = True

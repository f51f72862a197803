"""Steps of one work in two threads, where a processor has nothing else to do.

A worker has one thread, since there is a worker for each processor. While others are idle, steps that do not need each
other run side by side: OpenCV, NumPy's larger loops and the codecs do not hold Python's lock. Where all are busy, a
step waits for one that another step of the same work has; if it has not begun when its result is asked for, it runs
then, in its caller's thread. Results are the same to the byte.

Spare processors belong to the context that set them, so what runs in a second thread starts no third one, reports no
progress and knows no deadline.
"""

import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from types import TracebackType
from typing import Any, Generic, Self, TypeVar

T = TypeVar("T")

SWITCH_S = 0.0005
"""After so long a thread that computes in Python lets the other one go on; by itself it keeps it waiting for 5 ms, and
an image is a hundred short steps of OpenCV."""


class _Spare:
    """Processors that have nothing to do, those of them that steps of this work use, and steps that wait for one."""

    def __init__(self, count: Callable[[], int]) -> None:
        self._count = count
        self._taken = 0
        self._waiting: deque[SideStep[Any]] = deque()
        self._lock = threading.Lock()

    def offer(self, step: "SideStep[Any]") -> bool:
        """Begin the step if a processor is left now, else let it wait for one; false where none was spare for long."""
        with self._lock:
            if self._taken < self._count():
                thread = threading.Thread(target=self._run, args=(step,), name="side-step", daemon=True)
                try:
                    thread.start()
                except RuntimeError:  # no memory for another stack
                    return False
                self._taken += 1
                step.is_beside = True
                return True
            if self._taken:
                self._waiting.append(step)
            return self._taken > 0

    def withdraw(self, step: "SideStep[Any]") -> bool:
        """Whether the step has not begun; then it will not."""
        with self._lock:
            if step not in self._waiting:
                return False
            self._waiting.remove(step)
            return True

    def _run(self, first: "SideStep[Any]") -> None:
        step: SideStep[Any] | None = first
        while step is not None:
            step.run_beside()
            done, step = step, self._next()
            done.ended.set()  # the processor is given back, or taken by the next step, before its caller goes on

    def _next(self) -> "SideStep[Any] | None":
        """A step that waits, unless another work needs the processor now; with none the processor is given back."""
        with self._lock:
            if self._waiting and self._taken <= self._count():
                step = self._waiting.popleft()
                step.is_beside = True
                return step
            self._taken -= 1
            return None


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
    """A step that runs beside its caller's as soon as a processor is spare, else when `result` is asked for.

    Leaving a `with` block ends it without a result: the caller goes on when the step has ended, if it has begun.
    """

    def __init__(self, step: Callable[[], T]) -> None:
        self._step: Callable[[], T] | None = step
        self._value: T | None = None
        self._error: BaseException | None = None
        self.is_beside = False
        """Whether it runs, or ran, in a thread of its own."""
        self.cpu_s = 0.0
        """CPU time in that thread, once it has ended."""
        self._is_counted = False
        self.ended = threading.Event()
        """Set by the thread that ran it."""
        spare = _SPARE.get()
        self._spare = spare if spare is not None and spare.offer(self) else None

    def result(self) -> T:
        """What the step returns, or raises."""
        if not self._join():
            self._run()
        if self._error is not None:
            raise self._error
        return self._value  # type: ignore[return-value]

    def end(self) -> None:
        """Wait until the step has ended, if it has begun, and forget it."""
        self._join()
        self._step = None

    def run_beside(self) -> None:
        """Run it in a thread that is not its caller's, which then sets `ended`."""
        begin_s = time.thread_time()
        self._run()
        self.cpu_s = time.thread_time() - begin_s

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

    def _join(self) -> bool:
        """Wait until it has ended in another thread; false if it has not begun in one, and will not."""
        if self._spare is None or self._spare.withdraw(self):
            self._spare = None
            return False
        self.ended.wait()
        if not self._is_counted:
            _joined.seconds = getattr(_joined, "seconds", 0.0) + self.cpu_s
            self._is_counted = True
        return True

"""A few processes of one thread each, so that measured CPU time is one core's."""

import os
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from typing import TypeVar

MOST_WORKERS = 2


Item = TypeVar("Item")
Options = TypeVar("Options")
Figures = TypeVar("Figures")


class Progress:
    """Lines on stderr that number what is done, with an estimate of the time that is left."""

    def __init__(self, total: int) -> None:
        self._total, self._done = total, 0
        self._start = time.perf_counter()

    def tell(self, text: str) -> None:
        """One more is done."""
        self._done += 1
        elapsed_s = time.perf_counter() - self._start
        left_s = elapsed_s / self._done * (self._total - self._done)
        print(
            f"[{self._done}/{self._total} {elapsed_s:.0f}s, {_duration(left_s)} left] {text}",
            file=sys.stderr,
            flush=True,
        )


def _duration(seconds: float) -> str:
    return f"{seconds:.0f}s" if seconds < 120 else f"{seconds / 60:.0f}min"


def run_in_workers(
    work: Callable[[Item], Figures],
    items: Sequence[Item],
    start: Callable[[Options], None],
    options: Options,
    workers: int,
) -> Iterator[Figures]:
    """`work` of every item, as it comes; each process calls `start(options)` first.

    Raises
    ------
    Exception
        Whatever `work` raises: the benchmark's own errors are not figures.
    """
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "OMP_THREAD_LIMIT"):
        os.environ[variable] = "1"
    count = max(1, min(workers, MOST_WORKERS, len(items)))
    with ProcessPoolExecutor(count, get_context("spawn"), start, (options,)) as pool:
        for done in as_completed([pool.submit(work, item) for item in items]):
            yield done.result()

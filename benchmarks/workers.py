"""A few processes of one thread each, so that measured CPU time is one core's."""

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from typing import TypeVar

MOST_WORKERS = 2


Item = TypeVar("Item")
Options = TypeVar("Options")
Figures = TypeVar("Figures")


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

"""CPU time of the stages, for the answer's `timings_ms` and the benchmarks."""

import time
from collections.abc import Iterator
from contextlib import contextmanager


class StageClock:
    """CPU milliseconds of each stage, in the order they ran."""

    def __init__(self) -> None:
        self.timings_ms: dict[str, float] = {}

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Add the CPU time of the block to stage `name`."""
        start = time.process_time()
        try:
            yield
        finally:
            spent_ms = 1000 * (time.process_time() - start)
            self.timings_ms[name] = self.timings_ms.get(name, 0.0) + spent_ms

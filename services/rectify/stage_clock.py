"""CPU time of the stages, for the answer's `timings_ms` and the benchmarks; and their beginnings as progress."""

import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager

from services.progress import report_progress


class StageClock:
    """CPU milliseconds of each stage, in the order they ran."""

    def __init__(self, begins: Mapping[str, float] | None = None) -> None:
        """`begins`: the share of the work (0-1) that is done, as a rule, when a stage begins; others report nothing."""
        self._begins = begins or {}
        self.timings_ms: dict[str, float] = {}

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Add the CPU time of the block to stage `name`."""
        if name in self._begins:
            report_progress(name, self._begins[name])
        start = time.process_time()
        try:
            yield
        finally:
            spent_ms = 1000 * (time.process_time() - start)
            self.timings_ms[name] = self.timings_ms.get(name, 0.0) + spent_ms

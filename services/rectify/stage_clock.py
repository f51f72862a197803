"""CPU time of the stages, for the answer's `timings_ms` and the benchmarks; and their beginnings as progress."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager

from services.progress import report_progress
from services.side_by_side import cpu_seconds


class StageClock:
    """CPU milliseconds of each stage, in the order they ran; a thread's count in the stage that waits for it."""

    def __init__(self, begins: Mapping[str, float] | None = None) -> None:
        """`begins`: the share of the work (0-1) that is done, as a rule, when a stage begins; others report nothing."""
        self._begins = begins or {}
        self.timings_ms: dict[str, float] = {}

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Add the CPU time of the block to stage `name`."""
        if name in self._begins:
            report_progress(name, self._begins[name])
        start = cpu_seconds()
        try:
            yield
        finally:
            spent_ms = 1000 * (cpu_seconds() - start)
            self.timings_ms[name] = self.timings_ms.get(name, 0.0) + spent_ms

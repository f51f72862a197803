"""How many workers of a pool are busy, in memory that the workers see: what is left of the processors is spare."""

import multiprocessing


class BusyWorkers:
    """Counted by the engine, in one thread; read by the workers during their work."""

    def __init__(self, processors: int) -> None:
        """`processors` are those that all workers together may use."""
        self._processors = processors
        self._count = multiprocessing.get_context("forkserver").RawValue("i", 0)

    @property
    def count(self) -> int:
        """Workers that have work."""
        return int(self._count.value)

    def add(self, change: int) -> None:
        """One has begun (1), or ended (-1)."""
        self._count.value += change

    def spare_for_each(self) -> int:
        """Processors that each busy worker may use besides its own."""
        busy = max(1, self.count)
        return max(0, (self._processors - busy) // busy)

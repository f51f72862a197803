"""CPU time and peak memory of a stage."""

import resource
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

_CLEAR = Path("/proc/self/clear_refs")


@dataclass(slots=True)
class Usage:
    """What a stage took: CPU seconds of all threads, and the process's peak resident size, MB."""

    cpu_s: float = 0.0
    wall_s: float = 0.0
    peak_mb: float = 0.0

    def add(self, other: "Usage") -> None:
        """Count a further step."""
        self.cpu_s += other.cpu_s
        self.wall_s += other.wall_s
        self.peak_mb = max(self.peak_mb, other.peak_mb)


@contextmanager
def measured() -> Iterator[Usage]:
    """Measure the block; the peak is of the block alone where the kernel lets it be reset (Linux)."""
    usage = Usage()
    _reset_peak()
    cpu, wall = time.process_time(), time.perf_counter()
    try:
        yield usage
    finally:
        usage.cpu_s, usage.wall_s = time.process_time() - cpu, time.perf_counter() - wall
        usage.peak_mb = _peak_mb()


def _reset_peak() -> None:
    try:
        _CLEAR.write_text("5")
    except OSError:
        return


def _peak_mb() -> float:
    own = peak_of_process_mb("self")
    return own or resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def peak_of_process_mb(pid: int | str) -> float:
    """Largest resident size of a process since it was started or its peak was reset; 0 where not told.

    (A child's `ru_maxrss` would be no less than its parent's size at the fork.)
    """
    try:
        status = Path(f"/proc/{pid}/status").read_text()
    except OSError:
        return 0.0
    sizes = [line.split()[1] for line in status.splitlines() if line.startswith("VmHWM:")]
    return int(sizes[0]) / 1024 if sizes else 0.0

"""Processors and memory that this process may use, from its affinity and the limits of its control groups."""

import math
import os
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

_MOST_MEMORY_BYTES = 1 << 50
_SERVER_BYTES = 256 * 2**20
"""Memory of the server process under load."""
_LEAST_WORKER_BYTES = 1536 * 2**20
"""Memory for which one more worker is started: a photo of 12 megapixels needs 0.7 GB, a page of a PDF 1 GiB more."""
_LEAST_ADDRESS_SPACE_BYTES, _MOST_ADDRESS_SPACE_BYTES = 2**30, 4 * 2**30
"""A worker reserves 0.6 GB for its libraries; 64 megapixels need 3 GB."""


def usable_processors(root: Path = Path("/")) -> int:
    """Number of processors that this process may use, at least 1; a quota of 1.5 processors counts as 2.

    A container with `--cpus 2` sees all processors of its machine, but gets the time of two. One worker for each
    processor would be slower. `root` is the folder that contains `proc` and `sys`.
    """
    return max(1, math.ceil(min([len(os.sched_getaffinity(0)), *_quotas(root)])))


def usable_memory_bytes(root: Path = Path("/")) -> int:
    """Memory that this process may use: that of the machine, or the least limit of its control groups."""
    limits = [_MOST_MEMORY_BYTES]
    with suppress(OSError):
        for line in (root / "proc/meminfo").read_text(encoding="ascii").splitlines():
            if line.startswith("MemTotal:"):
                limits.append(int(line.split()[1]) * 1024)
    for folder, is_first_version in _groups(root, "memory"):
        name = "memory.limit_in_bytes" if is_first_version else "memory.max"
        with suppress(OSError, ValueError):
            limits.append(int((folder / name).read_text()))
    return min(limits)


def usable_workers(root: Path = Path("/")) -> int:
    """Number of workers: one for each processor, as far as the memory suffices, at least 1."""
    return max(1, min(usable_processors(root), usable_memory_bytes(root) // _LEAST_WORKER_BYTES))


def worker_memory_bytes(workers: int, root: Path = Path("/")) -> int:
    """Address space of each of `workers` processes, so that all together stay within the memory; 1 to 4 GiB."""
    share = (usable_memory_bytes(root) * 9 // 10 - _SERVER_BYTES) // workers
    return max(_LEAST_ADDRESS_SPACE_BYTES, min(_MOST_ADDRESS_SPACE_BYTES, share))


def _quotas(root: Path) -> Iterator[float]:
    """CPU quotas of the control groups of this process and of all groups above it, in processors."""
    for folder, is_first_version in _groups(root, "cpu"):
        with suppress(OSError, ValueError, ZeroDivisionError):
            yield _quota(folder, is_first_version=is_first_version)


def _groups(root: Path, controller: str) -> Iterator[tuple[Path, bool]]:
    """Folders of the control groups of this process and of all groups above, and whether they are of version 1."""
    groups = ""
    with suppress(OSError):
        groups = (root / "proc/self/cgroup").read_text(encoding="utf-8")
    for line in groups.splitlines():
        _, controllers, path = line.split(":", 2)
        mount = root / "sys/fs/cgroup"
        if controllers:  # version 1 has one tree for each controller
            mount /= controller
        if controllers and controller not in controllers.split(","):
            continue
        group = mount / path.lstrip("/")
        for folder in (group, *group.parents):
            if folder.is_relative_to(mount):
                yield folder, bool(controllers)


def _quota(group: Path, *, is_first_version: bool) -> float:
    """CPU time per period divided by the period, for one group. `ValueError` if it has no limit (`max`, -1)."""
    if is_first_version:
        used, period = ((group / f"cpu.cfs_{name}_us").read_text() for name in ("quota", "period"))
    else:
        used, period = (group / "cpu.max").read_text().split()
    quota = int(used) / int(period)
    if quota <= 0:
        raise ValueError("no limit")
    return quota

"""Number of processors that this process may use, from its affinity and the CPU quotas of its control groups."""

import math
import os
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path


def usable_processors(root: Path = Path("/")) -> int:
    """Number of processors that this process may use, at least 1; a quota of 1.5 processors counts as 2.

    A container with `--cpus 2` sees all processors of its machine, but gets the time of two. One worker for each
    processor would be slower. `root` is the folder that contains `proc` and `sys`.
    """
    return max(1, math.ceil(min([len(os.sched_getaffinity(0)), *_quotas(root)])))


def _quotas(root: Path) -> Iterator[float]:
    """CPU quotas of the control groups of this process and of all groups above it, in processors."""
    groups = ""
    with suppress(OSError):
        groups = (root / "proc/self/cgroup").read_text(encoding="utf-8")
    for line in groups.splitlines():
        _, controllers, path = line.split(":", 2)
        mount = root / "sys/fs/cgroup"
        if controllers:  # version 1 has one tree for each controller
            mount /= "cpu"
        if controllers and "cpu" not in controllers.split(","):
            continue
        group = mount / path.lstrip("/")
        for folder in (group, *group.parents):
            if folder.is_relative_to(mount):
                with suppress(OSError, ValueError, ZeroDivisionError):
                    yield _quota(folder, is_first_version=bool(controllers))


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

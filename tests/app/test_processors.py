"""Processors that may be used, by the affinity and by the CPU quotas of control groups."""

import os
from pathlib import Path

import pytest

from app.processors import usable_memory_bytes, usable_processors, usable_workers, worker_memory_bytes


@pytest.fixture(autouse=True)
def eight_processors(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda pid: set(range(8)))


def mount(root: Path, membership: str, files: dict[str, str]) -> Path:
    """A machine with these files of control groups, and a process with this `/proc/self/cgroup`."""
    for name, text in {"proc/self/cgroup": membership, **files}.items():
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(f"{text}\n")
    return root


@pytest.mark.parametrize(
    ("cpu_max", "expected"),
    [
        ("max 100000", 8),
        ("200000 100000", 2),
        ("150000 100000", 2),
        ("10000 100000", 1),
        ("1600000 100000", 8),
    ],
)
def test_the_quota_of_a_container(tmp_path: Path, cpu_max: str, expected: int) -> None:
    assert usable_processors(mount(tmp_path, "0::/", {"sys/fs/cgroup/cpu.max": cpu_max})) == expected


def test_the_least_quota_of_all_groups_above_counts(tmp_path: Path) -> None:
    files = {
        "sys/fs/cgroup/system.slice/cpu.max": "300000 100000",
        "sys/fs/cgroup/system.slice/pages.service/cpu.max": "max 100000",
        "sys/fs/cgroup/other.slice/cpu.max": "100000 100000",
        "sys/cpu.max": "100000 100000",
    }
    assert usable_processors(mount(tmp_path, "0::/system.slice/pages.service", files)) == 3


@pytest.mark.parametrize(("quota", "expected"), [("-1", 8), ("250000", 3)])
@pytest.mark.parametrize("path", ["/", "/docker/1f", "/docker"])
def test_the_first_version_of_control_groups(tmp_path: Path, path: str, quota: str, expected: int) -> None:
    """In a container the process is told its path on the host, and its own group is at the root of the mount."""
    files = {"sys/fs/cgroup/cpu/cpu.cfs_quota_us": quota, "sys/fs/cgroup/cpu/cpu.cfs_period_us": "100000"}
    membership = f"5:memory:{path}\n4:cpu,cpuacct:{path}\n0::{path}"
    assert usable_processors(mount(tmp_path, membership, files)) == expected


@pytest.mark.parametrize("cpu_max", ["", "many 100000", "100000", "100000 0", "-5 100000"])
def test_what_is_not_understood_limits_nothing(tmp_path: Path, cpu_max: str) -> None:
    assert usable_processors(mount(tmp_path, "0::/", {"sys/fs/cgroup/cpu.max": cpu_max})) == 8


def test_a_machine_without_control_groups(tmp_path: Path) -> None:
    assert usable_processors(tmp_path) == 8


def test_this_machine() -> None:
    assert 1 <= usable_processors() <= 8


GIB = 2**30


@pytest.mark.parametrize(
    ("membership", "files", "expected_gib"),
    [
        ("0::/", {"sys/fs/cgroup/memory.max": "max"}, 32),
        ("0::/", {"sys/fs/cgroup/memory.max": str(2 * GIB)}, 2),
        ("0::/a/b", {"sys/fs/cgroup/a/memory.max": str(GIB), "sys/fs/cgroup/a/b/memory.max": "max"}, 1),
        ("5:memory:/a", {"sys/fs/cgroup/memory/a/memory.limit_in_bytes": str(3 * GIB)}, 3),
        ("5:memory:/a", {"sys/fs/cgroup/memory/a/memory.limit_in_bytes": "9223372036854771712"}, 32),
    ],
)
def test_memory_of_a_container(
    tmp_path: Path, membership: str, files: dict[str, str], expected_gib: int
) -> None:
    machine = {"proc/meminfo": f"MemTotal:       {32 * 2**20} kB", **files}
    assert usable_memory_bytes(mount(tmp_path, membership, machine)) == expected_gib * GIB


@pytest.mark.parametrize(("memory_gib", "workers"), [(1, 1), (4, 2), (8, 5), (64, 8)])
def test_all_workers_together_stay_within_the_memory(tmp_path: Path, memory_gib: int, workers: int) -> None:
    root = mount(tmp_path, "0::/", {"sys/fs/cgroup/memory.max": str(memory_gib * GIB)})
    assert usable_workers(root) == workers
    each = worker_memory_bytes(workers, root)
    assert GIB <= each <= 4 * GIB
    assert workers * each <= memory_gib * GIB

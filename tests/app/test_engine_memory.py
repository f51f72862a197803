"""Workers and memory: what fails for lack of it is 413, and a worker that keeps too much is replaced."""

import asyncio
import os
import signal
from pathlib import Path

import pytest

from app.engine.base import OutOfMemory, WorkerDied
from app.engine.outcomes import Losses
from tests.app.jobs import abort, fail_for_lack_of_memory, free_memory, keep_memory, size_of
from tests.app.pools import engine, named, until

MIB = 2**20


@pytest.mark.parametrize("kind", ["errno", "cause"])
def test_a_failed_allocation_is_known_by_its_cause(kind: str) -> None:
    async def check() -> None:
        async with engine() as pool:
            with pytest.raises(OutOfMemory, match="WORKER_MEMORY_BYTES"):
                await pool.submit(named(fail_for_lack_of_memory), kind)

    asyncio.run(check())


def test_native_code_that_aborts_is_out_of_memory() -> None:
    """C++ ends the process where an allocation fails. `worker-died` would recommend to send the same again."""

    async def check() -> None:
        async with engine() as pool:
            with pytest.raises(OutOfMemory):
                await pool.submit(named(abort))
            assert await pool.submit(named(size_of), b"abc") == 3

    asyncio.run(check())


def test_a_worker_that_keeps_memory_is_replaced() -> None:
    async def check() -> None:
        async with engine(worker_resident_bytes=400 * MIB) as pool:
            first = [await pool.submit(named(keep_memory), MIB) for _ in range(3)]
            last = await pool.submit(named(keep_memory), 400 * MIB)
            assert {*first, last} == {last}
            assert await pool.submit(named(keep_memory), MIB) != last
            assert pool.status().worker_deaths == 0

    asyncio.run(check())


def test_an_idle_worker_gives_back_what_it_has_freed() -> None:
    def resident_bytes(pid: int) -> int:
        return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")

    async def check() -> None:
        async with engine() as pool:
            pid = await pool.submit(named(free_memory), 0)
            before = resident_bytes(pid)
            assert await pool.submit(named(free_memory), 50 * MIB) == pid
            await until(lambda: resident_bytes(pid) < before + 25 * MIB)

    asyncio.run(check())


def test_a_worker_that_the_kernel_killed_for_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    kills = iter([3, 3, 4, 4])
    monkeypatch.setattr("app.engine.outcomes.memory_kills", lambda: next(kills))
    losses = Losses(1000)
    assert isinstance(losses.error_of(-signal.SIGKILL), WorkerDied)  # somebody else killed it
    assert isinstance(losses.error_of(-signal.SIGKILL), OutOfMemory)
    assert isinstance(losses.error_of(-signal.SIGSEGV), WorkerDied)

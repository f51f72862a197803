"""The pool's queue: seats, callers who leave, limits of time, draining."""

import asyncio
from pathlib import Path

import psutil
import pytest

from app.engine.base import (
    Busy,
    JobRecord,
    JobTimedOut,
    ShuttingDown,
    TimeLimit,
)
from tests.app.jobs import (
    announce_and_wait,
    crash,
    hang_in_native_code,
    joined,
    size_of,
    worker_pid,
)
from tests.app.pools import engine, named, until


def test_a_caller_who_leaves_frees_the_worker() -> None:
    async def check() -> None:
        records: list[JobRecord] = []
        async with engine(records=records) as pool:
            job = asyncio.create_task(pool.submit(named(hang_in_native_code)))
            await until(lambda: pool.status().running == 1)
            job.cancel()
            assert await pool.submit(named(size_of), b"abc") == 3
            assert pool.status().worker_deaths == 0
        assert [record.outcome for record in records] == ["cancelled", "done"]

    asyncio.run(check())


def test_a_caller_who_leaves_the_queue_is_passed_over(tmp_path: Path) -> None:
    async def check() -> None:
        async with engine() as pool:
            first = asyncio.create_task(pool.submit(named(announce_and_wait), str(tmp_path)))
            await until(lambda: pool.status().running == 1)
            waiting = asyncio.create_task(pool.submit(named(crash)))
            await until(lambda: pool.status().waiting == 1)
            waiting.cancel()
            await until(lambda: pool.status().waiting == 0)
            (tmp_path / "go").touch()
            pid = await first
            assert await pool.submit(named(worker_pid)) == pid

    asyncio.run(check())


def test_the_queue_has_a_limit_of_time(tmp_path: Path) -> None:
    async def check() -> None:
        async with engine(queue_timeout_s=0.1) as pool:
            first = asyncio.create_task(pool.submit(named(announce_and_wait), str(tmp_path)))
            await until(lambda: pool.status().running == 1)
            with pytest.raises(Busy, match="QUEUE_TIMEOUT_S") as refusal:
                await pool.submit(named(size_of), b"abc")
            assert refusal.value.retry_after_s >= 1
            (tmp_path / "go").touch()
            await first

    asyncio.run(check())


def test_seats_are_bounded_and_come_back() -> None:
    async def check() -> None:
        async with engine(workers=2, queue_length=3) as pool:
            seats = [pool.admit() for _ in range(5)]
            with pytest.raises(Busy, match="QUEUE_LENGTH"):
                pool.admit()
            seats[0].release()
            seats[0].release()
            assert pool.status().admitted == 4
            pool.admit()
            with pytest.raises(Busy):
                pool.admit()

    asyncio.run(check())


class SpooledPhoto:
    """Bytes that count how often they are read."""

    def __init__(self) -> None:
        self.reads = 0

    async def read(self) -> bytes:
        self.reads += 1
        return b"photo"


def test_spooled_bytes_are_read_when_a_worker_is_free(tmp_path: Path) -> None:
    async def check() -> None:
        async with engine() as pool:
            first = asyncio.create_task(pool.submit(named(announce_and_wait), str(tmp_path)))
            await until(lambda: pool.status().running == 1)
            photo = SpooledPhoto()
            second = asyncio.create_task(pool.submit(named(size_of), photo))
            await until(lambda: pool.status().waiting == 1)
            assert photo.reads == 0
            (tmp_path / "go").touch()
            await first
            assert await second == 5
            assert photo.reads == 1

    asyncio.run(check())


def test_a_list_of_spooled_bytes_is_read_when_a_worker_is_free(tmp_path: Path) -> None:
    async def check() -> None:
        async with engine() as pool:
            first = asyncio.create_task(pool.submit(named(announce_and_wait), str(tmp_path)))
            await until(lambda: pool.status().running == 1)
            photos = [SpooledPhoto(), SpooledPhoto()]
            second = asyncio.create_task(pool.submit(named(joined), photos, [b", ", b"end"]))
            await until(lambda: pool.status().waiting == 1)
            assert [photo.reads for photo in photos] == [0, 0]
            (tmp_path / "go").touch()
            await first
            assert await second == b"photophoto, end"
            assert [photo.reads for photo in photos] == [1, 1]

    asyncio.run(check())


def test_a_job_may_have_a_limit_of_its_own() -> None:
    async def check() -> None:
        async with engine(job_timeout_s=20.0) as pool:
            with pytest.raises(JobTimedOut, match=r"0\.1 s \(OTHER_TIMEOUT_S\)"):
                await pool.submit(named(hang_in_native_code), time_limit=TimeLimit(0.1, "OTHER_TIMEOUT_S"))

    asyncio.run(check())


def test_draining_lets_work_end_and_takes_no_more(tmp_path: Path) -> None:
    async def check() -> None:
        async with engine() as pool:
            job = asyncio.create_task(pool.submit(named(announce_and_wait), str(tmp_path)))
            await until(lambda: pool.status().running == 1)
            draining = asyncio.create_task(pool.drain(10))
            await asyncio.sleep(0)
            with pytest.raises(ShuttingDown):
                pool.admit()
            assert not pool.status().ready
            (tmp_path / "go").touch()
            assert await job
            await draining
            with pytest.raises(ShuttingDown):
                await pool.submit(named(worker_pid))

    asyncio.run(check())


def test_draining_stops_what_outlives_the_grace() -> None:
    async def check() -> None:
        async with engine() as pool:
            pid = await pool.submit(named(worker_pid))
            job = asyncio.create_task(pool.submit(named(hang_in_native_code)))
            await until(lambda: pool.status().running == 1)
            await pool.drain(0.05)
            with pytest.raises(ShuttingDown):
                await job
            assert not psutil.pid_exists(pid)

    asyncio.run(check())

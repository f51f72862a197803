"""Progress comes through the worker's pipe beside the answer, and disturbs neither."""

import asyncio
import multiprocessing
import pickle
from pathlib import Path

import pytest

from app.engine.base import STARTED
from app.engine.worker import MOST_REPORTS, PROGRESS, ProgressReports
from tests.app.jobs import hang_in_native_code, report_stages, report_without_end, size_of
from tests.app.pools import engine, named, until

Reports = list[tuple[str, float]]


def test_whoever_asks_hears_how_far_the_work_is(tmp_path: Path) -> None:
    async def check() -> None:
        heard: Reports = []
        async with engine() as pool:
            work = pool.submit(
                named(report_stages), str(tmp_path), progress=lambda *report: heard.append(report)
            )
            job = asyncio.create_task(work)
            await until(lambda: len(heard) == 3)
            assert not job.done()
            (tmp_path / "go").touch()
            assert await job == "done"
            assert heard == [(STARTED, 0.0), ("text", 0.25), ("shape", 0.5)]
            assert await pool.submit(named(size_of), b"abc") == 3
            assert len(heard) == 3

    asyncio.run(check())


def test_work_that_nobody_listens_to_is_done_all_the_same(tmp_path: Path) -> None:
    async def check() -> None:
        (tmp_path / "go").touch()
        async with engine() as pool:
            assert await pool.submit(named(report_stages), str(tmp_path)) == "done"
            assert await pool.submit(named(size_of), b"abc") == 3

    asyncio.run(check())


def test_work_that_says_too_much_is_done_all_the_same(tmp_path: Path) -> None:
    async def check() -> None:
        (tmp_path / "go").touch()
        heard: Reports = []
        async with engine() as pool:
            pid = await pool.submit(
                named(report_without_end), str(tmp_path), progress=lambda *report: heard.append(report)
            )
            assert (str(pid),) == pool.status().facts.languages
        assert 2 <= len(heard) <= 1 + MOST_REPORTS
        assert [fraction for _, fraction in heard] == sorted(fraction for _, fraction in heard)

    asyncio.run(check())


def test_nothing_is_heard_after_the_caller_has_left(tmp_path: Path) -> None:
    async def check() -> None:
        heard: Reports = []
        async with engine() as pool:
            work = pool.submit(
                named(report_stages), str(tmp_path), progress=lambda *report: heard.append(report)
            )
            job = asyncio.create_task(work)
            await until(lambda: len(heard) >= 1)
            job.cancel()
            with pytest.raises(asyncio.CancelledError):
                await job
            count = len(heard)
            assert (
                await pool.submit(named(size_of), b"abc") == 3
            )  # by then the first worker's last word has come
            assert len(heard) == count

    asyncio.run(check())


def test_work_in_the_queue_has_not_started() -> None:
    async def check() -> None:
        heard: Reports = []
        async with engine() as pool:
            first = asyncio.create_task(pool.submit(named(hang_in_native_code)))
            await until(lambda: pool.status().running == 1)
            work = pool.submit(named(size_of), b"abc", progress=lambda *report: heard.append(report))
            second = asyncio.create_task(work)
            await until(lambda: pool.status().waiting == 1)
            assert heard == []
            first.cancel()
            assert await second == 3
            assert heard == [(STARTED, 0.0)]

    asyncio.run(check())


def test_a_full_pipe_does_not_hold_the_work_up() -> None:
    ours, theirs = multiprocessing.Pipe()
    with ours, theirs:
        reports = ProgressReports(theirs)
        for number in range(MOST_REPORTS):
            reports.send(f"stage {number}", 0.5)  # nobody reads
        heard = []
        while ours.poll():
            heard.append(pickle.loads(ours.recv_bytes()))
        assert 10 < len(heard) < MOST_REPORTS
        assert heard == [(PROGRESS, (f"stage {number}", 0.5)) for number in range(len(heard))]


def test_an_engine_that_hung_up_does_not_disturb_the_work() -> None:
    ours, theirs = multiprocessing.Pipe()
    with theirs:
        ours.close()
        ProgressReports(theirs).send("text", 0.5)


def test_within_a_stage_reports_keep_their_distance() -> None:
    ours, theirs = multiprocessing.Pipe()
    with ours, theirs:
        reports = ProgressReports(theirs)
        for number in range(100):
            reports.send("text", number / 100)
        assert pickle.loads(ours.recv_bytes()) == (PROGRESS, ("text", 0.0))
        heard = 1
        while ours.poll():
            ours.recv_bytes()
            heard += 1
        assert heard < 50

"""The pool of processes: what befalls a worker befalls its job and nothing else."""

import asyncio
import os
import signal
import time
from pathlib import Path

import psutil
import pytest

from app.engine.base import (
    EngineFailed,
    JobFailed,
    JobRecord,
    JobTimedOut,
    OutOfMemory,
    TimeLimit,
    WorkerDied,
)
from app.engine.local import LocalEngine, PoolLimits
from services.contract.operations import Operation
from services.errors import NoText
from tests.app.jobs import (
    announce_and_wait,
    answer_a_function,
    crash,
    exit_while_warming_up,
    fail,
    fail_to_warm_up,
    hang_in_native_code,
    hang_while_warming_up,
    leave,
    payload_of,
    refuse,
    resident_bytes,
    seconds_left,
    size_of,
    start_child_and_hang,
    steps_beside,
    take_memory,
    threads_and_limits,
    warm_up_for_long,
    worker_pid,
)
from tests.app.pools import MEMORY_BYTES, engine, named, until


def is_gone(process: psutil.Process) -> bool:
    """Whether it runs no more; where nobody reaps orphans they stay as zombies."""
    try:
        return not process.is_running() or process.status() == psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return True


def test_it_answers_from_a_warm_process_of_its_own() -> None:
    async def check() -> None:
        async with engine() as pool:
            assert pool.status().ready
            assert pool.status().facts.ocr == "none"
            pid = await pool.submit(named(worker_pid))
            assert pool.status().facts.languages == (str(pid),)
            assert pid != os.getpid()
            assert await pool.submit(named(size_of), b"x" * 30_000_000) == 30_000_000
            assert len(await pool.submit(named(payload_of), 30_000_000)) == 30_000_000

    asyncio.run(check())


def test_work_knows_how_much_time_it_has() -> None:
    async def check() -> None:
        async with engine() as pool:
            assert (
                400.0 < await pool.submit(named(seconds_left), time_limit=TimeLimit(500.0, "TIME")) <= 500.0
            )
            assert await pool.submit(named(seconds_left)) < 400.0, "of one call, not of the worker"

    asyncio.run(check())


def test_workers_have_one_thread_bounded_memory_and_a_group_of_their_own(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "2")
    monkeypatch.setenv("OPENCV_FOR_THREADS_NUM", "2")

    async def check() -> None:
        async with engine() as pool:
            assert await pool.submit(named(threads_and_limits)) == {
                "openblas": "1",
                "opencv": "1",
                "memory": MEMORY_BYTES,
                "core": 0,
                "group": True,
            }

    asyncio.run(check())


@pytest.mark.parametrize(("processors", "spare"), [(2, 1), (1, 0)])
def test_work_uses_the_processors_of_idle_workers(tmp_path: Path, processors: int, spare: int) -> None:
    async def check() -> None:
        async with engine(workers=2, processors=processors) as pool:
            assert await pool.submit(named(steps_beside)) == spare
            other = asyncio.create_task(pool.submit(named(announce_and_wait), str(tmp_path)))
            await until(lambda: pool.status().running == 1)
            assert await pool.submit(named(steps_beside)) == 0
            (tmp_path / "go").touch()
            await other
            assert await pool.submit(named(steps_beside)) == spare

    asyncio.run(check())


def test_an_upload_is_held_once_in_the_worker_and_not_at_all_in_the_server(tmp_path: Path) -> None:
    class Upload:
        async def read(self) -> bytes:
            return b"x" * size

    size = 100_000_000

    async def check() -> None:
        async with engine() as pool:
            idle = await pool.submit(named(resident_bytes), b"")
            assert 0.9 * size < await pool.submit(named(resident_bytes), Upload()) - idle < 1.5 * size
            before = resident_bytes(b"")
            job = asyncio.create_task(pool.submit(named(announce_and_wait), str(tmp_path), Upload()))
            await until(lambda: list(tmp_path.glob("running-*")))
            assert resident_bytes(b"") - before < 0.5 * size
            (tmp_path / "go").touch()
            await job

    asyncio.run(check())


@pytest.mark.parametrize("fate", [crash, leave])
def test_a_worker_that_dies_costs_its_job_only(fate: object) -> None:
    async def check() -> None:
        records: list[JobRecord] = []
        async with engine(workers=2, records=records) as pool:
            others = [asyncio.create_task(pool.submit(named(worker_pid))) for _ in range(6)]
            with pytest.raises(WorkerDied):
                await pool.submit(named(fate))  # type: ignore[arg-type]
            assert all(await asyncio.gather(*others))
            assert pool.status().worker_deaths == 1
            assert await pool.submit(named(size_of), b"abc") == 3
        assert sorted(record.outcome for record in records) == ["done"] * 7 + ["worker-died"]

    asyncio.run(check())


def test_kill_9_in_the_middle_of_a_job_costs_that_job(tmp_path: Path) -> None:
    async def check() -> None:
        async with engine(workers=2) as pool:
            jobs = [
                asyncio.create_task(pool.submit(named(announce_and_wait), str(tmp_path))) for _ in range(2)
            ]
            await until(lambda: len(list(tmp_path.glob("running-*"))) == 2)
            victim = int(next(tmp_path.glob("running-*")).name.removeprefix("running-"))
            os.kill(victim, signal.SIGKILL)
            (tmp_path / "go").touch()
            results = await asyncio.gather(*jobs, return_exceptions=True)
            assert sum(isinstance(result, WorkerDied) for result in results) == 1
            assert sum(isinstance(result, int) and result != victim for result in results) == 1
            await until(lambda: pool.status().live_workers == 2)

    asyncio.run(check())


def test_kill_9_while_a_large_result_is_on_its_way() -> None:
    async def check() -> None:
        async with engine() as pool:
            for delay_s in (0.0, 0.01, 0.02, 0.04, 0.08):
                pid = await pool.submit(named(worker_pid))
                job = asyncio.create_task(pool.submit(named(payload_of), 100_000_000))
                await asyncio.sleep(delay_s)
                os.kill(pid, signal.SIGKILL)
                result = (await asyncio.gather(job, return_exceptions=True))[0]
                assert isinstance(result, WorkerDied) or len(result) == 100_000_000
                assert await pool.submit(named(size_of), b"abc") == 3

    asyncio.run(check())


def test_kill_9_of_an_idle_worker_costs_nothing() -> None:
    async def check() -> None:
        async with engine() as pool:
            first = await pool.submit(named(worker_pid))
            os.kill(first, signal.SIGKILL)
            await until(lambda: pool.status().worker_deaths == 1)
            second = await pool.submit(named(worker_pid))
            assert second != first
            assert pool.status().worker_deaths == 1

    asyncio.run(check())


def test_a_hang_in_native_code_is_killed_at_its_limit() -> None:
    async def check() -> None:
        async with engine(job_timeout_s=0.3) as pool:
            begin = time.monotonic()
            with pytest.raises(JobTimedOut, match="JOB_TIMEOUT_S"):
                await pool.submit(named(hang_in_native_code))
            assert 0.3 <= time.monotonic() - begin < 3
            assert await pool.submit(named(size_of), b"abc") == 3
            assert pool.status().worker_deaths == 0

    asyncio.run(check())


def test_a_stopped_worker_cannot_hold_its_place() -> None:
    async def check() -> None:
        async with engine(job_timeout_s=0.3) as pool:
            os.kill(await pool.submit(named(worker_pid)), signal.SIGSTOP)
            with pytest.raises(JobTimedOut):
                await pool.submit(named(size_of), b"x" * 10_000_000)  # more than a pipe holds
            assert await pool.submit(named(size_of), b"abc") == 3

    asyncio.run(check())


def test_the_limit_holds_when_the_fork_server_is_gone() -> None:
    async def check() -> None:
        async with engine(job_timeout_s=0.3) as pool:
            worker = psutil.Process(await pool.submit(named(worker_pid)))
            os.kill(worker.ppid(), signal.SIGKILL)
            with pytest.raises(JobTimedOut):
                await pool.submit(named(hang_in_native_code))
            await until(lambda: is_gone(worker))
            assert await pool.submit(named(size_of), b"abc") == 3

    asyncio.run(check())


def test_what_a_killed_worker_has_started_goes_with_it() -> None:
    async def check() -> None:
        async with engine() as pool:
            worker = psutil.Process(await pool.submit(named(worker_pid)))
            job = asyncio.create_task(pool.submit(named(start_child_and_hang)))
            await until(worker.children)
            child = worker.children()[0]
            job.cancel()
            await until(lambda: is_gone(worker) and is_gone(child))

    asyncio.run(check())


def test_more_memory_than_allowed_is_an_error_of_that_job() -> None:
    async def check() -> None:
        async with engine() as pool:
            assert await pool.submit(named(take_memory), MEMORY_BYTES // 4) == MEMORY_BYTES // 4
            with pytest.raises(OutOfMemory, match=f"{MEMORY_BYTES} bytes, WORKER_MEMORY_BYTES"):
                await pool.submit(named(take_memory), MEMORY_BYTES)
            assert await pool.submit(named(size_of), b"abc") == 3

    asyncio.run(check())


def test_errors_cross_the_border_as_what_they_are() -> None:
    async def check() -> None:
        async with engine() as pool:
            pid = await pool.submit(named(worker_pid))
            with pytest.raises(NoText, match="nothing to read"):
                await pool.submit(named(refuse))
            with pytest.raises(JobFailed, match="a defect") as failure:
                await pool.submit(named(fail))
            assert "in fail" in failure.value.traceback
            with pytest.raises(JobFailed):
                await pool.submit(named(answer_a_function))
            with pytest.raises(JobFailed):
                await pool.submit(Operation("tests.app.jobs:nothing_of_this_name"))
            await pool.submit(named(size_of), b"abc")
            with pytest.raises(JobFailed):
                await pool.submit(named(size_of))
            assert pid  # the process that answered first

    asyncio.run(check())


def test_a_refusal_does_not_cost_the_worker() -> None:
    async def check() -> None:
        async with engine() as pool:
            pid = await pool.submit(named(worker_pid))
            for _ in range(3):
                with pytest.raises(NoText):
                    await pool.submit(named(refuse))
            assert await pool.submit(named(worker_pid)) == pid

    asyncio.run(check())


def test_workers_are_replaced_after_their_share_of_jobs() -> None:
    async def check() -> None:
        async with engine(jobs_per_worker=3) as pool:
            pids = [await pool.submit(named(worker_pid)) for _ in range(9)]
            assert pids == [pids[0]] * 3 + [pids[3]] * 3 + [pids[6]] * 3
            assert len(set(pids)) == 3
            await until(lambda: pool.status().recycled_workers == 3)
            assert pool.status().worker_deaths == 0

    asyncio.run(check())


def test_a_start_is_given_up_when_it_does_nothing_not_when_it_is_slow() -> None:
    async def check() -> None:
        limits = PoolLimits(start_timeout_s=0.1)
        slow = LocalEngine(limits, warm_up=named(warm_up_for_long))  # type: ignore[arg-type]
        await slow.start()
        assert slow.status().live_workers == 1
        await slow.drain(0.0)
        hung = LocalEngine(limits, warm_up=named(hang_while_warming_up))  # type: ignore[arg-type]
        with pytest.raises(EngineFailed, match="exit code -9"):
            await hung.start()

    asyncio.run(check())


@pytest.mark.parametrize("warm_up", [fail_to_warm_up, exit_while_warming_up])
def test_an_engine_that_cannot_warm_up_says_so(warm_up: object) -> None:
    async def check() -> None:
        pool = LocalEngine(PoolLimits(workers=2), warm_up=named(warm_up))  # type: ignore[arg-type]
        with pytest.raises(EngineFailed, match="exit code"):
            await pool.start()

    asyncio.run(check())

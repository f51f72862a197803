"""The registry of jobs: its bounds in number, bytes and time, and who is told of changes."""

import asyncio
from collections.abc import Awaitable, Callable

import pytest
from starlette.responses import Response

from app.engine.base import Busy
from app.jobs import Job, JobLimits, JobNotFinished, JobNotFound, Jobs, Work
from app.kept_answer import SMALL_BYTES, KeptAnswer
from app.problems import refusal_of, response_for
from services.errors import NoText
from services.progress import ProgressSink


class Clock:
    """Time that passes when a test says so."""

    def __init__(self) -> None:
        self.now_s = 100.0

    def __call__(self) -> float:
        return self.now_s


class Gate:
    """Work that waits until it is let through, then answers with a body of `size` bytes."""

    def __init__(self, size: int = 3) -> None:
        self.open = asyncio.Event()
        self.size = size
        self.was_cancelled = False

    async def work(self, progress: ProgressSink | None) -> Response:
        assert progress is not None
        progress("text", 0.5)
        try:
            await self.open.wait()
        except asyncio.CancelledError:
            self.was_cancelled = True
            raise
        return Response(b"x" * self.size, 201, {"Document-Kind": "planar"}, "image/jpeg")


def tell(error: Exception) -> Response:
    return response_for(refusal_of(error), "the request")


def answering(size: int = 3) -> Work:
    async def work(progress: ProgressSink | None) -> Response:
        return Response(b"x" * size)

    return work


async def finished(jobs: Jobs, work: Work, owner: str | None = None) -> Job:
    job = jobs.start(work, owner, tell)
    await job.wait()
    return job


async def is_closed(answer: KeptAnswer) -> bool:
    try:
        await answer.response()
    except ValueError:
        return True
    return False


def run(check: Callable[[], Awaitable[None]]) -> None:
    async def bounded() -> None:
        async with asyncio.timeout(10):
            await check()

    asyncio.run(bounded())


@pytest.mark.parametrize("size", [3, SMALL_BYTES + 1])
def test_an_answer_comes_back_as_it_was(size: int) -> None:
    async def check() -> None:
        jobs, gate = Jobs(JobLimits()), Gate(size)
        job = jobs.start(gate.work, None, tell)
        assert (job.state, job.started) == ("queued", None)
        with pytest.raises(JobNotFinished, match="queued"):
            await jobs.answer(job)
        await asyncio.sleep(0)
        assert (job.state, job.stage, job.progress) == ("running", "text", 0.5)
        assert job.started is not None
        gate.open.set()
        await job.wait()
        assert jobs.find(job.id, None) is job
        assert (job.state, job.progress, job.problem) == ("succeeded", 1.0, None)
        answers = await asyncio.gather(jobs.answer(job), jobs.answer(job))
        for answer in answers:
            assert (answer.status_code, answer.body) == (201, b"x" * size)
            assert answer.headers["document-kind"] == "planar"
            assert answer.headers["content-type"] == "image/jpeg"
            assert answer.headers["content-length"] == str(size)
        await jobs.close()

    run(check)


def test_a_failure_is_told_as_the_problem_that_it_is() -> None:
    async def fail(progress: ProgressSink | None) -> Response:
        raise NoText("nothing to read")

    async def check() -> None:
        jobs = Jobs(JobLimits())
        job = await finished(jobs, fail)
        assert (job.state, job.progress) == ("failed", 0.0)
        assert job.problem is not None
        assert (job.problem["code"], job.problem["request_id"]) == ("no-text", "the request")
        assert (await jobs.answer(job)).status_code == job.problem["status"]

    run(check)


def test_jobs_expire() -> None:
    async def check() -> None:
        clock = Clock()
        jobs = Jobs(JobLimits(ttl_s=60.0), clock)
        running = jobs.start(Gate().work, None, tell)
        job = await finished(jobs, answering())
        clock.now_s += 59
        assert jobs.find(job.id, None) is job
        clock.now_s += 1
        with pytest.raises(JobNotFound, match="JOB_TTL_S"):
            jobs.find(job.id, None)
        assert jobs.find(running.id, None) is running
        await jobs.close()
        assert running.state == "failed"
        assert running.problem is not None
        assert running.problem["code"] == "shutting-down"

    run(check)


def test_what_expires_is_dropped_though_nobody_asks() -> None:
    async def check() -> None:
        jobs = Jobs(JobLimits(ttl_s=0.02))
        job = await finished(jobs, answering(SMALL_BYTES + 1))
        assert job.answer is not None
        while not await is_closed(job.answer):
            await asyncio.sleep(0.005)
        await jobs.close()

    run(check)


def test_the_oldest_that_are_over_leave_first() -> None:
    async def check() -> None:
        jobs, gate = Jobs(JobLimits(max_jobs=3)), Gate()
        running = jobs.start(gate.work, None, tell)
        first, second = await finished(jobs, answering()), await finished(jobs, answering())
        third = await finished(jobs, answering())
        with pytest.raises(JobNotFound):
            jobs.find(first.id, None)
        assert all(jobs.find(job.id, None) is job for job in (running, second, third))
        await jobs.close()

    run(check)


def test_unfinished_jobs_make_no_room() -> None:
    async def check() -> None:
        jobs, gate = Jobs(JobLimits(max_jobs=2)), Gate()
        held = [jobs.start(gate.work, None, tell) for _ in range(2)]
        with pytest.raises(Busy, match="MAX_JOBS"):
            jobs.start(gate.work, None, tell)
        gate.open.set()
        for job in held:
            await job.wait()
        await finished(jobs, answering())
        await jobs.close()

    run(check)


def test_results_are_bounded_together_and_each() -> None:
    async def check() -> None:
        jobs = Jobs(JobLimits(max_result_bytes=100_000))
        first, second = await finished(jobs, answering(70_000)), await finished(jobs, answering(30_000))
        assert jobs.find(first.id, None) is first
        third = await finished(jobs, answering(1))
        with pytest.raises(JobNotFound):
            jobs.find(first.id, None)
        assert len((await jobs.answer(second)).body) == 30_000
        large = await finished(jobs, answering(100_001))
        assert large.problem is not None
        assert large.problem["code"] == "too-large"
        assert "MAX_JOB_RESULT_BYTES" in large.problem["detail"]
        assert jobs.find(third.id, None) is third
        await jobs.close()

    run(check)


def test_cancelling_stops_the_work_and_may_be_repeated() -> None:
    async def check() -> None:
        jobs, gate = Jobs(JobLimits()), Gate()
        job = jobs.start(gate.work, None, tell)
        await asyncio.sleep(0)
        await asyncio.gather(jobs.cancel(job), jobs.cancel(job))
        await jobs.cancel(job)
        assert gate.was_cancelled
        assert (job.state, (await jobs.answer(job)).status_code) == ("cancelled", 410)
        done = await finished(jobs, answering())
        await jobs.cancel(done)
        assert done.state == "succeeded"
        await jobs.close()

    run(check)


def test_a_job_is_nobody_elses() -> None:
    async def check() -> None:
        jobs = Jobs(JobLimits())
        job = await finished(jobs, answering(), "key")
        for stranger in (None, "other"):
            with pytest.raises(JobNotFound):
                jobs.find(job.id, stranger)
        assert jobs.find(job.id, "key") is job
        assert len({Job(None).id for _ in range(100)}) == 100
        await jobs.close()

    run(check)


def test_progress_never_goes_back_and_ends_with_the_job() -> None:
    job = Job(None)
    job.report("text", 0.5)
    job.report("text again", 0.25)
    assert (job.stage, job.progress) == ("text again", 0.5)
    job.end("succeeded")
    job.report("late", 0.75)
    assert (job.stage, job.progress, job.state) == ("text again", 1.0, "succeeded")


def test_who_follows_hears_changes_and_the_end() -> None:
    async def check() -> None:
        jobs, gate = Jobs(JobLimits(heartbeat_s=0.01)), Gate()
        job = jobs.start(gate.work, None, tell)
        heard: list[tuple[bool, str, float]] = []
        async for has_changed in jobs.follow(job):
            heard.append((has_changed, job.state, job.progress))
            if not has_changed:
                gate.open.set()
        assert [report for report in heard if report[0]] == [
            (True, "queued", 0.0),
            (True, "running", 0.5),
            (True, "succeeded", 1.0),
        ]
        assert (False, "running", 0.5) in heard
        assert [has_changed async for has_changed in jobs.follow(job)] == [True]
        await jobs.close()

    run(check)


def test_listeners_are_bounded() -> None:
    jobs = Jobs(JobLimits(max_listeners=1))
    jobs.enter_listener()
    with pytest.raises(Busy, match="MAX_JOB_LISTENERS"):
        jobs.enter_listener()
    jobs.leave_listener()
    jobs.enter_listener()

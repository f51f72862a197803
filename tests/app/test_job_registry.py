"""Jobs, as routes see them: who is told of changes, and what becomes of blobs without a job."""

import asyncio
import os
from collections.abc import Awaitable, Callable
from contextlib import AsyncExitStack
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from starlette.responses import Response

from app.blobs import FOLDER, BlobAccess
from app.engine.base import Busy
from app.jobs.registry import JobLimits, Jobs
from app.jobs.running import JobRunner, RunLimits
from app.jobs.stored_request import JobRun
from app.layout_store import LayoutStore, ResultLimits
from app.problems import refusal_of, response_for
from models.errors import StoreUnavailable
from models.job_records import JobBounds, JobDraft, StoredJob, blob_key

ROOM = JobBounds(9, 9, 1 << 30)
Do = Callable[[JobRun], Awaitable[Response]]


def tell(error: Exception, request_id: str) -> Response:
    return response_for(refusal_of(error), request_id)


class Service:
    """Jobs of a store and a runner, without HTTP; `do` answers every job."""

    def __init__(self, folder: Path, do: Do, limits: JobLimits | None = None, **run: float) -> None:
        self.store = LayoutStore(folder, ResultLimits(100, 100, 100, 100))
        self.blobs = BlobAccess("", folder)
        self.jobs = Jobs(self.store, self.blobs, limits or JobLimits())

        async def answer(request: dict[str, object], body: object, run: JobRun) -> Response:
            return await do(run)

        self.runner = JobRunner(self.store, self.blobs, answer, tell, RunLimits(100, 1000, **run))  # type: ignore[arg-type]
        self.jobs.abandon = self.runner.abandon

    async def add(self, id: str = "a") -> StoredJob:
        draft = JobDraft(id, None, "rectify", {"request_id": "the request", "headers": {}}, None, 0)
        job, _ = await self.store.call(lambda store: store.add_job(draft, ROOM))
        return job

    async def job(self, id: str = "a") -> StoredJob:
        return await self.store.call(lambda store: store.job(id))


def run(service: Service, check: Callable[[], Awaitable[None]]) -> None:
    async def bounded() -> None:
        async with asyncio.timeout(30), AsyncExitStack() as stack:
            await stack.enter_async_context(service.store.opened())
            await service.blobs.open()
            stack.push_async_callback(service.blobs.close)
            service.runner.start()
            stack.push_async_callback(service.runner.stop)
            await check()

    asyncio.run(bounded())


async def done(run: JobRun) -> Response:
    return Response(b"x" * 10, 201, {"Document-Kind": "planar"}, "image/jpeg")


class Gate:
    """Work that waits until it is let through."""

    def __init__(self) -> None:
        self.open = asyncio.Event()
        self.begun = asyncio.Event()
        self.was_cancelled = False

    async def do(self, run: JobRun) -> Response:
        run.report("text", 0.5)
        self.begun.set()
        try:
            await self.open.wait()
        except asyncio.CancelledError:
            self.was_cancelled = True
            raise
        return await done(run)


def test_an_answer_comes_back_as_it_was(tmp_path: Path) -> None:
    service = Service(tmp_path, done)

    async def check() -> None:
        await service.add()
        assert await service.runner.run_one()
        assert not await service.runner.run_one()
        answer = await service.jobs.answer(await service.job())
        assert (answer.status_code, answer.body, answer.headers["document-kind"]) == (
            201,
            b"x" * 10,
            "planar",
        )

    run(service, check)


def test_followers_hear_of_the_end(tmp_path: Path) -> None:
    gate = Gate()
    service = Service(tmp_path, gate.do, JobLimits(heartbeat_s=0.3))

    async def check() -> None:
        job = await service.add()
        heard: list[StoredJob | None] = []

        async def listen() -> None:
            async for each in service.jobs.follow(job):
                heard.append(each)

        listeners = [asyncio.create_task(listen()) for _ in range(2)]
        working = asyncio.create_task(service.runner.run_one())
        while None not in heard:
            await asyncio.sleep(0.01)
        gate.open.set()
        await asyncio.gather(working, *listeners)
        states = [each.state for each in heard if each is not None]
        assert (states.count("queued"), states.count("succeeded")) == (2, 2)
        assert "text" in {each.stage for each in heard if each is not None}

    run(service, check)


def test_a_cancelled_job_stops_where_it_runs(tmp_path: Path) -> None:
    """The first one in this process; the second one elsewhere, where nobody but the lease says so."""
    gates = [Gate(), Gate()]
    service = Service(tmp_path, gates[0].do, renew_every_s=0.1)
    elsewhere = Service(tmp_path, gates[1].do, renew_every_s=0.1)
    elsewhere.store, elsewhere.jobs = service.store, service.jobs

    async def check() -> None:
        for gate, runner in zip(gates, (service.runner, elsewhere.runner), strict=True):
            runner._store = service.store
            job = await service.add(str(gates.index(gate)))
            working = asyncio.create_task(runner.run_one())
            await gate.begun.wait()
            if runner is elsewhere.runner:
                runner.start()
            await service.jobs.cancel(job, tell(Busy("cancelled"), "the request"))
            await working
            assert gate.was_cancelled
            assert (await service.job(job.id)).state == "cancelled"
        await elsewhere.runner.stop()
        assert elsewhere.runner.leases_lost == 1

    run(service, check)


def test_what_the_service_could_not_run_is_handed_back(tmp_path: Path) -> None:
    errors = [Busy("no worker"), StoreUnavailable("away")]

    async def do(run: JobRun) -> Response:
        if errors:
            raise errors.pop()
        return await done(run)

    service = Service(tmp_path, do, hand_back_s=0.0)

    async def check() -> None:
        await service.add()
        states = []
        for _ in range(3):
            assert await service.runner.run_one()
            states.append((await service.job()).state)
        assert states == ["queued", "queued", "succeeded"]
        assert (await service.job()).attempts == 1

    run(service, check)


def test_an_upload_that_is_gone_ends_its_job(tmp_path: Path) -> None:
    service = Service(tmp_path, done)

    async def check() -> None:
        async def read(request: dict[str, object], body: object, run: JobRun) -> Response:
            async for _ in body:  # type: ignore[attr-defined]
                pass
            return await done(run)

        service.runner._do = read  # type: ignore[assignment]
        draft = JobDraft("a", None, "rectify", {"request_id": "r", "headers": {}}, "jobs/a/input", 3)
        await service.store.call(lambda store: store.add_job(draft, ROOM))
        await service.runner.run_one()
        job = await service.job()
        assert (job.state, (job.problem or {})["code"]) == ("failed", "store-unavailable")

    run(service, check)


def test_a_job_that_a_stop_interrupts_is_handed_back(tmp_path: Path) -> None:
    gate = Gate()
    service = Service(tmp_path, gate.do)

    async def check() -> None:
        await service.add()
        working = asyncio.create_task(service.runner.run_one())
        await gate.begun.wait()
        working.cancel()
        await asyncio.gather(working, return_exceptions=True)
        job = await service.job()
        assert (job.state, job.attempts) == ("queued", 0)

    run(service, check)


def test_blobs_without_a_job_are_swept(tmp_path: Path) -> None:
    service = Service(tmp_path, done)

    async def check() -> None:
        await service.add("kept")
        old_s = (datetime.now(UTC) - timedelta(hours=2)).timestamp()
        for id in ("kept", "lost", "new"):
            await service.blobs.put(blob_key(id, "input"), b"x", 1)
            if id != "new":
                os.utime(tmp_path / FOLDER / blob_key(id, "input"), (old_s, old_s))
        assert await service.jobs.sweep_blobs() == 1
        assert sorted(path.name for path in (tmp_path / FOLDER / "jobs").iterdir()) == ["kept", "new"]

    run(service, check)


def test_listeners_are_bounded(tmp_path: Path) -> None:
    jobs = Service(tmp_path, done, JobLimits(max_listeners=1)).jobs
    jobs.enter_listener()
    with pytest.raises(Busy):
        jobs.enter_listener()
    jobs.leave_listener()
    jobs.enter_listener()

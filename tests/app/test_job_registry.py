"""Jobs, as routes see them: who is told of changes, and what becomes of blobs without a job."""

import asyncio
import os
from collections.abc import Awaitable, Callable
from contextlib import AsyncExitStack
from datetime import UTC, datetime, timedelta
from pathlib import Path
from unittest.mock import AsyncMock

import pytest
from psutil import Process
from starlette.responses import Response

from app.engine.base import Busy
from app.http.problems import refusal_of, response_for
from app.jobs import dispatch, following
from app.jobs.registry import JobLimits, Jobs, JobWork
from app.jobs.running import JobRunner, RunLimits
from app.jobs.stored_request import JobRun
from app.storage.blobs import FOLDER, BlobAccess
from app.storage.layout_store import LayoutStore, ResultLimits
from models.errors import StoreUnavailable
from models.job_records import JobBounds, JobDraft, StoredJob, blob_key
from models.repository import Store
from tests.models.job_requests import RECTIFY

ROOM = JobBounds(9, 9, 1 << 30)
Do = Callable[[JobRun], Awaitable[Response]]


def tell(error: Exception, request_id: str) -> Response:
    return response_for(refusal_of(error), request_id)


class Service:
    """Jobs of a store and a runner, without HTTP; `do` answers every job."""

    def __init__(self, folder: Path, do: Do, limits: JobLimits | None = None, **run: float) -> None:
        self.store = LayoutStore(folder, ResultLimits(100, 100, 100, 100))
        self.blobs = BlobAccess("", folder)

        async def answer(request: dict[str, object], body: object, run: JobRun) -> Response:
            return await do(run)

        self.runner = JobRunner(self.store, self.blobs, answer, tell, RunLimits(100, 1000, **run))  # type: ignore[arg-type]
        work = JobWork(abandon=self.runner.abandon)
        self.jobs = Jobs(self.store, self.blobs, limits or JobLimits(), work)

    async def add(self, id: str = "a") -> StoredJob:
        draft = JobDraft(id, None, "rectify", RECTIFY, None, 0)
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
            async for each in service.jobs.followers.follow(job):
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
        followers = service.jobs.followers
        assert (followers._followed, followers._revisions) == (
            {},
            {},
        )  # nothing is kept of whom nobody follows

    run(service, check)


def test_followers_are_told_without_a_look(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(following, "POLL_WHEN_NOTIFIED_S", 3600.0)
    service = Service(tmp_path, done)
    followers = service.jobs.followers

    async def check() -> None:
        job = await service.add()
        looks = asyncio.Queue[int]()
        read = Store.job_revisions

        def count(store: Store, ids: list[str]) -> dict[str, int]:
            looks.put_nowait(len(ids))
            return read(store, ids)

        monkeypatch.setattr(Store, "job_revisions", count)
        followers.expect(is_notified=True)
        heard = followers.follow(job)
        assert await anext(heard) is job
        next_one = asyncio.ensure_future(anext(heard))
        assert await looks.get() == 1  # one look, for what happened before somebody followed
        await service.store.call(lambda store: store.claim_job(60))
        followers.hear("another job", 7)
        assert not next_one.done()
        followers.hear(job.id, 1)
        running = await next_one
        assert (running and running.state, looks.empty()) == ("running", True)

        # A look that has begun before takes nothing back; a connection that breaks is a reason to look.
        next_one = asyncio.ensure_future(anext(heard))
        followers._note(job.id, 0)
        followers.expect(is_notified=False)
        await looks.get()
        assert not next_one.done()
        await service.jobs.cancel(job, tell(Busy("cancelled"), "the request"))
        ended = await next_one
        assert ended
        assert ended.state == "cancelled"

    run(service, check)


def test_an_upload_stays_where_it_is_not_known_whether_its_job_was_stored(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A connection may break when the commit is done. The job that is there needs its upload."""
    service = Service(tmp_path, done)
    add = Store.add_job

    def add_and_break(*arguments: object) -> None:
        add(*arguments)  # type: ignore[arg-type]
        raise StoreUnavailable("the connection is lost")

    async def check() -> None:
        description = {"request_id": "r", "headers": {}}

        async def store() -> None:
            await service.jobs.store_job(description, iter([b"photo"]), 5, None, "rectify")

        monkeypatch.setattr(Store, "add_job", add_and_break)
        with pytest.raises(StoreUnavailable):
            await store()
        monkeypatch.setattr(Store, "add_job", add)
        lease = await service.store.call(lambda store: store.claim_job(60))
        assert lease
        assert lease.job.input_key
        assert await service.blobs.get(lease.job.input_key) == b"photo"

        service.jobs._limits = JobLimits(max_jobs=1)
        with pytest.raises(Busy):
            await store()
        assert (
            len(list((tmp_path / FOLDER / "jobs").iterdir())) == 1
        )  # of a job that is refused nothing stays

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
        draft = JobDraft("a", None, "rectify", RECTIFY, "jobs/a/input", 3)
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


def test_freed_memory_goes_back_to_the_system(monkeypatch: pytest.MonkeyPatch) -> None:
    """What threads have freed stays in the heap of each of them, wherever a later block holds its end."""
    monkeypatch.setattr(dispatch, "OFTEN_S", 0.05)
    size_bytes, blocks = 100_000, 600
    kept: list[bytes] = []

    def use_memory() -> None:
        used = [b"x" * size_bytes for _ in range(blocks)]
        kept.extend(used[::30])

    async def check() -> None:
        await asyncio.to_thread(use_memory)
        before = Process().memory_info().rss
        housekeeping = dispatch.Housekeeping(AsyncMock(), AsyncMock(), AsyncMock())
        housekeeping.start()
        async with asyncio.timeout(30):
            while Process().memory_info().rss > before - size_bytes * blocks // 2:
                await asyncio.sleep(0.01)
        await housekeeping.stop()

    asyncio.run(check())


def test_listeners_are_bounded(tmp_path: Path) -> None:
    followers = Service(tmp_path, done, JobLimits(max_listeners=1)).jobs.followers
    followers.enter()
    with pytest.raises(Busy):
        followers.enter()
    followers.leave()
    followers.enter()

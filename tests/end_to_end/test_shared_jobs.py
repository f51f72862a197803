"""Jobs of processes that share PostgreSQL: accepted by one, run by another one, never lost or answered twice."""

import asyncio
import os
import signal
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from unittest.mock import Mock

import httpx
import psycopg
import pytest

from app.jobs import changes
from app.jobs.queue import QUEUE, QueueDispatch, _make_tables
from benchmarks.common.postgresql import Cluster, running_cluster
from models.job_records import JobBounds, JobDraft, JobEnd
from models.repository import Store
from tests.app.scripts import upload
from tests.end_to_end.processes import SCRIPTED, Service, running
from tests.end_to_end.test_durable_jobs import LEASE_S, accept, until
from tests.models.databases import KINDS
from tests.models.job_requests import RECTIFY

pytestmark = pytest.mark.skipif("postgresql" not in KINDS, reason="PostgreSQL is not installed")


@pytest.fixture(scope="module")
def cluster() -> Iterator[Cluster]:
    with running_cluster() as cluster:
        yield cluster


class Shared:
    """Services on one database and one folder of blobs."""

    def __init__(self, stack: ExitStack, cluster: Cluster, folder: Path) -> None:
        self.stack = stack
        self.url = cluster.make_database()
        self.settings: dict[str, object] = {
            "database_url": self.url,
            "data_dir": folder,
            "job_lease_s": LEASE_S,
            "shutdown_grace_s": 5,
        }

    def start(self, *arguments: str, workers: int = 1, **settings: object) -> Service:
        made = running(SCRIPTED, *arguments, workers=workers, **{**self.settings, **settings})
        return self.stack.enter_context(made)

    def tickets(self) -> int:
        with psycopg.connect(self.url) as connection:
            sql = "SELECT count(*) FROM procrastinate_jobs WHERE queue_name = %s"
            (count,) = connection.execute(sql, (QUEUE,)).fetchone() or (0,)
            return int(count)


@pytest.fixture
def shared(cluster: Cluster, tmp_path: Path) -> Iterator[Shared]:
    with ExitStack() as stack:
        yield Shared(stack, cluster, tmp_path / "data")


def kill(service: Service) -> None:
    for process in service.descendants():
        process.kill()
    os.kill(service.process.pid, signal.SIGKILL)
    service.process.wait(10)


def test_a_ticket_comes_with_its_job_and_changes_are_told(
    shared: Shared, cluster: Cluster, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By the connection that stores the job; the listener connects again when its connection breaks."""
    monkeypatch.setattr(changes, "RESTART_PAUSE_S", 0.01)
    dispatch = QueueDispatch(shared.url, Mock(), 0)
    news = asyncio.Queue[object]()

    class Heard:
        def expect(self, *, is_notified: bool) -> None:
            news.put_nowait(is_notified)

        def hear(self, job_id: str, revision: int) -> None:
            news.put_nowait((job_id, revision))

    async def check(store: Store) -> None:
        listener = changes.ChangeListener(shared.url, Heard())  # type: ignore[arg-type]
        listener.start()
        assert await news.get() is True
        draft = JobDraft("a" * 32, None, "rectify", RECTIFY, None, 0)
        store.add_job(draft, JobBounds(9, 9, 9), partial(dispatch.enlist, draft.id))
        assert shared.tickets() == 1
        lease = store.claim_job(60)
        assert await news.get() == (draft.id, 1)
        with cluster.connect("postgres") as connection:
            connection.execute(
                "SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE query LIKE 'LISTEN%%'"
            )
        assert [await news.get() for _ in range(2)] == [False, True]
        assert lease
        assert store.end_job(draft.id, lease.token, JobEnd("succeeded"), 60)
        assert await news.get() == (draft.id, 2)
        await listener.stop()
        assert await news.get() is False

    _make_tables(shared.url)
    with Store.open(shared.url) as store:
        asyncio.run(asyncio.wait_for(check(store), 30))


def test_an_api_without_workers_answers_by_those_of_others(shared: Shared, tmp_path: Path) -> None:
    api = shared.start(workers=0)
    ready = httpx.get(f"{api.url}/health/ready")
    assert (ready.status_code, ready.json()["code"]) == (503, "not-ready")
    worker, other = shared.start("worker"), shared.start(workers=0)
    ready = httpx.get(f"{api.url}/health/ready")
    assert (ready.status_code, ready.json()["queue"], ready.json()["job_runners"]) == (200, "ready", 1)

    later = accept(api, "")
    assert until(other, later)["state"] == "succeeded"
    for service in (api, other):  # the request waits for its answer, or asks for it
        now = httpx.post(f"{service.url}/rectify", files={"image": upload("")})
        answer = httpx.get(service.url + later + "/result")
        assert (
            (now.status_code, now.content) == (answer.status_code, answer.content) == (200, b"flat as jpeg")
        )
    refused = httpx.post(f"{api.url}/rectify", files={"image": upload("no-text")})
    assert (refused.status_code, refused.json()["code"]) == (422, "no-text")
    assert httpx.post(f"{api.url}/rectify").status_code == 400

    # Cancelled at one service, stopped at another one.
    gate = tmp_path / "gate"
    gate.mkdir()
    path = accept(api, f"wait {gate}")
    until(other, path, "running")
    begin_s = time.monotonic()
    assert httpx.delete(other.url + path).status_code == 204
    assert httpx.get(api.url + path).json()["state"] == "cancelled"
    assert until(api, accept(api, ""))["state"] == "succeeded"  # the only worker is free again
    assert time.monotonic() - begin_s < 10
    assert worker.process.poll() is None

    deadline = time.monotonic() + 10
    while shared.tickets():
        assert time.monotonic() < deadline
        time.sleep(0.1)


def test_a_worker_with_other_blobs_is_the_operator_s_fault(shared: Shared, tmp_path: Path) -> None:
    worker = shared.start("worker", data_dir=tmp_path / "other")
    api = shared.start(workers=0)
    refused = httpx.post(f"{api.url}/rectify", files={"image": upload("")}, timeout=20)
    assert (refused.status_code, refused.json()["code"]) == (503, "store-unavailable")
    deadline = time.monotonic() + 20
    while httpx.get(f"{api.url}/health/ready").json().get("blobs") != "not-shared":
        assert time.monotonic() < deadline
        time.sleep(0.05)
    assert any("BLOB_URL" in line["message"] for line in api.lines)
    assert worker.process.poll() is None


def test_jobs_of_a_killed_worker_and_a_killed_api_are_done(shared: Shared, tmp_path: Path) -> None:
    gate = tmp_path / "gate"
    gate.mkdir()
    api, worker = shared.start(workers=0), shared.start("worker")
    running_job = accept(api, f"wait {gate}")
    until(api, running_job, "running")
    queued = accept(api, "")
    kill(worker)
    kill(api)
    (gate / "go").touch()
    begin_s = time.monotonic()
    shared.start("worker")
    api = shared.start(workers=0)
    jobs = [until(api, path) for path in (running_job, queued)]
    assert [(job["state"], job["attempts"]) for job in jobs] == [("succeeded", 2), ("succeeded", 1)]
    assert time.monotonic() - begin_s < 40  # both processes start in this time too


def test_work_goes_on_when_the_database_was_away(shared: Shared, cluster: Cluster) -> None:
    api = shared.start(workers=1, store_timeout_s=1)
    paths = [accept(api, "sleep 0.2") for _ in range(3)]
    with cluster.hung():
        refused = httpx.post(
            f"{api.url}/rectify", files={"image": upload("")}, headers={"Prefer": "respond-async"}, timeout=30
        )
        assert (refused.status_code, refused.json()["code"]) == (503, "store-unavailable")
        assert httpx.get(f"{api.url}/health/live").status_code == 200
        assert httpx.get(f"{api.url}/health/ready", timeout=3).json()["store"] == "unavailable"
    for path in paths:
        assert until(api, path)["state"] == "succeeded"


def test_work_goes_on_when_the_database_was_gone_for_longer_than_a_lease(
    shared: Shared, cluster: Cluster, tmp_path: Path
) -> None:
    """What was accepted before is done after it; requests meanwhile are told that the store is unavailable."""
    api = shared.start(workers=1, store_timeout_s=1)
    running_job = accept(api, f"wait {tmp_path}")
    queued = [accept(api, "") for _ in range(2)]
    until(api, running_job, "running")
    with cluster.away():
        (tmp_path / "go").touch()
        begin_s = time.monotonic()
        while time.monotonic() - begin_s < 2 * LEASE_S:
            refused = httpx.post(
                f"{api.url}/rectify",
                files={"image": upload("")},
                headers={"Prefer": "respond-async"},
                timeout=30,
            )
            assert (refused.status_code, refused.json()["code"]) == (503, "store-unavailable")
            assert httpx.get(f"{api.url}/health/live").status_code == 200
            time.sleep(0.2)
    jobs = [until(api, path) for path in (running_job, *queued)]
    assert [job["state"] for job in jobs] == ["succeeded"] * 3
    assert httpx.get(f"{api.url}{running_job}/result").content == b"flat as jpeg"


def test_a_request_is_not_starved_by_jobs_and_keys_take_turns(shared: Shared, tmp_path: Path) -> None:
    api = shared.start(workers=0, api_keys="many:a,few:b", max_jobs=100, max_jobs_per_key=8)
    shared.start("worker", api_keys="many:a,few:b")
    url, many, few = api.url + "/rectify", {"X-API-Key": "a"}, {"X-API-Key": "b"}
    later = {"Prefer": "respond-async"}

    def send(headers: dict[str, str], script: str) -> httpx.Response:
        return httpx.post(url, files={"image": upload(script)}, headers=headers, timeout=60)

    def end(headers: dict[str, str], path: str) -> str:
        deadline = time.monotonic() + 60
        while (job := httpx.get(api.url + path, headers=headers).json())["state"] != "succeeded":
            assert time.monotonic() < deadline, job
            time.sleep(0.1)
        return str(job["ended"])

    # The only worker is busy while the queue fills.
    paths = [send({**many, **later}, f"wait {tmp_path}").headers["location"]]
    paths += [send({**many, **later}, "").headers["location"] for _ in range(7)]
    full = send({**many, **later}, "")
    assert (full.status_code, full.json()["code"]) == (503, "busy")
    assert "MAX_JOBS_PER_KEY" in full.json()["detail"]
    assert int(full.headers["retry-after"]) > 0
    own = send({**few, **later}, "").headers["location"]
    with ThreadPoolExecutor(1) as threads:
        waiting = threads.submit(send, few, "")
        (tmp_path / "go").touch()
        assert waiting.result().status_code == 200
    ends = [end(many, path) for path in paths]
    own_end = end(few, own)
    assert sum(each < own_end for each in ends) <= 3

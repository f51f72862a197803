"""Jobs as rows: each is taken by one worker at a time, ended once, and bounded in number and bytes."""

import threading
from dataclasses import replace
from datetime import timedelta
from itertools import count, pairwise
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import event

from models.errors import JobKeyReused, NoSuchJob, QueueFull, StoreUnavailable
from models.job_records import JobBounds, JobDraft, JobEnd, Lease, Progress, StoredJob, blob_key
from models.job_repository import MOST_RETURNS
from models.repository import Store
from tests.models.conftest import Clock
from tests.models.job_requests import RECTIFY

ROOM = JobBounds(1000, 1000, 1 << 40)
DONE = JobEnd("succeeded", {"status": 200, "headers": []}, "jobs/x/answer", 10)
DIED = JobEnd("failed", {"status": 500, "headers": []}, problem={"code": "worker-died"})
LEASE_S = 60.0
_numbers = count(1)


def draft(owner: str | None = None, **changes: object) -> JobDraft:
    job_id = f"{next(_numbers):032x}"
    made = JobDraft(job_id, owner, "rectify", RECTIFY, blob_key(job_id, "input"), 100)
    return replace(made, **changes)  # type: ignore[arg-type]


def add(store: Store, owner: str | None = None, **changes: object) -> str:
    job, is_new = store.add_job(draft(owner, **changes), ROOM)
    assert is_new
    return job.id


def claim(store: Store) -> Lease:
    lease = store.claim_job(LEASE_S)
    assert lease is not None
    return lease


def died(job: StoredJob) -> JobEnd:
    return DIED


def test_a_job_is_run_by_one_worker_and_ended_once(store: Store) -> None:
    id = add(store, "me")
    assert store.job(id).state == "queued"
    lease = claim(store)
    assert (lease.job.id, lease.job.state, lease.job.attempts) == (id, "running", 1)
    assert store.claim_job(LEASE_S) is None
    assert not store.end_job(id, "another token", DONE, 100)
    assert store.end_job(id, lease.token, DONE, 100)
    assert not store.end_job(id, lease.token, replace(DONE, state="failed"), 100)
    assert not store.end_job(id, None, replace(DONE, state="cancelled"), 100)
    job = store.job(id)
    assert (job.state, job.progress, job.answer, job.answer_key) == (
        "succeeded",
        1.0,
        DONE.answer,
        DONE.answer_key,
    )
    assert job.started_at is not None
    assert job.ended_at is not None
    assert job.created_at < job.started_at < job.ended_at


def test_progress_never_decreases_and_renews_the_lease(store: Store, clock: Clock) -> None:
    id, lease = add(store), claim(store)
    seen = [store.job(id).revision]
    for stage, progress in (("text", 0.5), ("text", 0.5), (None, 0.2), ("shape", 0.6)):
        clock.now += timedelta(seconds=LEASE_S / 2)
        assert store.renew_leases([Progress(id, lease.token, stage, progress)], LEASE_S) == set()
        seen.append(store.job(id).revision)
    job = store.job(id)
    assert (job.stage, job.progress) == ("shape", 0.6)
    assert [later - earlier for earlier, later in pairwise(seen)] == [1, 0, 0, 1]
    assert store.settle_stalled_jobs(2, died, 100, 1000) == (0, 0)
    assert store.renew_leases([Progress(id, "another token", "text", 1.0)], LEASE_S) == {id}


def test_a_job_of_a_dead_worker_is_tried_twice(store: Store, clock: Clock) -> None:
    id, tokens = add(store), []
    for expected in ((1, 0), (0, 1)):
        tokens.append(claim(store).token)
        assert store.settle_stalled_jobs(2, died, 100, 1000) == (0, 0)
        clock.now += timedelta(seconds=LEASE_S)
        assert store.settle_stalled_jobs(2, died, 100, 1000) == expected
        # The dead worker was only slow: it comes too late.
        assert not store.end_job(id, tokens[-1], DONE, 100)
        assert store.renew_leases([Progress(id, tokens[-1], None, 0)], LEASE_S) == {id}
    job = store.job(id)
    assert (job.state, job.attempts, job.problem) == ("failed", 2, DIED.problem)
    assert store.claim_job(LEASE_S) is None


def test_what_is_handed_back_is_no_attempt_for_a_while(store: Store) -> None:
    id = add(store)
    for _ in range(MOST_RETURNS):
        lease = claim(store)
        assert lease.job.attempts == 1
        assert store.return_job(id, lease.token, 0, is_attempt=False)
        assert not store.return_job(id, lease.token, 0, is_attempt=False)
    assert store.return_job(id, claim(store).token, 0, is_attempt=False)
    assert claim(store).job.attempts == 2


def test_a_job_that_is_handed_back_waits(store: Store, clock: Clock) -> None:
    id = add(store)
    assert store.return_job(id, claim(store).token, 30, is_attempt=True)
    assert store.claim_job(LEASE_S) is None
    clock.now += timedelta(seconds=30)
    assert claim(store).job.attempts == 2


def test_a_cancelled_job_is_lost_to_its_worker(store: Store) -> None:
    id, lease = add(store), claim(store)
    assert store.end_job(id, None, JobEnd("cancelled", problem={"code": "cancelled"}), 100)
    assert store.renew_leases([Progress(id, lease.token, None, 0.5)], LEASE_S) == {id}
    assert not store.end_job(id, lease.token, DONE, 100)
    assert store.job(id).state == "cancelled"


def test_owners_take_turns(store: Store) -> None:
    """One owner has a long queue; another one who comes later does not wait for its end."""
    many = [add(store, "many") for _ in range(6)]
    few = [add(store, "few") for _ in range(2)]
    order = []
    for _ in range(8):
        lease = claim(store)
        order.append(lease.job.id)
        store.end_job(lease.job.id, lease.token, DONE, 100)
    assert order == [many[0], few[0], many[1], few[1], *many[2:]]


def test_an_owner_with_fewer_running_jobs_is_first(store: Store) -> None:
    for _ in range(3):
        add(store, "many")
    assert [claim(store).job.owner for _ in range(2)] == ["many", "many"]
    add(store, None)
    assert claim(store).job.owner is None


def test_a_waiting_request_is_before_jobs(store: Store) -> None:
    add(store, "other")
    add(store, "me")
    first = add(store, "me", priority=1)
    assert claim(store).job.id == first


@pytest.mark.parametrize(
    ("bounds", "setting"),
    [
        (JobBounds(2, 9, 999), "MAX_JOBS)"),
        (JobBounds(9, 2, 999), "MAX_JOBS_PER_KEY"),
        (JobBounds(9, 9, 299), "MAX_JOB_INPUT_BYTES"),
    ],
)
def test_the_queue_is_bounded(store: Store, bounds: JobBounds, setting: str) -> None:
    first, second = (store.add_job(draft("me"), bounds)[0].id for _ in range(2))
    for attempt in (
        lambda: store.add_job(draft("me"), bounds),
        lambda: store.require_queue_room(bounds, "me", 100),
    ):
        with pytest.raises(QueueFull, match=setting.replace(")", r"\)")):
            attempt()
    lease = claim(store)
    assert lease.job.id == first
    store.end_job(first, lease.token, DONE, 100)
    store.require_queue_room(bounds, "me", 100)
    assert store.add_job(draft("me"), bounds)[1]
    assert store.queue_status().queued == 2
    assert second


def test_a_repeated_request_gets_its_job(store: Store, clock: Clock) -> None:
    first = add(store, repeat_key="k", digest="d")
    again, is_new = store.add_job(draft(repeat_key="k", digest="d"), ROOM)
    assert (again.id, is_new) == (first, False)
    found = store.repeated_job("k", "d")
    assert found is not None
    assert found.id == first
    for attempt in (
        lambda: store.add_job(draft(repeat_key="k", digest="other"), ROOM),
        lambda: store.repeated_job("k", "other"),
    ):
        with pytest.raises(JobKeyReused):
            attempt()
    store.end_job(first, None, DONE, 100)
    clock.now += timedelta(seconds=200)
    assert store.repeated_job("k", "other") is None
    assert store.add_job(draft(repeat_key="k", digest="other"), ROOM)[1]


def test_what_is_kept_of_finished_jobs_is_bounded(store: Store, clock: Clock) -> None:
    ids = [add(store) for _ in range(5)]
    for id in ids[:4]:
        store.end_job(id, claim(store).token, replace(DONE, answer_key=blob_key(id, "answer")), 1000)
    assert store.purge_jobs(99, 99) == []
    assert store.purge_jobs(4, 99) == [blob_key(ids[0], "input"), blob_key(ids[0], "answer")]
    assert store.purge_jobs(99, 20) == [blob_key(ids[1], "input"), blob_key(ids[1], "answer")]
    assert store.delete_job(ids[2]) == [blob_key(ids[2], "input"), blob_key(ids[2], "answer")]
    assert store.delete_job(ids[4]) == []  # it has not ended
    clock.now += timedelta(seconds=2000)
    with pytest.raises(NoSuchJob):
        store.job(ids[3])
    assert len(store.purge_jobs(99, 99)) == 2
    assert [store.has_job(id) for id in ids] == [False] * 4 + [True]


def test_jobs_that_stay_are_not_read(store: Store) -> None:
    """Every process looks for what may be deleted every few seconds, among thousands of jobs that stay."""
    id = add(store)
    store.end_job(id, claim(store).token, DONE, 1000)
    statements: list[str] = []

    @event.listens_for(store._readers, "before_cursor_execute")
    def note(_: object, __: object, statement: str, *others: object) -> None:
        statements.append(statement)

    assert store.purge_jobs(99, 99) == []
    assert any("count(*)" in each for each in statements)
    assert not any("jobs.request" in each for each in statements)


def test_what_comes_with_a_job_is_stored_with_it_or_not_at_all(store: Store) -> None:
    """As the ticket of the queue is."""

    def count_jobs(connection: Any) -> None:
        seen.append(connection.execute("SELECT count(*) FROM jobs").fetchone()[0])
        if len(seen) == 2:
            raise StoreUnavailable("the queue is away")

    seen: list[int] = []
    made = draft(repeat_key="k", digest="d")
    assert store.add_job(made, ROOM, count_jobs)[1]
    other = draft()
    with pytest.raises(StoreUnavailable):
        store.add_job(other, ROOM, count_jobs)
    assert not store.has_job(other.id)
    assert not store.add_job(draft(repeat_key="k", digest="d"), ROOM, count_jobs)[1]  # nothing comes with it
    assert seen == [1, 2]


def test_the_queue_tells_its_depth_and_age(store: Store) -> None:
    assert store.queue_status().oldest_s == 0
    ids = [add(store) for _ in range(3)]
    claim(store)
    status = store.queue_status()
    assert (status.queued, status.running, status.input_bytes) == (2, 1, 300)
    assert status.oldest_s > 0
    revisions = store.job_revisions([*ids, "none"])
    assert revisions == {ids[0]: 1, ids[1]: 0, ids[2]: 0}


def test_many_workers_take_every_job_once(where: Path | str) -> None:
    with Store.open(where) as store:
        ids = {add(store, f"owner {number % 3}") for number in range(40)}
        taken: list[str] = []

        def work() -> None:
            while (lease := store.claim_job(LEASE_S)) is not None:
                taken.append(lease.job.id)
                assert store.end_job(lease.job.id, lease.token, DONE, 100)

        threads = [threading.Thread(target=work) for _ in range(8)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        left = store.queue_status().queued
    # Where rows that others hold are skipped, a worker may find none and leave early.
    assert len(taken) == len(set(taken)) == len(ids) - left

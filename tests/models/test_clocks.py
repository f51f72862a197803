"""A clock that ran ahead and was corrected: nothing waits until its times have come, and order is that of arrival."""

from collections.abc import Iterator
from datetime import timedelta
from pathlib import Path

import pytest

from models.errors import Claimed
from models.job_records import MOST_CALLBACK_WAIT_S, JobBounds, JobDraft, JobEnd, StoredJob
from models.records import ReviewDraft, UnknownPageDraft
from models.repository import Store
from tests.models.feedback_drafts import change, draft
from tests.models.job_requests import RECTIFY
from tests.models.test_reviews import NOW, Clock

DAY = timedelta(days=1)
ROOM = JobBounds(1000, 1000, 1 << 30)
DONE = JobEnd("succeeded", {"status": 200, "headers": []}, None, 0)


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def store(where: Path | str, clock: Clock) -> Iterator[Store]:
    with Store.open(where, clock=clock) as store:
        yield store


def ahead(clock: Clock) -> None:
    clock.now = NOW + DAY


def corrected(clock: Clock) -> None:
    clock.now = NOW + timedelta(seconds=5)


def job(id: str, owner: str | None = None, callback_url: str | None = None) -> JobDraft:
    return JobDraft(id, owner, "rectify", RECTIFY, None, 10, callback_url=callback_url)


def died(job: StoredJob) -> JobEnd:
    return DONE


def page(store: Store, n: int = 1) -> str:
    return store.add_result(
        {"result": {}, "n": n}, 10 * 86400, review=ReviewDraft(n, 0.5, "letter", 3, "review")
    )


def test_a_job_that_was_accepted_then_starts(store: Store, clock: Clock) -> None:
    ahead(clock)
    store.add_job(job("first"), ROOM)
    corrected(clock)
    store.add_job(job("second"), ROOM)
    claimed = [store.claim_job(60) for _ in range(3)]
    assert [each and each.job.id for each in claimed] == ["first", "second", None]


def test_a_job_that_was_handed_back_then_starts(store: Store, clock: Clock) -> None:
    store.add_job(job("first"), ROOM)
    ahead(clock)
    lease = store.claim_job(60)
    assert lease is not None
    assert store.return_job("first", lease.token, 30, is_attempt=False)
    corrected(clock)
    assert store.claim_job(60) is not None


def test_a_job_that_was_leased_then_is_tried_again(store: Store, clock: Clock) -> None:
    store.add_job(job("first"), ROOM)
    ahead(clock)
    assert store.claim_job(60) is not None
    corrected(clock)
    assert store.settle_stalled_jobs(2, died, 60, 60) == (1, 0)


def test_leases_of_machines_whose_clocks_differ_a_little_hold(store: Store, clock: Clock) -> None:
    store.add_job(job("first"), ROOM)
    clock.now = NOW + timedelta(seconds=30)
    assert store.claim_job(60) is not None
    clock.now = NOW
    assert store.settle_stalled_jobs(2, died, 60, 60) == (0, 0)


def test_an_owner_whose_job_started_then_gets_his_turn(store: Store, clock: Clock) -> None:
    store.add_job(job("a1", "anna"), ROOM)
    ahead(clock)
    lease = store.claim_job(60)
    assert lease is not None
    store.end_job("a1", lease.token, DONE, 10 * 86400)
    corrected(clock)
    order = []
    for number in range(4):
        clock.now += timedelta(seconds=1)
        store.add_job(job(f"anna {number}", "anna"), ROOM)
        store.add_job(job(f"ben {number}", "ben"), ROOM)
    for _ in range(4):
        clock.now += timedelta(seconds=1)
        lease = store.claim_job(60)
        assert lease is not None
        store.end_job(lease.job.id, lease.token, DONE, 60)
        order.append(lease.job.owner)
    assert sorted(order[:2]) == sorted(order[2:]) == ["anna", "ben"]


def test_a_callback_of_a_job_that_ended_then_is_sent(store: Store, clock: Clock) -> None:
    store.add_job(job("first", callback_url="https://example.org/"), ROOM)
    ahead(clock)
    store.end_job("first", None, DONE, 10 * 86400)
    corrected(clock)
    assert store.claim_callback(60) is not None
    assert store.claim_callback(MOST_CALLBACK_WAIT_S) is None


def test_jobs_that_ended_then_give_way_first(store: Store, clock: Clock) -> None:
    for id, move in (("then", ahead), ("now", corrected)):
        move(clock)
        store.add_job(job(id), ROOM)
        store.end_job(id, None, DONE, 10 * 86400)
    store.purge_jobs(1, 1 << 30)
    assert not store.has_job("then")
    assert store.has_job("now")


def test_a_claim_of_then_has_ended(store: Store, clock: Clock) -> None:
    claimed = page(store)
    ahead(clock)
    claim, _ = store.claim_review(claimed, "anna", 600, None)
    with pytest.raises(Claimed):
        store.claim_review(claimed, "ben", 600, None)
    corrected(clock)
    assert store.reviews(1)[0].claimed_by is None
    store.add_version("letter", {}, "import")
    assert store.claim_review(claimed, "ben", 600, None)[0] != claim
    with pytest.raises(Claimed):
        store.claim_review(claimed, "anna", 600, claim)


@pytest.mark.parametrize("is_restarted", [False, True])
def test_new_results_are_the_newest(
    where: Path | str, store: Store, clock: Clock, *, is_restarted: bool
) -> None:
    """Also for another process: ids of results say in which order these came."""
    ahead(clock)
    old = [page(store, n) for n in (1, 2)]
    corrected(clock)
    if is_restarted:
        with Store.open(where, clock=clock) as other:
            new = page(other, 3)
    else:
        new = page(store, 3)
    assert [each.id for each in store.reviews(3)] == [new, *reversed(old)]
    store.purge_results(keep_newest=1)
    assert store.kept_results([*old, new]) == {new}


def test_new_feedback_and_unknown_pages_are_the_newest(where: Path | str, store: Store, clock: Clock) -> None:
    store.add_version("letter", {"n": 1}, "import")
    unknown = UnknownPageDraft({"n": 1}, bound=1, ttl_s=10 * 86400)
    ahead(clock)
    first = store.add_feedback(draft(page(store), "first"), [change("letter", 1)], max_samples=1)
    store.add_result({}, 10 * 86400, unknown)
    corrected(clock)
    with Store.open(where, clock=clock) as other:
        second = other.add_feedback(draft(page(other), "second"), [change("letter", 2)], max_samples=1)
        result = other.add_result({}, 10 * 86400, unknown)
    assert [each.id for each in store.feedbacks("letter")] == [second.id, first.id]
    assert [each.id for each in store.samples("letter")] == [second.sample_id]
    assert [each.result_id for each in store.each_unknown_page()] == [result]


def test_samples_after_a_version_are_those_that_came_after_it(store: Store, clock: Clock) -> None:
    before = store.add_sample("letter", {"n": 1}).id
    ahead(clock)
    store.add_version("letter", {"n": 1}, "initialize")
    corrected(clock)
    after = store.add_sample("letter", {"n": 2}).id
    by_feedback = store.add_feedback(draft(page(store)), [change("letter", 1)]).sample_id
    assert store.samples_after("letter", 1) == [after, by_feedback]
    assert store.samples_after("letter", 2) == []  # a feedback's sample is one of its own version
    assert store.delete_samples_after("letter", 1) == 2
    assert [each.id for each in store.samples("letter")] == [before]


def test_what_a_class_learned_from_is_taken_back_by_versions(store: Store, clock: Clock) -> None:
    """A version that was made from a sample contains it, though its time is before that of the sample."""
    store.add_sample("letter", {"n": 1})
    result = page(store)
    ahead(clock)
    store.add_feedback(draft(result), [])
    corrected(clock)
    store.add_version("letter", {"n": 1}, "initialize")
    [past] = store.pasts(result)
    assert past.base is None
    assert past.steps is not None
    assert [step.version for step in past.steps] == [1]


def test_cameras_of_then_are_forgotten_first(store: Store, clock: Clock) -> None:
    ahead(clock)
    for number in range(50):
        store.remember_cameras(None, {f"camera {number}": [(0.1, 0.1)]})
    corrected(clock)
    store.remember_cameras(None, {"new": [(0.1, 0.1)]})
    assert "new" in {memory.name for memory, _ in store.cameras(None)}


def test_who_was_present_then_is_there_no_longer(store: Store, clock: Clock) -> None:
    ahead(clock)
    store.show_presence("process", "then", 60)
    corrected(clock)
    assert store.show_presence("process", "now", 60) == []

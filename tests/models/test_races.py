"""Many clients at once, on two stores that share a database: no page twice, no write lost, none fails."""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import count
from pathlib import Path
from threading import Barrier
from typing import Any

import pytest

from models.errors import Claimed, QueueFull, StoreError, StoreFull, StoreUnavailable, VersionConflict
from models.feedback_records import ModelChange, ModelUndo
from models.job_records import JobBounds, JobDraft, JobEnd
from models.records import ReviewDraft
from models.repository import Store
from services.contract.cameras import MOST_PHOTOS
from tests.counts import repeats
from tests.models.feedback_drafts import draft
from tests.models.job_requests import RECTIFY

pytestmark = pytest.mark.long

CLIENTS = repeats(10, 20)
ROUNDS = repeats(5, 200)
ROOM = JobBounds(1000, 1000, 1 << 30)
DONE = JobEnd("succeeded", {"status": 200, "headers": []}, None, 0)
CANCELLED = JobEnd("cancelled", None, None, 0, {"code": "cancelled"})
_numbers = count(1)

Work = Callable[[Store], Any]


class Clients:
    """Clients of two stores, which start together."""

    def __init__(self, stores: Sequence[Store]) -> None:
        self._stores = stores
        self._barrier = Barrier(CLIENTS)
        self._threads = ThreadPoolExecutor(CLIENTS)

    def all_at_once(self, work: Callable[[int], Work]) -> list[Any]:
        """What each client got: a value, or the refusal. Raises where the store could not be used."""

        def one(number: int) -> Any:
            self._barrier.wait(60)
            try:
                return work(number)(self._stores[number % len(self._stores)])
            except StoreUnavailable:
                raise
            except StoreError as refusal:
                return refusal

        return list(self._threads.map(one, range(CLIENTS)))


@pytest.fixture
def stores(where: Path | str) -> Iterator[tuple[Store, Store]]:
    with Store.open(where, busy_timeout_s=60) as one, Store.open(where, busy_timeout_s=60) as other:
        yield one, other


@pytest.fixture
def clients(stores: tuple[Store, Store]) -> Clients:
    return Clients(stores)


@pytest.fixture
def store(stores: tuple[Store, Store]) -> Store:
    return stores[0]


def page(store: Store) -> str:
    return store.add_result({"result": {}}, 3600, review=ReviewDraft(1, 0.5, "letter", 3, "review"))


def of_kind(kind: type, outcomes: Sequence[Any]) -> int:
    return sum(isinstance(each, kind) for each in outcomes)


def test_a_page_is_claimed_by_one_person(store: Store, clients: Clients) -> None:
    for _ in range(ROUNDS):
        free = page(store)
        got = clients.all_at_once(
            lambda n, free=free: lambda store: store.claim_review(free, f"client {n}", 60, None)  # type: ignore[misc]
        )
        [winner] = [n for n, each in enumerate(got) if isinstance(each, tuple)]
        assert of_kind(Claimed, got) == CLIENTS - 1
        [review] = store.reviews(1)
        assert (review.id, review.claimed_by) == (free, f"client {winner}")


def test_a_page_is_claimed_or_skipped(store: Store, clients: Clients) -> None:
    """Who skips without a claim may do so before the page is claimed; nobody claims a skipped page."""
    for _ in range(ROUNDS):
        free = page(store)

        def work(n: int, free: str = free) -> Work:
            if n % 2:
                return lambda store: store.release_review(free, None, skip=True)
            return lambda store: store.claim_review(free, f"client {n}", 60, None)

        got = clients.all_at_once(work)
        claims = [each for each in got[::2] if isinstance(each, tuple)]
        skips = [each for each in got[1::2] if each is None]
        assert len(claims) + of_kind(Claimed, got) + len(skips) == CLIENTS
        [review] = [each for each in store.reviews(CLIENTS * ROUNDS) if each.id == free]
        assert review.state == ("skipped" if skips else "open")
        assert len(claims) == (0 if skips else 1)
        assert (review.claimed_by is None) == bool(skips)


def learn(result_id: str, name: str, request: str) -> Work:
    """Feedback as the service gives it: what earlier feedback on the result taught is taken back first."""

    def work(store: Store) -> str:
        while True:
            try:
                seen = store.feedback_ids(result_id)
                undone = without(store, result_id) if seen else []
                model = store.model(name)
                documents = {each.name: each.document for each in undone}
                lessons = (documents.get(name) or model.document)["lessons"]
                change = ModelChange(name, {"lessons": [*lessons, result_id]}, model.version)
                feedback = draft(
                    result_id, request, verified=name, found=None, sample=f"{result_id} {request}"
                )
                store.add_feedback(feedback, [change], undone=undone, seen=seen)
                return name
            except VersionConflict:
                continue

    return work


def without(store: Store, result_id: str) -> list[ModelUndo]:
    """The models without the lessons on a result."""
    undone = []
    for past in store.pasts(result_id):
        document = store.any_version(past.name, past.current or 0).document or {}
        lessons = [each for each in document["lessons"] if each != result_id]
        undone.append(ModelUndo(past.name, {"lessons": lessons}, past.current, past.superseded, True))
    return undone


def forget(result_id: str) -> Work:
    def work(store: Store) -> None:
        while True:
            try:
                seen = store.feedback_ids(result_id)
                store.undo_feedback(result_id, without(store, result_id), seen)
                return
            except VersionConflict:
                continue

    return work


@pytest.mark.parametrize("with_undo", [False, True], ids=["feedback", "feedback and undo"])
def test_of_feedback_on_one_page_the_last_one_counts(
    store: Store, clients: Clients, *, with_undo: bool
) -> None:
    """A page is in one model: that of its last feedback. Where all of it was taken back, it is in none."""
    names = ("letter", "memo", "fax", "note")
    for name in names:
        store.add_version(name, {"lessons": []}, "import")
    for _ in range(repeats(1, 200)):
        result = page(store)

        def work(n: int, result: str = result) -> Work:
            if with_undo and n % 3 == 0:
                return forget(result)
            return learn(result, names[n % len(names)], f"{n}")

        clients.all_at_once(work)
        taught = [name for name in names if result in (store.model(name).document or {})["lessons"]]
        learned = [(store.model(name).document or {})["lessons"].count(result) for name in taught]
        feedback = [
            (each.id, each.verified_class)
            for name in names
            for each in store.feedbacks(name, newest=CLIENTS)
            if each.result_id == result
        ]
        assert taught == ([max(feedback)[1]] if feedback else [])
        assert learned == [1] * len(taught)
        if not with_undo:
            assert len(feedback) == CLIENTS
        samples = [each for name in names for each in store.samples(name) if each.result_id == result]
        assert len(samples) == len(taught)


def test_no_lesson_of_different_pages_is_lost(store: Store, clients: Clients) -> None:
    store.add_version("letter", {"lessons": []}, "import")
    for _ in range(repeats(1, 200)):
        results = [page(store) for _ in range(CLIENTS)]
        clients.all_at_once(lambda n, results=results: learn(results[n], "letter", "right"))  # type: ignore[misc]
        assert set(results) <= set((store.model("letter").document or {})["lessons"])


def test_a_class_is_deleted_with_all_that_comes_meanwhile(store: Store, clients: Clients) -> None:
    """Samples that come first go with the class; those that come later make it anew."""
    for _ in range(ROUNDS):
        store.add_version("letter", {"lessons": []}, "import")
        store.add_sample("letter", {"n": -1})

        def work(n: int) -> Work:
            if n == 7:
                return lambda store: store.delete_model("letter")
            return lambda store: store.add_sample("letter", {"n": n})

        got = clients.all_at_once(work)
        assert of_kind(StoreError, got) == 0
        there = {each.name for each in store.models()} & {"letter"}
        kept = {each.id for name in there for each in store.samples(name)}
        assert kept <= {each.id for n, each in enumerate(got) if n != 7}
        if there:
            assert store.model("letter").version is None
            store.delete_model("letter")


def test_limits_hold(store: Store, clients: Clients) -> None:
    """Of samples, classes, and jobs of one key and of all: as many are taken as there is room for."""
    for number in range(ROUNDS):
        name = f"class {number}"
        got = clients.all_at_once(
            lambda n, name=name: lambda store: store.add_sample(name, {"n": n}, max_samples=3)  # type: ignore[misc]
        )
        assert (of_kind(StoreFull, got), store.sample_count(name)) == (CLIENTS - 3, 3)
        most = number + 3
        got = clients.all_at_once(
            lambda n, number=number, most=most: (  # type: ignore[misc]
                lambda store: store.add_version(f"{number}-{n}", {}, "import", max_models=most)
            )
        )
        assert (of_kind(StoreFull, got), len(store.models())) == (CLIENTS - 2, most)
        for each in store.models():
            if each.name.startswith(f"{number}-"):
                store.delete_model(each.name)


def job(owner: str | None = None, **more: Any) -> JobDraft:
    return JobDraft(f"{next(_numbers):032x}", owner, "rectify", RECTIFY, None, 10, **more)


def test_no_more_jobs_are_accepted_than_there_is_room_for(store: Store, clients: Clients) -> None:
    bounds = JobBounds(1000, 3, 1 << 30)
    for number in range(ROUNDS):
        owner = f"owner {number}"
        got = clients.all_at_once(
            lambda n, owner=owner: lambda store: store.add_job(job(owner), bounds)  # type: ignore[misc]
        )
        assert of_kind(QueueFull, got) == CLIENTS - 3
        for each in got:
            if isinstance(each, tuple):
                store.end_job(each[0].id, None, CANCELLED, 60)


def test_a_repeated_request_is_one_job(store: Store, clients: Clients) -> None:
    for number in range(ROUNDS):
        key = f"key {number}"
        got = clients.all_at_once(
            lambda n, key=key: lambda store: store.add_job(job(repeat_key=key, digest="d"), ROOM)  # type: ignore[misc]
        )
        assert len({found.id for found, _ in got}) == 1
        assert sum(is_new for _, is_new in got) == 1


def test_a_job_is_run_once_and_ended_once(store: Store, clients: Clients) -> None:
    for _ in range(ROUNDS):
        made = [store.add_job(job(), ROOM)[0].id for _ in range(CLIENTS // 2)]
        leases = [each for each in clients.all_at_once(lambda n: lambda store: store.claim_job(60)) if each]
        # A free slot may be refused by what others are about to take; it asks again.
        while (more := store.claim_job(60)) is not None:
            leases.append(more)
        assert sorted(each.job.id for each in leases) == sorted(made)

        def end(n: int, leases: list[Any] = leases) -> Work:
            lease = leases[n // 2]
            token = lease.token if n % 2 else None
            return lambda store: store.end_job(lease.job.id, token, DONE if n % 2 else CANCELLED, 60)

        ended = clients.all_at_once(end)
        assert [a + b for a, b in zip(ended[::2], ended[1::2], strict=True)] == [1] * len(made)
        states = ["cancelled" if cancelled else "succeeded" for cancelled in ended[::2]]
        assert [store.job(lease.job.id).state for lease in leases] == states
        store.purge_jobs(0, 0)


def test_what_all_have_seen_of_a_camera_is_kept(store: Store, clients: Clients) -> None:
    seen = min(CLIENTS, MOST_PHOTOS)
    for number in range(ROUNDS):
        name = f"camera {number}"
        clients.all_at_once(
            lambda n, name=name: lambda store: store.remember_cameras(None, {name: [(n / 100, 0.1)]})  # type: ignore[misc]
        )
        [memory] = [memory for memory, _ in store.cameras(None) if memory.name == name]
        assert memory.photos == seen

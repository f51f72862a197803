"""The review queue of the store: orders, cursors, claims, states that follow from feedback."""

import time
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from models.errors import Claimed, ResultNotFound
from models.records import ReviewDraft
from models.repository import Store, cursor_of
from tests.models.databases import make_file
from tests.models.feedback_drafts import change, draft

NOW = datetime(2026, 11, 22, tzinfo=UTC)


class Clock:
    """A clock that a test moves."""

    def __init__(self) -> None:
        self.now = NOW

    def __call__(self) -> datetime:
        return self.now


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def store(tmp_path: Path, clock: Clock):
    with Store.open(make_file(tmp_path / "store.sqlite3"), clock=clock) as opened:
        yield opened


def place(gain: float, confidence: float = 0.5) -> ReviewDraft:
    return ReviewDraft(gain, confidence, "letter", 3, "review")


def add(store: Store, gain: float, confidence: float = 0.5, owner: str | None = None) -> str:
    return store.add_result({"result": {}}, 3600, None, owner, place(gain, confidence))


@pytest.mark.parametrize("order", ["gain", "confidence", "newest"])
def test_parts_of_a_list_make_the_whole_list(store: Store, order: str) -> None:
    added = [add(store, gain=index % 4, confidence=(index % 3) / 3) for index in range(11)]
    whole = [review.id for review in store.reviews(100, order=order)]
    parts: list[str] = []
    after = None
    while found := store.reviews(3, order=order, after=after):
        parts += [review.id for review in found]
        after = cursor_of(found[-1], order)
    assert parts == whole
    assert sorted(whole) == sorted(added)


def test_the_largest_gain_and_the_least_confidence_come_first(store: Store) -> None:
    low, high = add(store, 0.1, 0.2), add(store, 2.5, 0.9)
    assert [review.id for review in store.reviews(9, order="gain")] == [high, low]
    assert [review.id for review in store.reviews(9, order="confidence")] == [low, high]


def test_two_people_never_have_the_same_page(store: Store, clock: Clock) -> None:
    page = add(store, 1)
    claim, until = store.claim_review(page, "anna", 60, None)
    assert until == NOW + timedelta(seconds=60)
    with pytest.raises(Claimed):
        store.claim_review(page, "ben", 60, None)
    with pytest.raises(Claimed):
        store.release_review(page, "guess", skip=True)
    assert store.reviews(1)[0].claimed_by == "anna"
    clock.now += timedelta(seconds=30)
    assert store.claim_review(page, "anna", 60, claim) == (claim, clock.now + timedelta(seconds=60))
    clock.now += timedelta(seconds=61)
    assert store.reviews(1)[0].claimed_by is None
    assert store.claim_review(page, "ben", 60, None)[0] != claim


@pytest.mark.parametrize("is_skipped", [True, False])
def test_a_page_that_is_done_is_claimed_on_purpose_only(store: Store, is_skipped: bool) -> None:
    store.add_version("letter", {"nodes": []}, "import")
    page = add(store, 1)
    claim, _ = store.claim_review(page, "anna", 60, None)
    if is_skipped:
        store.release_review(page, claim, skip=True)
    else:
        store.add_feedback(draft(page), [])
    assert store.reviews(1)[0].claimed_by is None
    for sent in (None, claim):
        with pytest.raises(Claimed):
            store.claim_review(page, "ben", 60, sent)
    again, until = store.claim_review(page, "ben", 60, None, reopen=True)
    assert store.claim_review(page, "ben", 60, again) == (again, until)  # who has it renews it
    with pytest.raises(Claimed):
        store.claim_review(page, "anna", 60, None, reopen=True)


@pytest.mark.parametrize("skip", [True, False])
def test_a_claim_that_is_sent_must_be_the_claim_of_the_page(store: Store, clock: Clock, skip: bool) -> None:
    page = add(store, 1)
    with pytest.raises(Claimed):
        store.release_review(page, "guess", skip=skip)
    claim, _ = store.claim_review(page, "anna", 60, None)
    clock.now += timedelta(seconds=61)
    with pytest.raises(Claimed):
        store.release_review(page, claim, skip=skip)
    assert store.reviews(1)[0].state == "open"
    store.release_review(page, None, skip=skip)  # without a claim, nobody has it


def test_states_follow_from_feedback(store: Store) -> None:
    store.add_version("letter", {"nodes": []}, "import")
    pages = [add(store, 1) for _ in range(4)]
    store.add_feedback(draft(pages[0], wrong=0), [change("letter", 1)])
    store.add_feedback(draft(pages[1], wrong=2, request="other"), [change("letter", 2)])
    store.release_review(pages[2], None, skip=True)
    states = {review.id: review.state for review in store.reviews(9)}
    assert [states[page] for page in pages] == ["confirmed", "corrected", "skipped", "open"]
    for state, page in zip(("confirmed", "corrected", "skipped", "open"), pages, strict=True):
        assert [review.id for review in store.reviews(9, state=state)] == [page]


def test_the_queue_forgets_what_the_store_forgets(store: Store, clock: Clock) -> None:
    page, other = add(store, 1), add(store, 1, owner="anna")
    assert [review.id for review in store.reviews(9, owner="anna")] == [other]
    store.delete_result(page)
    with pytest.raises(ResultNotFound):
        store.claim_review(page, None, 60, None)
    clock.now += timedelta(hours=2)
    assert store.reviews(9) == []
    store.purge_results()
    with pytest.raises(ResultNotFound):
        store.release_review(other, None)


def test_a_part_of_10_000_results_is_read_soon(store: Store) -> None:
    pages = [store.add_document({}, [_page(index, at) for at in range(100)], 3600)[1] for index in range(100)]
    assert sum(map(len, pages)) == 10_000
    after = cursor_of(store.reviews(5000, state="open", order="gain")[-1], "gain")
    began = time.process_time()
    assert len(store.reviews(50, state="open", order="gain", after=after)) == 50
    assert time.process_time() - began < 0.5


def _page(index: int, at: int):
    from models.records import ResultDraft

    return ResultDraft({"result": {}}, review=place((index * 37 + at * 11) % 997))


def test_the_first_pages_of_a_class_that_learned_are_behind(store: Store) -> None:
    store.add_version("letter", {"nodes": []}, "import")
    pages = [
        store.add_result(
            {"result": {}}, 3600, review=ReviewDraft(gain, 0.5, "letter", 3, decision, model_version=version)
        )
        for gain, decision, version in (
            (1, "review", 1),
            (2, "review", 1),
            (3, "review", 2),
            (4, "accept", 1),
            (5, "review", 1),
            (6, "review", None),
        )
    ]
    store.claim_review(pages[4], "anna", 60, None)
    assert list(store.reviews_behind("letter", 2, 9, 9)) == [pages[0], pages[1]]
    assert list(store.reviews_behind("letter", 2, 3, 9)) == [pages[1]]
    assert len(store.reviews_behind("letter", 2, 9, 1)) == 1
    assert not store.reviews_behind("letter", 1, 9, 9)
    store.place_reviews({pages[1]: place(0.5), pages[2]: place(0.25)}, 2)
    store.delete_result(pages[0])
    store.place_reviews({pages[0]: place(7)}, 2)
    assert not store.reviews_behind("letter", 2, 9, 9)
    gains = {review.id: review.gain for review in store.reviews(9)}
    assert (gains[pages[1]], gains[pages[2]]) == (0.5, 3)


def test_only_who_claimed_a_page_replaces_its_recognition(store: Store, clock: Clock) -> None:
    store.add_version("letter", {"nodes": []}, "import")
    page = add(store, 1)
    claim, _ = store.claim_review(page, "anna", 60, None)
    with pytest.raises(Claimed):
        store.replace_recognition(page, "guess", {"result": {}}, place(2))
    assert store.replace_recognition(page, claim, {"result": {"class": None}}, place(2))
    assert store.result(page).document == {"result": {"class": None}}
    assert store.reviews(1)[0].gain == 2
    store.add_feedback(draft(page), [change("letter", 1)])
    with pytest.raises(Claimed):  # feedback ends the claim
        store.replace_recognition(page, claim, {"result": {}}, place(3))
    claim, _ = store.claim_review(page, "anna", 60, None, reopen=True)
    assert not store.replace_recognition(page, claim, {"result": {}}, place(3))
    clock.now += timedelta(seconds=61)
    store.release_review(page, None)
    with pytest.raises(Claimed):
        store.replace_recognition(page, claim, {"result": {}}, place(3))
    assert store.result(page).document == {"result": {"class": None}}

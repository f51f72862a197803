"""What the store promises about results: pages, and documents with their pages."""

import contextlib
import itertools
from dataclasses import replace
from datetime import timedelta
from itertools import islice
from threading import get_ident
from typing import Any

import pytest
from sqlalchemy.orm import Session

from models.errors import ResultNotFound, StoreUnavailable
from models.records import ResultDraft, UnknownPageDraft
from models.repository import Store
from tests.models.conftest import Clock
from tests.models.feedback_drafts import draft
from tests.models.whole_database import everything


def test_results_expire(store: Store, clock: Clock) -> None:
    short, long = store.add_result({"n": 1}, ttl_s=10), store.add_result({"n": 2}, ttl_s=1000)
    assert store.result(short).document == {"n": 1}
    assert store.result(long).expires_at - store.result(long).created_at == timedelta(seconds=1000)
    clock.now += timedelta(seconds=20)
    with pytest.raises(ResultNotFound):
        store.result(short)
    assert store.result(long).document == {"n": 2}
    assert store.purge_results() == 1
    assert store.purge_results(now=clock.now + timedelta(days=1)) == 1
    with pytest.raises(ResultNotFound):
        store.result(long)


def page_drafts(count: int) -> list[ResultDraft]:
    return [ResultDraft({"page": n}, UnknownPageDraft({"n": n}, bound=9, ttl_s=10)) for n in range(count)]


def test_a_document_and_its_pages_are_kept_together(store: Store, clock: Clock) -> None:
    document_id, page_ids = store.add_document({"class": "letter"}, page_drafts(3), ttl_s=1000)
    kept = store.result(document_id)
    assert kept.document == {"class": "letter", "pages": page_ids}
    assert [(page.id, page.document) for page in kept.pages] == [
        (page_id, {"page": n, "in_document": document_id}) for n, page_id in enumerate(page_ids)
    ]
    assert kept.pages == tuple(map(store.result, page_ids))
    assert {page.expires_at for page in kept.pages} == {kept.expires_at}
    assert [page.result_id for page in store.each_unknown_page()] == page_ids
    clock.now = kept.expires_at - timedelta(seconds=1.5)
    assert len(store.result(document_id).pages) == 3  # a moment before all of it expires
    clock.now = kept.expires_at
    for result_id in (document_id, *page_ids):
        with pytest.raises(ResultNotFound):
            store.result(result_id)


@pytest.mark.parametrize("stage", range(1, 5))
def test_a_document_that_cannot_be_kept_leaves_no_page(
    store: Store, stage: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    flush, flushes, before, own = Session.flush, itertools.count(1), everything(store), get_ident()

    def flush_and_fail(session: Session, objects: Any = None) -> None:
        flush(session, objects)
        if get_ident() == own and next(flushes) == stage:
            raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(Session, "flush", flush_and_fail)
        with pytest.raises(StoreUnavailable):
            store.add_document({}, page_drafts(3), ttl_s=1000)
    assert everything(store) == before


@pytest.mark.parametrize("keep", range(8))
def test_a_purge_leaves_no_document_without_its_pages(store: Store, keep: int) -> None:
    documents = [store.add_document({"n": n}, page_drafts(3), ttl_s=1000)[0] for n in range(2)]
    store.purge_results(keep_newest=keep)
    there = 0
    for document_id in documents:
        with contextlib.suppress(ResultNotFound):
            assert len(store.result(document_id).pages) == 3
            there += 1
    assert there == keep // 4


def test_a_document_of_an_earlier_release_without_all_its_pages_is_not_there(store: Store) -> None:
    page = store.add_result({}, ttl_s=1000)
    document = store.add_result({"document": {}, "pages": [page]}, ttl_s=1000)
    assert [kept.id for kept in store.result(document).pages] == [page]
    store.purge_results(keep_newest=1)
    with pytest.raises(ResultNotFound, match=document):
        store.result(document)


def test_only_the_newest_results_are_kept(store: Store) -> None:
    ids = [store.add_result({"n": n}, ttl_s=1000) for n in range(10)]
    assert store.purge_results(keep_newest=10) == 0
    assert store.purge_results(keep_newest=3) == 7
    assert [store.result(result).document for result in ids[7:]] == [{"n": 7}, {"n": 8}, {"n": 9}]
    assert store.purge_results(keep_newest=0) == 3


def test_results_are_listed_newest_first_and_page_by_page(letters: Store, clock: Clock) -> None:
    """Every page of a result is listed once, whatever the limit, also after newer ones were added."""
    ids = []
    for number in range(7):
        clock.now += timedelta(seconds=1)
        ids.append(letters.add_result({"result": {"n": number}}, ttl_s=100, owner="ab"[number % 2]))
    letters.add_document({"class": "letter"}, [ResultDraft({"result": {"n": 7}})], ttl_s=100)
    assert [each.result["n"] for each in letters.each_result()] == [7, 6, 5, 4, 3, 2, 1, 0]
    assert [each.result["n"] for each in letters.each_result(owner="a")] == [6, 4, 2, 0]
    seen, before = [], ids[6]
    while listed := list(islice(letters.each_result(before=before), 2)):
        seen += [each.id for each in listed]
        before = listed[-1].id
        letters.add_result({"result": {"n": 99}}, ttl_s=100)
    assert seen == ids[5::-1]
    clock.now += timedelta(seconds=200)
    assert list(letters.each_result()) == []


def test_results_have_the_state_that_feedback_gave_them(letters: Store) -> None:
    ids = [letters.add_result({"result": {}}, ttl_s=100) for _ in range(5)]
    letters.add_feedback(draft(ids[0], "a", wrong=0), [])
    letters.add_feedback(draft(ids[1], "b", wrong=2), [])
    letters.add_feedback(replace(draft(ids[2], "c", wrong=0), letters=9, wrong_letters=1), [])
    letters.add_feedback(draft(ids[3], "d", wrong=0, found="memo"), [])
    states = ["confirmed", "corrected", "corrected", "corrected", "open"]
    assert [(each.id, each.state) for each in letters.each_result()][::-1] == list(
        zip(ids, states, strict=True)
    )
    for state in ("open", "confirmed", "corrected"):
        expected = [id for id, each in zip(ids, states, strict=True) if each == state]
        assert [each.id for each in letters.each_result(state=state)][::-1] == expected

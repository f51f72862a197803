"""What the store promises about feedback: each one counts once, and is kept whole or not at all."""

import dataclasses
import itertools
from collections.abc import Callable
from threading import get_ident
from typing import Any

import pytest
from sqlalchemy.orm import Session

from models.errors import KeyReused, ModelNotFound, NotStorable, StoreUnavailable, VersionConflict
from models.feedback_records import FeedbackDraft, ModelChange, ModelHealth, StoredFeedback
from models.records import UnknownPageDraft
from models.repository import Store
from models.ulid import is_ulid
from tests.models.feedback_drafts import change, draft
from tests.models.whole_database import everything


def as_stored(feedback: StoredFeedback) -> dict[str, Any]:
    """All of it but `created`."""
    return {
        field.name: getattr(feedback, field.name)
        for field in dataclasses.fields(feedback)
        if field.name != "created"
    }


def test_a_feedback_and_all_that_came_of_it_are_kept(letters: Store, result: str) -> None:
    revision = letters.revision()
    said = draft(result, found="memo", wrong=4)
    kept = letters.add_feedback(said, [change("letter"), change("memo", n=7)])
    assert kept.created
    assert is_ulid(kept.id)
    assert (kept.result_id, kept.request, kept.report) == (result, said.request, said.report)
    assert dict(kept.versions) == {"letter": (1, 2), "memo": (1, 2)}
    assert (letters.model("letter").document, letters.model("memo").document) == ({"n": 2}, {"n": 7})
    assert [version.origin for version in letters.model_versions("letter")] == ["import", "feedback"]
    assert letters.model_versions("memo")[-1].note == f"result {result}"
    (sample,) = letters.samples("letter")
    assert (sample.id, sample.document) == (kept.sample_id, said.sample)
    assert (sample.origin, sample.result_id) == ("feedback", result)
    assert letters.sample_count("memo") == 0
    assert letters.revision() > revision
    for name in ("letter", "memo"):
        (summary,) = letters.feedbacks(name)
        assert (summary.id, summary.result_id, summary.sample_id) == (kept.id, result, sample.id)
        assert (summary.found_class, summary.verified_class) == ("memo", "letter")
        assert (summary.zones, summary.wrong_zones) == (10, 4)
        assert (dict(summary.versions), summary.created_at) == (dict(kept.versions), kept.created_at)
    assert letters.feedbacks("fax") == []


def test_it_may_come_when_nothing_was_wrong_and_when_the_result_is_gone(letters: Store, result: str) -> None:
    letters.purge_results(keep_newest=0)
    before = letters.revision()
    kept = letters.add_feedback(draft(result, wrong=0), [])
    assert (dict(kept.versions), letters.model("letter").version) == ({}, 1)
    assert letters.sample_count("letter") == 1
    assert letters.revision() == before  # no model changed
    found = letters.find_feedback(result, None, kept.request)
    assert found is not None
    assert as_stored(found) == as_stored(kept)


def test_the_first_feedback_may_make_the_first_version(letters: Store, result: str) -> None:
    kept = letters.add_feedback(draft(result, verified="fax", found=None), [change("fax", expected=None)])
    assert dict(kept.versions) == {"fax": (None, 1)}
    assert (letters.model("fax").version, letters.model("fax").samples) == (1, 2)


@pytest.mark.parametrize(
    ("first", "again"), [("key", "key"), (None, None), ("key", None), (None, "key"), ("key", "another")]
)
def test_the_same_counts_once(letters: Store, result: str, first: str | None, again: str | None) -> None:
    kept = letters.add_feedback(draft(result, key=first), [change("letter")])
    said = draft(result, key=again)
    before = everything(letters) if first is not None or again is None else None
    found = letters.find_feedback(result, again, said.request)
    assert found is not None
    # It comes again with the version that the first one saw, as a client's retry does.
    for repeated in (found, letters.add_feedback(said, [change("letter")])):
        assert not repeated.created
        assert as_stored(repeated) == as_stored(kept)
        before = before or everything(
            letters
        )  # the key is bound to the body that came without one, nothing else
    assert everything(letters) == before


@pytest.mark.parametrize("call", ["find", "add"])
def test_a_key_that_comes_later_is_bound_to_the_body(letters: Store, result: str, call: str) -> None:
    kept, said = letters.add_feedback(draft(result), []), draft(result, key="key")
    again = (
        letters.add_feedback(said, [])
        if call == "add"
        else letters.find_feedback(result, "key", said.request)
    )
    assert again is not None
    assert as_stored(again) == as_stored(kept)
    with pytest.raises(KeyReused):
        letters.add_feedback(draft(result, "date", key="key"), [])
    other = draft(result, key="other key")  # of two keys of one body the first one is its own
    assert as_stored(letters.add_feedback(other, [])) == as_stored(kept)
    found = letters.find_feedback(result, "key", said.request)
    assert found is not None
    assert as_stored(found) == as_stored(kept)


def test_keys_are_of_one_body_and_one_result(letters: Store, result: str) -> None:
    other = letters.add_result({}, ttl_s=1000)
    letters.add_feedback(draft(result, key="key"), [change("letter")])
    before = everything(letters)
    for said in (draft(result, "date", key="key"), draft(other, key="key")):
        with pytest.raises(KeyReused):
            letters.find_feedback(said.result_id, "key", said.request)
        with pytest.raises(KeyReused):
            letters.add_feedback(said, [change("letter", 2)])
    assert everything(letters) == before
    assert letters.find_feedback(result, "fresh", draft(result, "date").request) is None
    assert letters.find_feedback(other, None, draft(other).request) is None
    assert letters.add_feedback(draft(other), [change("letter", 2)]).created


REFUSED: dict[str, tuple[type[Exception], Callable[[str], FeedbackDraft], list[ModelChange]]] = {
    "the second model is newer": (
        VersionConflict,
        lambda result: draft(result, found="memo"),
        [change("letter"), change("memo", 2)],
    ),
    "a version where none was expected": (VersionConflict, draft, [change("letter", None)]),
    "no version where one was expected": (
        VersionConflict,
        lambda r: draft(r, verified="fax"),
        [change("fax")],
    ),
    "no such model": (ModelNotFound, draft, [change("letter"), change("novel")]),
    "no such class": (ModelNotFound, lambda result: draft(result, verified="novel"), [change("letter")]),
    "the same model twice": (NotStorable, draft, [change("letter"), change("letter")]),
    "no number": (NotStorable, draft, [change("letter"), ModelChange("memo", {"n": float("nan")}, 1)]),
    "no sample": (NotStorable, lambda result: draft(result, sample={1}), [change("letter")]),
    "more wrong than there are": (NotStorable, lambda result: draft(result, wrong=11), [change("letter")]),
    "no key": (NotStorable, lambda result: draft(result, key=""), [change("letter")]),
    "no result": (NotStorable, lambda _: draft("\0"), [change("letter")]),
    "a name that cannot be": (NotStorable, lambda result: draft(result, found="\ud800"), [change("letter")]),
}


@pytest.mark.parametrize("why", REFUSED)
def test_what_is_refused_leaves_no_trace(letters: Store, result: str, why: str) -> None:
    error, said, changes = REFUSED[why]
    letters.add_feedback(draft(result, "earlier"), [])
    before = everything(letters)
    with pytest.raises(error):
        letters.add_feedback(said(result), changes)
    assert everything(letters) == before


@pytest.mark.parametrize("stage", range(1, 8))
def test_what_fails_in_the_middle_leaves_no_trace(
    letters: Store, result: str, stage: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The disk fails after the first, second, ... thing that is written."""
    letters.add_feedback(draft(result, "earlier"), [])
    letters.add_result({}, 1000, UnknownPageDraft({"page": 1}, bound=3, ttl_s=1000))
    before, flush, flushes, own = everything(letters), Session.flush, itertools.count(1), get_ident()

    def flush_and_fail(session: Session, objects: Any = None) -> None:
        flush(session, objects)
        # Services that other tests have left running write in threads of their own.
        if get_ident() == own and next(flushes) == stage:
            raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(Session, "flush", flush_and_fail)
        with pytest.raises(StoreUnavailable, match="No space left"):
            letters.add_feedback(draft(result, found="memo"), [change("letter"), change("memo")])
    assert everything(letters) == before


def test_another_body_replaces_the_sample(letters: Store, result: str) -> None:
    first = letters.add_feedback(draft(result, "sender"), [change("letter")])
    second = letters.add_feedback(draft(result, "date"), [change("letter", 2)])
    assert second.created
    (sample,) = letters.samples("letter")
    assert (sample.id, sample.document["label"]) == (second.sample_id, "date")
    assert first.sample_id != second.sample_id
    assert [feedback.sample_id for feedback in letters.feedbacks("letter")] == [second.sample_id, None]
    letters.add_feedback(draft(result, "memo's", verified="memo"), [change("memo")])
    assert (letters.sample_count("letter"), letters.sample_count("memo")) == (0, 1)
    letters.add_feedback(draft(result, "nothing", verified=None), [])
    assert letters.sample_count("memo") == 0
    assert letters.model("letter").version == 3  # what was learned stays


def test_another_body_with_the_same_page_keeps_the_sample(letters: Store, result: str) -> None:
    first = letters.add_feedback(draft(result), [])
    said = dataclasses.replace(draft(result), request={"labels": {"z1": "sender", "z2": None}})
    second = letters.add_feedback(said, [])
    assert (second.created, second.sample_id) == (True, first.sample_id)
    assert letters.sample_count("letter") == 1


def test_a_page_of_two_results_is_one_sample_until_both_say_otherwise(letters: Store, result: str) -> None:
    other = letters.add_result({}, ttl_s=1000)
    first = letters.add_feedback(draft(result), [])
    assert letters.add_feedback(draft(other), []).sample_id == first.sample_id
    letters.add_feedback(draft(result, "date"), [])
    assert sorted(sample.document["label"] for sample in letters.samples("letter")) == ["date", "sender"]
    letters.add_feedback(draft(other, "subject"), [])
    assert sorted(sample.document["label"] for sample in letters.samples("letter")) == ["date", "subject"]


def test_posted_samples_stay(letters: Store, result: str) -> None:
    posted = letters.add_sample("letter", {"page": "the page", "label": "sender"})
    assert letters.add_feedback(draft(result), []).sample_id == posted.id
    letters.add_feedback(draft(result, "date"), [])
    assert [sample.origin for sample in letters.samples("letter")] == ["posted", "feedback"]
    again = letters.add_sample("letter", {"page": "the page", "label": "date"})
    assert (again.created, again.origin) == (False, "posted")  # now somebody has posted it
    letters.add_feedback(draft(result, "subject"), [])
    assert letters.sample_count("letter") == 3


def test_a_full_class_makes_room_among_samples_of_feedback(letters: Store) -> None:
    posted = letters.add_sample("letter", {"posted": True}).id
    ids = []
    for n in range(4):
        result = letters.add_result({}, ttl_s=1000)
        ids.append(letters.add_feedback(draft(result, n), [], max_samples=3).sample_id)
    assert [sample.id for sample in letters.samples("letter")] == [posted, ids[2], ids[3]]
    assert [feedback.sample_id for feedback in letters.feedbacks("letter")] == [ids[3], ids[2], None, None]
    for sample_id in ids[2:]:
        letters.delete_sample("letter", str(sample_id))
    for n in range(2):
        letters.add_sample("letter", {"posted": n})
    kept = letters.add_feedback(draft(letters.add_result({}, ttl_s=1)), [change("letter")], max_samples=3)
    assert (kept.sample_id, dict(kept.versions)) == (None, {"letter": (1, 2)})
    assert letters.sample_count("letter") == 3


def test_a_deleted_class_takes_the_feedback_on_its_pages_along(letters: Store, result: str) -> None:
    others = [letters.add_result({}, ttl_s=1000) for _ in range(3)]
    letters.add_feedback(draft(result, key="key"), [change("letter")])
    letters.add_feedback(draft(others[0], found="memo"), [change("letter", 2), change("memo")])
    kept = letters.add_feedback(draft(others[1], found="letter", verified="memo"), [change("letter", 3)])
    letters.add_feedback(draft(others[2], found="letter", verified=None), [change("letter", 4)])
    letters.delete_model("letter")
    (left,) = letters.feedbacks("memo")
    assert (left.id, left.found_class, dict(left.versions)) == (kept.id, "letter", {})
    rows = everything(letters)
    assert len(rows["layout_feedback"]) == len(rows["layout_feedback_models"]) == 1
    assert letters.find_feedback(result, "key", draft(result).request) is None
    with pytest.raises(ModelNotFound):
        letters.feedbacks("letter")
    with pytest.raises(ModelNotFound):
        letters.health("letter")
    # Made anew it begins with a clean sheet, and the same feedback counts again.
    letters.add_version("letter", {"n": 1}, "import", expected_version=None)
    assert letters.health("letter") == ModelHealth(0, 0, None, None, None, None)
    assert dict(letters.add_feedback(draft(result, key="key"), [change("letter", 6)]).versions) == {
        "letter": (6, 7)
    }
    # A result may have found a class that is deleted by now.
    letters.delete_model("memo")
    late = letters.add_feedback(draft(others[1], found="memo", sample="late"), [change("letter", 7)])
    assert dict(late.versions) == {"letter": (7, 8)}

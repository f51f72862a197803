"""The list of changes: an entry is written in the transaction that makes the change, or neither is there."""

from collections.abc import Callable
from typing import Any

import pytest

from models.feedback_records import ModelUndo
from models.repository import Author, Store, changes_by
from tests.models.feedback_drafts import change, draft
from tests.models.whole_database import everything

ANNA = Author("anna", "an action")
Entry = tuple[str | None, str]
"""Model and detail of an entry."""


class Crash(Exception):
    """The process ends here."""


def teach(store: Store, result: str) -> list[Entry]:
    store.add_feedback(draft(result), [change("letter")])
    return [("letter", result)]


def teach_nothing(store: Store, result: str) -> list[Entry]:
    store.add_feedback(draft(result, found=None, verified=None, sample=None), [])
    return [(None, result)]


def take_back(store: Store, result: str) -> list[Entry]:
    store.undo_feedback(result, [ModelUndo("memo", {"n": 1}, 2, (2,))])
    return [("memo", result)]


def import_model(store: Store, result: str) -> list[Entry]:
    store.add_version("invoice", {"n": 1}, "import")
    return [("invoice", "version 1")]


def roll_back(store: Store, result: str) -> list[Entry]:
    store.rollback("memo", 1)
    return [("memo", "version 3")]


def change_settings(store: Store, result: str) -> list[Entry]:
    store.change_settings("letter", genre="mail", continues=None)
    return [("letter", "continues, genre")]


def delete_model(store: Store, result: str) -> list[Entry]:
    store.delete_model("letter")
    return [("letter", "")]


def add_sample(store: Store, result: str) -> list[Entry]:
    return [("letter", store.add_sample("letter", {"n": 5}).id)]


def delete_sample(store: Store, result: str) -> list[Entry]:
    (sample,) = store.samples("fax")
    store.delete_sample("fax", sample.id)
    return [("fax", sample.id)]


def delete_later_samples(store: Store, result: str) -> list[Entry]:
    assert store.delete_samples_after("memo", 1) == 1
    return [("memo", "1 later samples deleted")]


def delete_result(store: Store, result: str) -> list[Entry]:
    store.delete_result(result)
    return [(None, result)]


def forget_unknown_page(store: Store, result: str) -> list[Entry]:
    (page,) = store.each_unknown_page()
    store.forget_unknown_pages([page.id])
    return [(None, page.id)]


CHANGES: list[Callable[[Store, str], list[Entry]]] = [
    teach,
    teach_nothing,
    take_back,
    import_model,
    roll_back,
    change_settings,
    delete_model,
    add_sample,
    delete_sample,
    delete_later_samples,
    delete_result,
    forget_unknown_page,
]


@pytest.fixture
def taught(letters: Store, result: str) -> Store:
    """`letters`; the class memo has learned from the result, which is an unknown page too."""
    letters.add_feedback(
        draft(result, found="memo", verified="memo", request="a memo", sample="a memo"), [change("memo")]
    )
    letters.add_feedback(draft(result, "none", found=None, verified=None, sample=None, unknown="a page"), [])
    letters.add_sample("memo", {"n": 7})
    return letters


@pytest.mark.parametrize("make", CHANGES, ids=lambda make: make.__name__)
def test_a_change_and_its_entry_are_one_transaction(
    taught: Store, result: str, make: Callable[[Store, str], list[Entry]], monkeypatch: pytest.MonkeyPatch
) -> None:
    listing, before = Store._list_change, everything(taught)

    def crash_before(*_: Any) -> None:
        raise Crash

    def crash_after(*arguments: Any) -> None:
        listing(*arguments)
        raise Crash

    with changes_by(ANNA):
        for crash in (crash_before, crash_after):
            monkeypatch.setattr(Store, "_list_change", crash)
            with pytest.raises(Crash):
                make(taught, result)
            assert everything(taught) == before
        monkeypatch.setattr(Store, "_list_change", listing)
        entries = make(taught, result)
    found = [(each.who, each.action, each.model, each.detail) for each in taught.changes(9)]
    assert found == [("anna", "an action", model, detail) for model, detail in entries]


@pytest.mark.parametrize("make", CHANGES, ids=lambda make: make.__name__)
def test_the_service_itself_lists_nothing(
    taught: Store, result: str, make: Callable[[Store, str], list[Entry]]
) -> None:
    make(taught, result)
    assert taught.changes(9) == []


def test_what_changes_nothing_is_not_listed(letters: Store, result: str) -> None:
    letters.change_settings("letter", genre="mail")
    letters.add_feedback(draft(result), [change("letter")])
    with changes_by(ANNA):
        letters.change_settings("letter", genre="mail")
        letters.add_sample("fax", {"n": 1})
        letters.add_feedback(draft(result), [change("letter")])
        letters.forget_unknown_pages([])
    assert letters.changes(9) == []


def test_changes_are_listed_newest_first(letters: Store) -> None:
    with changes_by(ANNA):
        for number in range(5):
            letters.add_sample("letter" if number % 2 else "memo", {"number": number})
    listed = letters.changes(9)
    assert [entry.model for entry in listed] == ["memo", "letter", "memo", "letter", "memo"]
    assert letters.changes(2, before=listed[1].id) == listed[2:4]
    assert letters.changes(9, model="letter") == [listed[1], listed[3]]

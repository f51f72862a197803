"""What the store promises about the settings of a class and about unknown pages."""

from datetime import timedelta
from typing import Any

import pytest

from models.errors import ModelNotFound, NotStorable, StoreUnavailable
from models.records import ModelSettings, StoredUnknownPage, UnknownPageDraft
from models.repository import Store
from services.contract.layout_learning import DEFAULT_LEARNER
from tests.models.conftest import Clock
from tests.models.feedback_drafts import change, draft
from tests.models.whole_database import everything


def test_settings_stay_when_versions_change(letters: Store) -> None:
    assert letters.settings("letter") == ModelSettings(DEFAULT_LEARNER, None, None)
    revision = letters.revision()
    changed = letters.change_settings("letter", learner="counting", genre="correspondence")
    assert changed == ModelSettings("counting", "correspondence", None)
    assert letters.revision() > revision  # whoever has read the models has read their settings
    letters.add_version("letter", {}, "train")
    later = letters.change_settings("letter", genre=None)
    assert later == letters.settings("letter") == ModelSettings("counting", None, None)
    assert letters.model("letter").settings == letters.ready_models(["letter"])[0].settings == later
    assert [model.settings for model in letters.models() if model.name == "letter"] == [later]
    assert letters.change_settings("letter", learner=None).learner == DEFAULT_LEARNER
    before = everything(letters)
    assert letters.change_settings("letter") == ModelSettings()
    assert everything(letters) == before
    letters.change_settings("letter", genre="correspondence")
    letters.delete_model("letter")
    letters.add_sample("letter", {})
    assert letters.settings("letter") == ModelSettings()


def test_settings_that_cannot_be(letters: Store) -> None:
    letters.change_settings("memo", continues="letter")
    before = everything(letters)
    wrong: list[tuple[type[Exception], str, dict[str, str | None]]] = [
        (NotStorable, "letter", {"learner": "guessing"}),
        (NotStorable, "letter", {"learner": ""}),
        (NotStorable, "letter", {"genre": ""}),
        (NotStorable, "letter", {"genre": "\0"}),
        (NotStorable, "letter", {"colour": "red"}),
        (NotStorable, "letter", {"continues": "letter"}),
        (NotStorable, "fax", {"continues": "memo"}),  # memo continues letter
        (NotStorable, "letter", {"continues": "fax"}),  # letter is continued
        (ModelNotFound, "letter", {"continues": "novel"}),
        (ModelNotFound, "novel", {"genre": "book"}),
    ]
    for error, name, changes in wrong:
        with pytest.raises(error):
            letters.change_settings(name, **changes)
    assert everything(letters) == before
    with pytest.raises(ModelNotFound):
        letters.settings("novel")
    letters.delete_model("letter")
    assert letters.settings("memo").continues is None


def test_unknown_pages_are_a_ring(letters: Store, clock: Clock) -> None:
    results = [
        letters.add_result({}, 1000, UnknownPageDraft({"n": n}, bound=3, ttl_s=1000)) for n in range(5)
    ]
    pages = list(letters.each_unknown_page())
    assert [(page.result_id, page.page) for page in pages] == [(results[n], {"n": n}) for n in (2, 3, 4)]
    letters.add_feedback(draft(results[4], found=None, verified=None, unknown="again"), [])
    assert list(map(content_of, letters.each_unknown_page())) == list(map(content_of, pages))
    assert letters.forget_unknown_pages([pages[1].id, results[0], "no id"]) == 1
    assert letters.forget_unknown_pages([]) == 0
    letters.add_result({}, 1000, UnknownPageDraft({"short": True}, bound=3, ttl_s=10))
    clock.now += timedelta(seconds=20)
    assert [page.page for page in letters.each_unknown_page()] == [{"n": 2}, {"n": 4}]
    assert len(everything(letters)["layout_unknown_pages"]) == 3
    letters.purge_results()
    assert len(everything(letters)["layout_unknown_pages"]) == 2


def content_of(page: StoredUnknownPage) -> tuple[str, str, dict[str, Any]]:
    return page.id, page.result_id, page.page


def test_a_page_of_no_class_is_kept_with_its_feedback_or_not_at_all(
    letters: Store, result: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    said = draft(result, verified=None, unknown="page")
    before = everything(letters)

    def fail(*_: object) -> Any:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr("models.feedback_repository.add_unknown_page", fail)
        with pytest.raises(StoreUnavailable):
            letters.add_feedback(said, [change("letter")])
    assert everything(letters) == before
    assert letters.add_feedback(said, [change("letter")]).created  # the retry
    assert [page.page for page in letters.each_unknown_page()] == [{"n": "page"}]


def test_an_unknown_page_that_expired_may_come_again(letters: Store, clock: Clock) -> None:
    result = letters.add_result({}, 1e6, UnknownPageDraft({"n": 1}, bound=3, ttl_s=10))
    clock.now += timedelta(seconds=20)
    letters.add_feedback(draft(result, verified=None, unknown=2), [])
    assert [page.page for page in letters.each_unknown_page()] == [{"n": 2}]


def test_a_page_that_found_its_class_is_unknown_no_longer(letters: Store, result: str) -> None:
    letters.add_feedback(draft(result, found=None, verified=None, unknown=1), [])
    assert len(list(letters.each_unknown_page())) == 1
    letters.add_feedback(draft(result, "more", found=None), [])
    assert list(letters.each_unknown_page()) == []

"""What the store promises about models and samples, on real databases."""

import json
from collections.abc import Callable, Generator
from datetime import UTC
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from models.errors import (
    KeyReused,
    ModelNotFound,
    NotFound,
    NotStorable,
    ResultNotFound,
    SampleNotFound,
    StoreError,
    StoreFull,
    StoreUnavailable,
    VersionConflict,
)
from models.repository import Store
from tests.models.conftest import Clock
from tests.models.databases import KINDS, make_file

ANY_TEXT = st.text(st.characters(), max_size=20)  # all of Unicode, halves of surrogate pairs too
LEAVES = (
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | ANY_TEXT
)
VALUES = st.recursive(LEAVES, lambda v: st.lists(v, max_size=4) | st.dictionaries(ANY_TEXT, v, max_size=4))
DOCUMENTS = st.dictionaries(ANY_TEXT, VALUES, max_size=6)


def as_json(document: Any) -> str:
    """Tells 1 from 1.0, 0.0 from -0.0, and one order of keys from another."""
    return json.dumps(document)


@pytest.fixture(scope="module", params=KINDS)
def shared(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Any:
    if request.param == "sqlite":
        where: Path | str = make_file(tmp_path_factory.mktemp("shared") / "store.sqlite3")
    else:
        where = request.getfixturevalue("cluster").make_database()
    with Store.open(where) as store:
        yield store


@pytest.fixture(scope="module")
def shared_file(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """For what is bytes before it reaches a database."""
    with Store.open(make_file(tmp_path_factory.mktemp("shared") / "store.sqlite3")) as store:
        yield store


@given(document=DOCUMENTS)
def test_documents_come_back_as_they_were(shared_file: Store, document: dict[str, Any]) -> None:
    shared = shared_file
    version = shared.add_version("any", document, "import").version
    sample = shared.add_sample("any", document)
    result = shared.add_result(document, ttl_s=60)
    assert as_json(shared.model("any", version).document) == as_json(document)
    assert sample.document == document
    assert shared.sample("any", sample.id).document == document
    assert as_json(shared.result(result).document) == as_json(document)


NAMES = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), min_size=1, max_size=200)


@given(name=NAMES)
def test_any_name_may_be_a_class(shared: Store, name: str) -> None:
    sample = shared.add_sample(name, {"name": name}, key=name)
    assert shared.sample(name, sample.id).document == {"name": name}
    assert shared.add_sample(name, {"name": name}, key=name).id == sample.id
    assert [found.id for found in shared.samples(name)] == [sample.id]
    summary = shared.model_summary(name)
    assert (summary.name, summary.samples) == (name, 1)


def test_a_class_begins_with_its_first_sample(store: Store, clock: Clock) -> None:
    assert store.models() == []
    sample = store.add_sample("letter", {"zones": []})
    assert sample.created
    assert sample.created_at.tzinfo is UTC
    (summary,) = store.models()
    assert (summary.name, summary.version, summary.samples) == ("letter", None, 1)
    assert summary.created_at == summary.updated_at == sample.created_at <= clock.now
    model = store.model("letter")
    assert (model.version, model.document, model.origin, model.samples) == (None, None, None, 1)
    assert store.ready_models() == store.ready_models(["letter"]) == []
    assert store.model_versions("letter") == []


def test_versions_count_up_and_all_are_kept(store: Store) -> None:
    store.add_sample("letter", {"zones": []})
    origins = ["initialize", "feedback", "train", "rollback", "import"]
    for number, origin in enumerate(origins, start=1):
        model = store.add_version("letter", {"number": number}, origin, note=f"the {number}")  # type: ignore[arg-type]
        assert (model.version, model.document, model.samples) == (number, {"number": number}, 1)
    assert store.model("letter").document == {"number": 5}
    assert [store.model("letter", number).document for number in range(1, 6)] == [
        {"number": number} for number in range(1, 6)
    ]
    history = store.model_versions("letter")
    assert [version.origin for version in history] == origins
    assert [version.version for version in history] == [1, 2, 3, 4, 5]
    assert [version.note for version in history] == [f"the {number}" for number in range(1, 6)]
    assert [version.created_at for version in history] == sorted({version.created_at for version in history})
    assert store.model("letter").updated_at == history[-1].created_at > store.model("letter").created_at


def test_a_writer_may_say_what_it_expects(store: Store) -> None:
    store.add_version("letter", {"n": 1}, "import", expected_version=None)
    store.add_version("letter", {"n": 2}, "train", expected_version=1)
    for expected in (None, 1, 3, 10**30, -1):
        with pytest.raises(VersionConflict) as conflict:
            store.add_version("letter", {"n": 3}, "train", expected_version=expected)
        assert conflict.value.current == 2
        with pytest.raises(VersionConflict):
            store.delete_model("letter", expected_version=expected)
    assert store.model("letter").document == {"n": 2}
    with pytest.raises(VersionConflict):
        store.add_version("memo", {}, "import", expected_version=1)
    assert [summary.name for summary in store.models()] == ["letter"]


def test_a_writer_may_judge_the_version_that_is_written_over(store: Store) -> None:
    judged: list[int | None] = []
    store.add_version("letter", {"n": 1}, "import", expected_version=judged.append)
    store.add_version("letter", {"n": 2}, "train", expected_version=judged.append)

    def refuse(current: int | None) -> None:
        raise LookupError(current)

    for write in (
        lambda: store.add_version("letter", {"n": 3}, "train", expected_version=refuse),
        lambda: store.rollback("letter", 1, refuse),
        lambda: store.delete_model("letter", expected_version=refuse),
    ):
        with pytest.raises(LookupError, match="2"):
            write()
    assert judged == [None, 1]
    assert store.model("letter").document == {"n": 2}


def test_only_an_import_makes_a_class(store: Store) -> None:
    with pytest.raises(ModelNotFound):
        store.add_version("letter", {}, "initialize")
    assert store.models() == []
    assert store.add_version("letter", {}, "import").version == 1


def test_a_deleted_class_goes_on_counting_when_it_comes_back(store: Store) -> None:
    sample = store.add_sample("letter", {"zones": []}, key="one")
    store.add_version("letter", {"n": 1}, "initialize")
    store.delete_model("letter", expected_version=1)
    assert store.models() == store.ready_models() == []
    missing: list[Callable[[], object]] = [
        lambda: store.model("letter"),
        lambda: store.model("letter", 1),
        lambda: store.model_versions("letter"),
        lambda: store.samples("letter"),
        lambda: store.sample("letter", sample.id),
        lambda: store.delete_sample("letter", sample.id),
        lambda: store.delete_model("letter"),
        lambda: store.ready_models(["letter"]),
    ]
    for ask in missing:
        with pytest.raises(ModelNotFound) as error:
            ask()
        assert error.value.what == "letter"
        assert "letter" in error.value.detail
    again = store.add_sample("letter", {"zones": []}, key="one")
    assert again.created
    assert again.id != sample.id
    assert store.model("letter").version is None
    assert store.model("letter").created_at == again.created_at
    assert store.add_version("letter", {"n": 2}, "initialize", expected_version=None).version == 2
    assert [version.version for version in store.model_versions("letter")] == [2]
    with pytest.raises(ModelNotFound, match="no version 1"):
        store.model("letter", 1)


def test_ready_models(store: Store) -> None:
    for name in ("memo", "letter", "fax"):
        store.add_version(name, {"of": name}, "import")
    store.add_version("memo", {"of": "memo", "again": True}, "train")
    store.add_sample("draft", {})
    assert [(model.name, model.version) for model in store.ready_models()] == [
        ("fax", 1),
        ("letter", 1),
        ("memo", 2),
    ]
    assert [model.document for model in store.ready_models(["memo", "draft", "memo"])] == [
        {"of": "memo", "again": True}
    ]
    assert store.ready_models([]) == []
    with pytest.raises(ModelNotFound) as error:
        store.ready_models(["letter", "novel"])
    assert error.value.what == "novel"


def test_the_revision_grows_with_what_ready_models_depends_on(store: Store) -> None:
    seen = [store.revision()]
    store.add_sample("letter", {"n": 1})
    seen.append(store.revision())
    store.add_version("letter", {}, "initialize")
    seen.append(store.revision())
    store.delete_model("letter")
    seen.append(store.revision())
    assert seen == sorted(set(seen))
    store.add_sample("memo", {"n": 1})
    before = store.revision()
    store.add_sample("memo", {"n": 2})
    store.add_result({}, ttl_s=1)
    with pytest.raises(VersionConflict):
        store.add_version("memo", {}, "train", expected_version=7)
    assert store.revision() == before


def test_a_sample_counts_once(store: Store) -> None:
    first = store.add_sample("letter", {"a": 1, "b": 2}, key="key")
    for again in (
        store.add_sample("letter", {"a": 1, "b": 2}, key="key"),
        store.add_sample("letter", {"b": 2, "a": 1}),
        store.add_sample("letter", {"a": 1, "b": 2}, key="another"),
    ):
        assert (again.id, again.created, again.created_at) == (first.id, False, first.created_at)
    with pytest.raises(KeyReused):
        store.add_sample("letter", {"a": 3}, key="key")
    assert store.sample_count("letter") == 1
    assert store.add_sample("memo", {"a": 3}, key="key").created  # keys are of one class
    assert store.add_sample("letter", {"a": 3}).created


def test_a_key_that_comes_later_is_bound_to_the_sample(store: Store) -> None:
    first = store.add_sample("letter", {"a": 1})
    assert store.add_sample("letter", {"a": 1}, key="key").id == first.id
    with pytest.raises(KeyReused):
        store.add_sample("letter", {"a": 2}, key="key")
    assert store.sample_count("letter") == 1


def test_samples_can_be_taken_away(store: Store) -> None:
    ids = [store.add_sample("letter", {"n": n}).id for n in range(4)]
    assert [sample.id for sample in store.samples("letter")] == ids
    assert [sample.document for sample in store.samples("letter")] == [{"n": n} for n in range(4)]
    assert [sample.id for sample in store.each_sample("letter")] == ids
    newest = store.each_sample("letter", newest_first=True)
    assert (next(newest).id, next(newest).document) == (ids[3], {"n": 2})
    assert isinstance(newest, Generator)
    newest.close()
    store.delete_sample("letter", ids[1])
    assert [sample.id for sample in store.samples("letter")] == [ids[0], ids[2], ids[3]]
    store.add_sample("memo", {})
    for name, sample_id in (("letter", ids[1]), ("memo", ids[0]), ("letter", "no id"), ("letter", "\ud800")):
        with pytest.raises(SampleNotFound):
            store.sample(name, sample_id)
        with pytest.raises(SampleNotFound):
            store.delete_sample(name, sample_id)
    assert store.add_sample("letter", {"n": 1}).created


def test_bounds_leave_nothing_behind(store: Store) -> None:
    for n in range(3):
        store.add_sample("letter", {"n": n}, max_samples=3, max_models=1)
    with pytest.raises(StoreFull):
        store.add_sample("letter", {"n": 3}, max_samples=3)
    assert not store.add_sample("letter", {"n": 2}, max_samples=3).created
    with pytest.raises(StoreFull):
        store.add_sample("memo", {}, max_models=1)
    with pytest.raises(StoreFull):
        store.add_sample("memo", {}, max_samples=0)
    with pytest.raises(StoreFull):
        store.add_version("memo", {}, "import", max_models=1)
    assert [(summary.name, summary.samples) for summary in store.models()] == [("letter", 3)]


STRANGE = ["", "\0", "a\0b", "\ud800", "x" * 201]


@pytest.mark.parametrize("name", STRANGE)
def test_strange_names_are_refused_and_never_found(store: Store, name: str) -> None:
    with pytest.raises(NotStorable):
        store.add_sample(name, {})
    with pytest.raises(NotStorable):
        store.add_sample("letter", {}, key=name)
    with pytest.raises(NotStorable):
        store.add_version(name, {}, "import")
    assert store.models() == []
    for ask in (store.model, store.samples, store.model_versions, store.delete_model):
        with pytest.raises(ModelNotFound):
            ask(name)
    with pytest.raises(ModelNotFound):
        store.ready_models([name])
    with pytest.raises(ResultNotFound):
        store.result(name)


@pytest.mark.parametrize("version", [0, -1, 2, 2**31, 2**63, 10**30])
def test_there_are_no_other_versions(store: Store, version: int) -> None:
    store.add_version("letter", {}, "import")
    with pytest.raises(ModelNotFound):
        store.model("letter", version)


def nested(depth: int) -> dict[str, Any]:
    document: dict[str, Any] = {}
    for _ in range(depth):
        document = {"in": document}
    return document


@pytest.mark.parametrize(
    "document",
    [{"n": float("nan")}, {"n": float("inf")}, {"n": {1}}, {"n": b""}, {"n": 10**5000}],
    ids=["nan", "infinity", "set", "bytes", "digits"],
)
def test_what_is_not_json_is_not_stored(store: Store, document: dict[str, Any]) -> None:
    is_refused(store, document)


def test_what_is_nested_too_deeply_is_not_stored(store: Store) -> None:
    is_refused(store, nested(100_000))


def is_refused(store: Store, document: dict[str, Any]) -> None:
    for add in (
        lambda: store.add_sample("letter", document),
        lambda: store.add_version("letter", document, "import"),
        lambda: store.add_result(document, ttl_s=1),
    ):
        with pytest.raises(NotStorable):
            add()
    assert store.models() == []


def test_a_document_has_a_largest_size(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("models.documents.MAX_DOCUMENT_BYTES", 1000)
    store.add_result({"text": "x" * 900}, ttl_s=1)
    with pytest.raises(NotStorable):
        store.add_result({"text": "x" * 1000}, ttl_s=1)


def test_a_closed_store_says_so(tmp_path: Path) -> None:
    store = Store.open(make_file(tmp_path / "store.sqlite3"))
    store.close()
    with pytest.raises(StoreUnavailable):
        store.models()
    with pytest.raises(StoreUnavailable):
        store.add_result({}, ttl_s=1)


def test_codes_are_those_of_the_contract() -> None:
    codes = {kind.__name__: kind.code for kind in (ModelNotFound, SampleNotFound, ResultNotFound, NotFound)}
    assert set(codes.values()) == {"not-found"}
    assert (VersionConflict.code, KeyReused.code) == ("conflict", "conflict")
    assert (StoreFull.code, StoreUnavailable.code) == ("store-full", "store-unavailable")
    assert NotStorable.code == "not-storable"
    assert StoreError.code == "internal"

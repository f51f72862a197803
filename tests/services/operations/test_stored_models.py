"""Stored models are read once, and kept within a bound of bytes."""

import json
from dataclasses import replace

from services.contract.layout import ModelDocument
from services.layout.model.layout_model import Calibration, LayoutModel, ModelNode
from services.layout.model.model_document import model_to_document
from services.operations.stored_models import ModelCache, open_models, read_model


def stored(name: str) -> ModelDocument:
    node = ModelNode(None, 0.0, 0.0, {}, {}, (0.0, 0.0))
    model = LayoutModel(name, 1, (node,), (), {}, Calibration(-5.0, 1.0, 0))
    return ModelDocument(name, 1, json.dumps(model_to_document(model)).encode())


def test_a_model_is_read_once() -> None:
    ready, model = ModelCache(), stored("a")
    first, again = (open_models([model], ready)[0].model for _ in range(2))
    assert first is again


def test_a_genre_competes_with_its_model() -> None:
    models = [stored("a"), replace(stored("b"), genre="letters")]
    assert [(each.version, each.genre) for each in open_models(models, ModelCache())] == [
        (1, None),
        (1, "letters"),
    ]


def test_the_least_recently_used_models_go_first() -> None:
    a, b, c = (stored(name) for name in "abc")
    ready = ModelCache(most_bytes=len(a.document) + len(b.document))
    kept_a, kept_b = (ready.read(each.name, each.document) for each in (a, b))
    assert ready.read("a", a.document) is kept_a
    ready.read("c", c.document)
    assert ready.read("a", a.document) is kept_a
    assert ready.read("b", b.document) is not kept_b


def test_a_new_version_takes_the_place_of_the_one_before() -> None:
    old, other = stored("a"), stored("b")
    new = replace(old, version=2, document=old.document.replace(b'"samples": 1', b'"samples": 2'))
    ready = ModelCache(most_bytes=len(old.document) + len(other.document))
    kept = ready.read("b", other.document)
    assert [ready.read("a", each.document).samples for each in (old, new, new)] == [1, 2, 2]
    assert ready.read("b", other.document) is kept, "two versions of one model take the room of one"


def test_a_model_larger_than_all_that_is_kept_is_read_all_the_same() -> None:
    ready = ModelCache(most_bytes=1)
    assert [ready.read(name, stored(name).document).name for name in "aba"] == ["a", "b", "a"]


def test_a_model_that_learns_is_taken_from_the_cache_and_not_added_to_it() -> None:
    ready, model = ModelCache(), stored("a")
    first = read_model(model, ready)
    assert read_model(model, ready) is not first
    [kept] = open_models([model], ready)
    assert read_model(model, ready) is kept.model
    newer = replace(model, version=2, document=model.document.replace(b'"samples": 1', b'"samples": 2'))
    assert read_model(newer, ready).samples == 2
    assert open_models([model], ready)[0].model is kept.model

"""Recognition never fails on a page or a model that was let in, and never computes with what is no number."""

import json
import warnings
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.layout.model.model_document import model_from_document, model_to_document
from services.layout.page import ALIGNMENTS, KINDS, InvalidLayout, Page, Zone
from services.layout.pipeline import initialize_model, recognize
from services.layout.recognition.page_recognition import RecognitionParameters, VersionedModel
from services.layout.recognition.results import Recognition
from tests.services.layout.samples import MAKERS, labelled_page, model_of, page_of

pytestmark = pytest.mark.pipeline

SIDE = 100_000.0
"""The largest page that is let in."""
coordinates = st.one_of(st.floats(0, SIDE), st.sampled_from([0.0, 1e-9, 1.0, 50.0, 100.0, SIDE]))
extents = st.one_of(st.floats(1e-9, SIDE), st.sampled_from([1e-9, 1.0, 50.0, SIDE]))
sizes = st.one_of(st.none(), st.sampled_from([1e-3, 1.0, 12.0, 1e5]), st.floats(1e-3, 1e5))
texts = st.one_of(
    st.just(""),
    st.text(max_size=30),
    st.sampled_from(["Dear Sir,", " ", "1" * 5000, "A\n\n\n", "\u0660\u0661", "ß" * 99, "cc: x\nencl."]),
)


@st.composite
def zones(draw: st.DrawFn) -> Zone:
    x, y = draw(coordinates), draw(coordinates)
    width, height = draw(extents), draw(extents)
    right, bottom = max(x + width, np.nextafter(x, np.inf)), max(y + height, np.nextafter(y, np.inf))
    return Zone(
        id=draw(st.uuids()).hex,
        box=(x, y, float(right), float(bottom)),
        kind=draw(st.sampled_from(KINDS)),
        lines=draw(st.one_of(st.none(), st.sampled_from([0, 1, 3, 100_000]))),
        font_size=draw(sizes),
        line_spacing=draw(sizes),
        weight=draw(st.one_of(st.none(), st.just(0.0), st.floats(1e-6, 1e5))),
        alignment=draw(st.one_of(st.none(), st.sampled_from(ALIGNMENTS))),
        text=draw(texts),
        content=draw(
            st.dictionaries(st.sampled_from(["date", "name", "ghost"]), st.floats(0, 1), max_size=2)
        ),
        label=draw(st.sampled_from([None, "date", "body"])),
    )


pages = st.builds(Page, st.floats(0.5, SIDE), st.floats(0.5, SIDE), st.lists(zones(), max_size=12).map(tuple))


def assert_sound(found: Recognition, page: Page) -> None:
    assert [zone.zone.id for zone in found.zones] == [zone.id for zone in page.zones]
    assert all(0 <= zone.confidence <= 1 for zone in found.zones)
    assert all(0 <= each.probability <= 1 and np.isfinite(each.cost) for each in found.classes)
    assert 0 <= found.unknown_probability <= 1
    if found.match is not None:
        report = found.match
        parts = report.node_cost, report.edge_cost, report.count_cost
        assert np.isfinite([report.cost, report.gap, *parts]).all()
        assert sum(parts) == pytest.approx(report.cost, rel=1e-6, abs=1e-6)
        assert all(np.isfinite(term.cost) for term in report.explanation)


@settings(max_examples=50, deadline=None)
@given(pages, st.sampled_from(["direct", "two-steps"]))
def test_any_page_is_recognized(page: Page, method: Any) -> None:
    models = [VersionedModel(model_of(name, samples), 1) for name, samples in (("letter", 1), ("memo", 3))]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = recognize(page, models, RecognitionParameters(method=method, explain=True))
    assert_sound(found, page)


@settings(max_examples=25, deadline=None)
@given(st.lists(pages.filter(lambda page: bool(page.zones)), min_size=1, max_size=3))
def test_any_samples_make_a_model_that_can_be_stored(samples: list[Page]) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        model = initialize_model("odd", samples)
        again = model_from_document(json.loads(json.dumps(model_to_document(model), allow_nan=False)))
        for page in samples:
            assert_sound(recognize(page, [VersionedModel(again, 1)]), page)


SMALL = Page(1000, 1000, labelled_page("memo", 0).zones[:4])
DOCUMENT = model_to_document(initialize_model("small", [SMALL]))


def leaves(value: Any, here: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    if isinstance(value, dict | list):
        steps = value.items() if isinstance(value, dict) else enumerate(value)
        return [path for step, inner in steps for path in leaves(inner, (*here, step))]
    return [here]


LEAVES = leaves(DOCUMENT)


@settings(max_examples=150, deadline=None)
@given(
    st.lists(
        st.tuples(
            st.sampled_from(LEAVES),
            st.sampled_from([None, 0, 1, 1.0, -1e9, 1e9, 1e-9, 1e3, 1e-6, float("nan"), "x", [1.0]]),
        ),
        min_size=1,
        max_size=4,
    )
)
def test_a_model_that_was_let_in_recognizes(damages: list[tuple[tuple[Any, ...], Any]]) -> None:
    damaged = json.loads(json.dumps(DOCUMENT))
    for path, value in damages:
        holder = damaged
        for step in path[:-1]:
            holder = holder[step]
        holder[path[-1]] = value
    try:
        model = model_from_document(damaged)
    except InvalidLayout:
        return
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert_sound(recognize(SMALL, [VersionedModel(model, 1)]), SMALL)


def test_certain_expectations_cost_much_and_not_everything() -> None:
    document = json.loads(json.dumps(DOCUMENT))
    for number, node in enumerate(document["nodes"]):
        node["content"] = dict.fromkeys(node["content"], float(number % 2))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = recognize(SMALL, [VersionedModel(model_from_document(document), 1)])
    assert_sound(found, SMALL)
    assert found.match is not None
    assert abs(found.match.cost) < 1e4


def test_a_crowded_page_is_recognized() -> None:
    rng = np.random.default_rng(0)
    corners = rng.uniform(0, 3000, (500, 2))
    boxes = np.hstack([corners, corners + rng.uniform(5, 200, (500, 2))])
    page = page_of(*map(tuple, boxes.tolist()), width=3200.0, height=3200.0, lines=1)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = recognize(page, [VersionedModel(model_of("memo", 1), 1)])
    assert_sound(found, page)
    assert found.chosen is None


@pytest.mark.parametrize("name", MAKERS)
def test_equal_zones_get_answers_that_repeat(name: str) -> None:
    page = page_of(*[(100.0, 100.0, 300.0, 150.0)] * 6, text="Dear Sir,", lines=1, font_size=20.0)
    models = [VersionedModel(model_of(name, 1), 1)]
    first, again = recognize(page, models), recognize(page, models)
    assert [zone.label for zone in first.zones] == [zone.label for zone in again.zones]
    assert_sound(first, page)

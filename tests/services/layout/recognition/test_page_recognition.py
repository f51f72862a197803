"""Recognition of simulated pages: errors within bounds, the same however zones are told, and honest doubts."""

import weakref
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
import pytest

from services.layout.matching import MatchingParameters
from services.layout.model.layout_model import LayoutModel
from services.layout.page import Page, Zone
from services.layout.pipeline import initialize_model, recognize
from services.layout.recognition import page_recognition as recognition
from services.layout.recognition.page_recognition import RecognitionParameters, VersionedModel
from services.layout.recognition.results import Recognition, RecognizedZone
from tests.services.layout.samples import (
    FIRST_UNSEEN,
    MAKERS,
    labelled_page,
    model_of,
    models_of_all,
    page_of,
    permuted,
    scaled,
)

pytestmark = pytest.mark.pipeline

UNSEEN = range(FIRST_UNSEEN, FIRST_UNSEEN + 10)
LOCAL_SEARCH_ONLY = RecognitionParameters(matching=MatchingParameters(max_nodes=0, max_sweeps=0))
TWO_STEPS = RecognitionParameters(method="two-steps")
MOST_WRONG = {
    # Shares of zones with a wrong label, from 1, 3 and 5 samples: 1.5 times what was measured, and a little.
    "letter": (0.25, 0.19, 0.16),
    "memo": (0.18, 0.04, 0.04),
    "fax": (0.14, 0.12, 0.04),
    "plain": (0.08, 0.03, 0.03),
    "two-column": (0.14, 0.04, 0.04),
    "margin": (0.05, 0.05, 0.05),
}


@lru_cache(maxsize=64)
def recognitions(
    name: str, samples: int, parameters: RecognitionParameters | None = None
) -> list[Recognition]:
    return [recognize(labelled_page(name, seed), models_of_all(samples), parameters) for seed in UNSEEN]


def wrong(found: list[Recognition]) -> list[RecognizedZone]:
    return [zone for page in found for zone in page.zones if zone.label != zone.zone.label]


def zones_of(found: list[Recognition]) -> int:
    return sum(len(page.zones) for page in found)


@pytest.mark.parametrize("name", MAKERS)
@pytest.mark.parametrize(("column", "samples"), [(0, 1), (1, 3), (2, 5)])
def test_few_samples_are_enough(name: str, column: int, samples: int) -> None:
    found = recognitions(name, samples)
    assert [page.classes[0].name for page in found] == [name] * len(found)
    assert sum(page.chosen is None for page in found) <= 1
    assert len(wrong(found)) <= MOST_WRONG[name][column] * zones_of(found)
    assert all(page.match is not None and page.match.optimal for page in found)


def test_more_samples_make_fewer_errors() -> None:
    errors = [sum(len(wrong(recognitions(name, samples))) for name in MAKERS) for samples in (1, 5)]
    assert errors[0] > 2 * errors[1] > 0


def test_doubts_are_where_the_errors_are() -> None:
    found = [page for name in MAKERS for page in recognitions(name, 1)]
    sure_of_wrong = [zone.confidence for zone in wrong(found)]
    sure_of_right = [
        zone.confidence for page in found for zone in page.zones if zone.label == zone.zone.label
    ]
    assert np.mean(sure_of_right) > 0.95
    assert np.mean(sure_of_wrong) < 0.9
    assert np.median(sure_of_wrong) < np.quantile(sure_of_right, 0.1)
    assert min(sure_of_wrong + sure_of_right) >= 0
    assert max(sure_of_wrong + sure_of_right) <= 1


@pytest.mark.parametrize("name", ["letter", "fax", "margin"])
def test_the_order_of_zones_changes_no_label(name: str) -> None:
    for seed in (1000, 1001):
        page = labelled_page(name, seed)
        shuffled = permuted(page, np.random.default_rng(seed).permutation(len(page.zones)))
        found, other = recognize(page, models_of_all(3)), recognize(shuffled, models_of_all(3))
        assert {zone.zone.id: zone.label for zone in found.zones} == {
            zone.zone.id: zone.label for zone in other.zones
        }
        assert [zone.zone.id for zone in other.zones] == [zone.id for zone in shuffled.zones]
        assert [zone.order for zone in other.zones] == list(range(len(page.zones)))
        for one, two in zip(found.classes, other.classes, strict=True):
            assert one.name == two.name
            assert one.probability == pytest.approx(two.probability, abs=1e-6)


@pytest.mark.parametrize("factor", [0.5, 4.0])
def test_resolution_changes_nothing(factor: float) -> None:
    for name in MAKERS:
        page = labelled_page(name, 1002)
        found, other = (recognize(each, models_of_all(3)) for each in (page, scaled(page, factor)))
        assert [zone.label for zone in found.zones] == [zone.label for zone in other.zones]
        assert found.match is not None
        assert other.match is not None
        assert other.match.cost == pytest.approx(found.match.cost, rel=1e-6)


def test_the_order_of_models_changes_nothing() -> None:
    page, models = labelled_page("memo", 1003), models_of_all(3)
    found, other = recognize(page, models), recognize(page, models[::-1])
    assert [each.name for each in found.classes] == [each.name for each in other.classes]
    assert [zone.label for zone in found.zones] == [zone.label for zone in other.zones]


def test_answers_repeat() -> None:
    page, models = labelled_page("letter", 1004), models_of_all(3)
    found, again = recognize(page, models), recognize(page, models)
    assert replace(found, timings_ms={}) == replace(again, timings_ms={})
    assert set(found.timings_ms) == {"content", "matching", "classification"}


def test_probabilities_of_all_classes_and_none_sum_to_one() -> None:
    found = recognize(labelled_page("fax", 1005), models_of_all(1))
    assert sum(each.probability for each in found.classes) + found.unknown_probability == pytest.approx(1.0)
    shares = [each.probability for each in found.classes]
    assert shares == sorted(shares, reverse=True)
    assert {each.name for each in found.classes} == set(MAKERS)


def test_contenders_are_searched_for_thoroughly() -> None:
    """What is proved of the class is proved as if it had been alone."""
    for name in MAKERS:
        page = labelled_page(name, 1006)
        among = recognize(page, models_of_all(3))
        alone = recognize(page, [VersionedModel(model_of(name, 3), 1)])
        quick = recognize(page, [VersionedModel(model_of(name, 3), 1)], LOCAL_SEARCH_ONLY)
        assert among.match is not None
        assert alone.match is not None
        assert quick.match is not None
        assert among.match.optimal
        assert replace(among.match, explanation=()) == replace(alone.match, explanation=())
        assert quick.match.cost >= alone.match.cost - 1e-9
        assert quick.match.cost - quick.match.gap <= alone.match.cost + 1e-9


def test_a_bounded_number_of_models_is_matched_thoroughly(monkeypatch: pytest.MonkeyPatch) -> None:
    page, model = labelled_page("letter", 50), model_of("letter", 4)
    calls: list[bool] = []
    match = recognition._match

    def counting(*arguments: Any, thorough: bool) -> Any:
        calls.append(thorough)
        return match(*arguments, thorough=thorough)

    monkeypatch.setattr(recognition, "_match", counting)
    monkeypatch.setattr(recognition, "MOST_CONTENDERS", 3)
    found = recognize(page, [VersionedModel(model, version) for version in range(1, 9)])
    assert calls.count(False) == 8
    assert 3 <= calls.count(True) <= 8
    assert found.match is not None
    assert [zone.label for zone in found.zones] == [
        zone.label for zone in recognize(page, [VersionedModel(model, 1)]).zones
    ]


def test_tables_of_one_model_at_a_time_are_in_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a page of 500 zones and a model of 60 labels they have 300 MB."""
    edges: list[weakref.ref[Any]] = []
    build = recognition.build_cost_tables  # type: ignore[attr-defined]

    def watched(*arguments: Any) -> Any:
        assert not [edge for edge in edges if edge() is not None]
        tables = build(*arguments)
        edges.append(weakref.ref(tables.edge))
        return tables

    monkeypatch.setattr(recognition, "build_cost_tables", watched)
    recognize(labelled_page("letter", 52), models_of_all(3) * 3)
    assert len(edges) > 9


@pytest.mark.parametrize("bound", ["MOST_ENTRIES", "MOST_ENTRIES_TOGETHER"])
def test_large_tables_are_made_smaller(monkeypatch: pytest.MonkeyPatch, bound: str) -> None:
    """Zones are joined to fewer neighbours; labels suffer little, and even one neighbour is enough to answer."""
    page, models = labelled_page("letter", 51), [VersionedModel(model_of("letter", 4), 1)] * 2
    tables = []
    build = recognition.build_cost_tables  # type: ignore[attr-defined]
    monkeypatch.setattr(recognition, "build_cost_tables", lambda *of: tables.append(build(*of)) or tables[-1])
    whole = recognize(page, models)
    entries = tables[-1].edge.size
    monkeypatch.setattr(recognition, bound, entries / 2)
    smaller = recognize(page, models)
    assert tables[-1].edge.size < entries / (1.5 if bound == "MOST_ENTRIES" else 3)
    same = [a.label == b.label for a, b in zip(whole.zones, smaller.zones, strict=True)]
    assert np.mean(same) > 0.7
    monkeypatch.setattr(recognition, bound, 0.0)
    assert len(recognize(page, models).zones) == len(page.zones)


def test_equal_models_share_the_probability() -> None:
    model = model_of("letter", 3)
    twins = [VersionedModel(model, 1), VersionedModel(replace(model, name="twin"), 4)]
    found = recognize(labelled_page("letter", 1007), twins)
    assert [each.probability for each in found.classes] == pytest.approx([0.5, 0.5], abs=0.01)
    assert [(each.name, each.model_version) for each in found.classes] == [("letter", 1), ("twin", 4)]


@pytest.mark.parametrize(("left_out", "least"), [("two-column", 7), ("margin", 7), ("plain", 5), ("fax", 4)])
def test_pages_of_another_class_are_unknown(left_out: str, least: int) -> None:
    models = [VersionedModel(model_of(name, 5), 1) for name in MAKERS if name != left_out]
    found = [recognize(labelled_page(left_out, seed), models) for seed in range(1000, 1008)]
    unknown = [page for page in found if page.chosen is None]
    assert len(unknown) >= least
    for page in unknown:
        assert page.unknown_probability > page.classes[0].probability
        assert page.match is not None, "the nearest model labels the zones all the same"


def test_zones_at_random_are_of_no_class() -> None:
    rng = np.random.default_rng(3)
    for count in (4, 9, 16, 25):
        corners = rng.uniform(0, 1000, (count, 2))
        boxes = np.hstack([corners, corners + rng.uniform(10, 500, (count, 2))])
        page = page_of(*map(tuple, boxes.tolist()), width=1500.0, height=1500.0)
        assert recognize(page, models_of_all(3)).chosen is None


def test_without_models_nothing_is_labelled() -> None:
    page = labelled_page("letter", 1000)
    found = recognize(page, [])
    assert found.chosen is None
    assert found.match is None
    assert found.classes == ()
    assert [(zone.label, zone.confidence, zone.order) for zone in found.zones] == [
        (None, 0.0, order) for order in range(len(page.zones))
    ]


def test_without_zones_nothing_is_chosen() -> None:
    found = recognize(Page(100, 100, ()), models_of_all(1))
    assert (found.chosen, found.match, found.zones) == (None, None, ())


@pytest.mark.parametrize("parameters", [RecognitionParameters(explain=True), TWO_STEPS])
def test_a_zone_alone_is_labelled(parameters: RecognitionParameters) -> None:
    page = labelled_page("letter", 1000)
    (date,) = [zone for zone in page.zones if zone.label == "date"]
    found = recognize(Page(page.width, page.height, (date,)), models_of_all(3), parameters)
    assert len(found.zones) == 1
    assert found.match is not None
    assert found.match.edge_cost == 0
    assert np.isfinite(found.match.cost)


def test_the_parts_of_the_cost_and_its_terms() -> None:
    page = labelled_page("memo", 1000)
    plain = recognize(page, models_of_all(3)).match
    told = recognize(page, models_of_all(3), RecognitionParameters(explain=True)).match
    assert plain is not None
    assert told is not None
    assert plain.explanation == ()
    assert told.node_cost + told.edge_cost + told.count_cost == pytest.approx(told.cost)
    ids = {zone.id for zone in page.zones}
    assert {term.zone for term in told.explanation} <= ids
    assert {term.other for term in told.explanation} <= ids | {None}
    assert {"font", "left-left", "label"} <= {term.attribute for term in told.explanation}


def test_the_backbone_has_one_zone_of_each_label() -> None:
    page = labelled_page("two-column", 1000)
    for parameters in (RecognitionParameters(), TWO_STEPS):
        found = recognize(page, models_of_all(3), parameters)
        assert found.match is not None
        label_of = {zone.zone.id: zone.label for zone in found.zones}
        assert all(label_of[zone] == label for label, zone in found.match.backbone.items())
        assert set(found.match.backbone) == {label for label in label_of.values() if label is not None}
        assert [zone.group for zone in found.zones] == [zone.label for zone in found.zones]


def test_two_steps_find_no_lower_cost() -> None:
    for name in ("letter", "fax"):
        for seed in range(1000, 1004):
            page, model = labelled_page(name, seed), [VersionedModel(model_of(name, 3), 1)]
            direct, steps = recognize(page, model).match, recognize(page, model, TWO_STEPS).match
            assert direct is not None
            assert steps is not None
            assert steps.cost >= direct.cost - 1e-9
            assert steps.cost - steps.gap <= direct.cost + 1e-9


def test_two_steps_label_most_zones() -> None:
    found = [page for name in ("letter", "margin") for page in recognitions(name, 3, TWO_STEPS)]
    assert len(wrong(found)) <= 0.2 * zones_of(found)


def test_zones_without_label_are_learned_as_such() -> None:
    def with_scraps(seed: int) -> Page:
        """Specks below every page, which nobody labels."""
        page = labelled_page("memo", seed)
        rng = np.random.default_rng(seed)
        scraps = []
        for k in range(3):
            x, y = rng.uniform(0, 0.9 * page.width), page.height * (0.9 + 0.03 * k)
            scraps.append(Zone(f"scrap{k}", (x, y, x + 12, y + 9), kind="noise"))
        return replace(page, zones=(*page.zones, *scraps))

    model: LayoutModel = initialize_model("memo", [with_scraps(seed) for seed in range(3)])
    assert model.nodes[0].label is None
    assert model.nodes[0].zones == 9
    for seed in range(1000, 1005):
        found = recognize(with_scraps(seed), [VersionedModel(model, 1)])
        labels = {zone.zone.id: zone.label for zone in found.zones}
        assert [labels[f"scrap{k}"] for k in range(3)] == [None] * 3
        assert sum(label is None for label in labels.values()) <= 4
        assert found.match is not None
        assert None not in found.match.backbone

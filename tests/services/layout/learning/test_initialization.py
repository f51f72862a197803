"""Models from labelled pages: what they hold, and that held-out pages calibrate them."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from services.layout.graph.layout_graph import DERIVED_FEATURES
from services.layout.learning.initialization import initialize_model
from services.layout.model.layout_model import LayoutModel
from services.layout.model.model_document import model_from_document, model_to_document
from services.layout.page import Page
from services.layout.pipeline import content_features
from services.layout.recognition.classification import USUAL_DEVIATION, USUAL_MEAN
from tests.services.layout.samples import MAKERS, labelled_page, model_of, page_of

NAMES = content_features().names


def initialize(name: str, pages: Sequence[Page]) -> LayoutModel:
    return initialize_model(name, pages)


@pytest.mark.parametrize("name", MAKERS)
def test_a_model_has_a_node_of_every_label(name: str) -> None:
    pages = [labelled_page(name, seed) for seed in range(3)]
    model = model_of(name, 3)
    labels = {zone.label for page in pages for zone in page.zones}
    assert model.labels[0] is None
    assert set(model.labels[1:]) == labels
    assert list(model.labels[1:]) == sorted(labels)
    assert model.samples == 3
    assert sum(node.zones for node in model.nodes) == sum(len(page.zones) for page in pages)
    assert all(scale >= 0 for scale in model.scales.values())
    assert set(model.nodes[1].content) == {*NAMES, *DERIVED_FEATURES}
    body = next(node for node in model.nodes if node.label == ("field" if name == "fax" else "body"))
    assert 0 < body.numeric["width"].value <= 1
    assert model_to_document(model_from_document(model_to_document(model))) == model_to_document(model)


def test_one_page_leaves_what_is_usual() -> None:
    model = model_of("letter", 1)
    assert model.calibration.pages == 0
    assert (model.calibration.mean, model.calibration.deviation) == (USUAL_MEAN, USUAL_DEVIATION)


@pytest.mark.pipeline
def test_held_out_pages_calibrate() -> None:
    for name in MAKERS:
        calibration = model_of(name, 5).calibration
        assert calibration.pages == 10, "each in two views"
        assert -25 < calibration.mean < -2
        assert 0 < calibration.deviation < 3


def test_the_order_of_samples_says_nothing() -> None:
    pages = [labelled_page("memo", seed) for seed in range(3)]
    one, other = (initialize("memo", each) for each in (pages, pages[::-1]))
    assert one.labels == other.labels
    for first, second in zip(one.nodes, other.nodes, strict=True):
        assert first.numeric.keys() == second.numeric.keys()
        for key, expected in first.numeric.items():
            assert second.numeric[key].value == pytest.approx(expected.value, abs=2e-5)
    assert one.scales == pytest.approx(dict(other.scales), abs=2e-3)
    assert one.calibration.mean == pytest.approx(other.calibration.mean, abs=0.02)


def test_pages_without_zones_say_nothing() -> None:
    empty = Page(100, 100, ())
    with pytest.raises(ValueError, match="at least one page with zones"):
        initialize("none", [empty, empty])
    with pytest.raises(ValueError, match="at least one page"):
        initialize("none", [])
    page = labelled_page("memo", 0)
    assert initialize("memo", [empty, page]).samples == 1


def test_pages_without_labels_make_a_model_of_null_alone() -> None:
    page = labelled_page("memo", 0)
    bare = replace(page, zones=tuple(replace(zone, label=None) for zone in page.zones))
    model = initialize("bare", [bare, bare])
    assert model.labels == (None,)
    assert model.nodes[0].zones == 2 * len(page.zones)


def test_samples_of_one_zone_and_of_equal_zones_make_models() -> None:
    alone = page_of((10, 10, 500, 30), label="line")
    crowd = page_of(*[(10.0, 10.0, 500.0, 30.0)] * 5, label="line")
    for samples in ([alone], [alone, alone], [crowd, crowd], [alone, crowd]):
        model = initialize("odd", samples)
        assert model.labels == (None, "line")
        assert model_from_document(model_to_document(model)).samples == len(samples)


def test_a_sample_given_twice_is_surer_of_itself_but_not_certain() -> None:
    page = labelled_page("letter", 0)
    once, twice = (initialize("x", [page] * count) for count in (1, 2))
    for first, second in zip(once.nodes[1:], twice.nodes[1:], strict=True):
        assert second.zones == 2 * first.zones
        for key, expected in first.numeric.items():
            assert second.numeric[key].variance > 0.3 * expected.variance
    surer = [
        second.numeric[key].variance < expected.variance
        for first, second in zip(once.nodes[1:], twice.nodes[1:], strict=True)
        for key, expected in first.numeric.items()
    ]
    assert np.mean(surer) > 0.6

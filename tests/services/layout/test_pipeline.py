"""The steps of layout recognition in their order: image, zones, content, class and labels."""

from dataclasses import replace

import numpy as np

from services.arrays import GrayImage
from services.imaging.channels import luminance
from services.layout.model.layout_model import PieceStatistics
from services.layout.page import Page, Zone
from services.layout.pipeline import (
    complete_page,
    complete_sample,
    content_features,
    fine_page,
    initialize_model,
    read_page,
    read_words,
    recognize,
    regroup,
)
from services.layout.recognition.page_recognition import VersionedModel
from services.ocr.engine import Word
from simulation.labelled_pages import LabelledPage, letter_page, memo_page
from tests.services.layout.samples import labelled_page, model_of
from tests.services.layout.segmentation.pages import words_of


class TruthfulEngine:
    """Reads the words that the page was set from."""

    name = "truthful"

    def __init__(self, page: LabelledPage) -> None:
        self.page = page
        self.calls = 0

    def read_page(self, image: GrayImage) -> list[Word]:
        self.calls += 1
        return words_of(self.page)

    def read_line(self, image: GrayImage) -> tuple[str, float]:
        return "", 0.0


def rgb(page: LabelledPage) -> np.ndarray:
    assert page.image is not None
    return np.repeat(page.image[:, :, None], 3, axis=2)


def bare(page: LabelledPage) -> Page:
    """Boxes and labels, as a user sends them."""
    zones = tuple(Zone(zone.id, tuple(map(float, zone.box)), label=zone.label) for zone in page.zones)
    return Page(page.width, page.height, zones)


def test_zones_from_elsewhere_get_what_they_lack() -> None:
    page = memo_page(np.random.default_rng(1000))
    engine = TruthfulEngine(page)
    found = complete_page(bare(page), rgb(page), engine)
    assert engine.calls == 1
    assert [zone.text.split() for zone in found.zones] == [zone.text.split() for zone in page.zones]
    assert [zone.box for zone in found.zones] == [zone.box for zone in bare(page).zones]
    assert [zone.label for zone in found.zones] == [zone.label for zone in page.zones]
    body = next(zone for zone in found.zones if zone.label == "body")
    assert body.font_size is not None
    assert body.content.keys() == set(content_features().names)
    recognition = recognize(found, [VersionedModel(model_of("memo", 3), 1)])
    assert sum(zone.label == zone.zone.label for zone in recognition.zones) >= 0.8 * len(found.zones)


def test_what_zones_have_is_kept_and_not_read_again() -> None:
    page = memo_page(np.random.default_rng(1000))
    engine = TruthfulEngine(page)
    known = replace(
        bare(page), zones=tuple(replace(zone, text="told", font_size=99.0) for zone in bare(page).zones)
    )
    found = complete_page(known, rgb(page), engine)
    assert engine.calls == 0
    assert {zone.text for zone in found.zones} == {"told"}
    assert {zone.font_size for zone in found.zones} == {99.0}


def test_figures_and_rules_without_text_do_not_call_for_reading() -> None:
    """So what was answered for an image can be sent with it again, and costs no second reading."""
    page = memo_page(np.random.default_rng(1000))
    engine = TruthfulEngine(page)
    first, *others = bare(page).zones
    read = tuple(replace(zone, text="told") for zone in others)
    complete_page(replace(bare(page), zones=(replace(first, kind="figure"), *read)), rgb(page), engine)
    assert engine.calls == 0
    complete_page(replace(bare(page), zones=(first, *read)), rgb(page), engine)
    complete_page(replace(bare(page), zones=(replace(first, kind="figure"),)), rgb(page), engine)
    assert engine.calls == 2


def test_without_image_zones_stay_as_they_are() -> None:
    page = labelled_page("memo", 0)
    assert complete_page(page, None, None) == page
    assert complete_sample(page, None, None) == (page, None)


def test_a_page_image_is_read_and_a_sample_is_seen_as_it_will_be() -> None:
    page = memo_page(np.random.default_rng(1000))
    engine = TruthfulEngine(page)
    found = read_page(rgb(page), engine)
    assert len(found.zones) >= 4
    assert any("memo" in zone.text.lower() for zone in found.zones)
    assert all(zone.label is None for zone in found.zones)
    verified, seen = complete_sample(bare(page), rgb(page), engine)
    assert [zone.label for zone in verified.zones] == [zone.label for zone in page.zones]
    assert seen is not None, "no segmenter finds just the boxes of the truth"
    assert {zone.label for zone in seen.zones} - {None} <= {zone.label for zone in page.zones}
    assert len({zone.label for zone in seen.zones} - {None}) >= 4


def test_labelled_samples_make_a_model_that_labels() -> None:
    bare_content = [
        replace(page, zones=tuple(replace(zone, content={}) for zone in page.zones))
        for page in (labelled_page("fax", seed) for seed in range(3))
    ]
    model = initialize_model("fax", bare_content)
    assert model.labels == model_of("fax", 3).labels
    assert dict(model.scales) == dict(model_of("fax", 3).scales), "content was measured on the way"
    found = recognize(labelled_page("fax", 1000), [VersionedModel(model, 7)])
    assert found.chosen is not None
    assert (found.chosen.name, found.chosen.model_version) == ("fax", 7)
    assert set(found.timings_ms) == {"content", "matching", "classification"}


def test_settings_are_read_once() -> None:
    assert content_features() is content_features()


class SeeingEngine(TruthfulEngine):
    """Keeps the image that it was given."""

    def read_page(self, image: GrayImage) -> list[Word]:
        self.seen = image
        return super().read_page(image)


def test_a_page_is_read_in_even_light() -> None:
    page = letter_page(np.random.default_rng(2))
    assert page.image is not None
    shadow = np.linspace(1.0, 0.45, page.image.shape[1])
    shaded = (page.image * shadow).astype(np.uint8)
    engine = SeeingEngine(page)
    read_page(np.repeat(shaded[..., None], 3, axis=2), engine)
    right = engine.seen[:, -200:]
    assert np.median(shaded[:, -200:]) < 130
    assert np.median(right) > 250
    inverse = 255 - page.image
    read_page(np.repeat(inverse[..., None], 3, axis=2), engine)
    np.testing.assert_array_equal(engine.seen, inverse)


def test_pieces_are_put_together_and_the_class_stays() -> None:
    """A model joins labels that it has learned to come in pieces, and no others."""
    page = memo_page(np.random.default_rng(1000))
    seen, fine = fine_page(rgb(page), read_words(luminance(rgb(page)), TruthfulEngine(page)))
    plain = model_of("memo", 3)

    def taught(joining: float) -> list[VersionedModel]:
        pieces = PieceStatistics(joining, whole=9.0 * (joining < 0), divided=9.0 * (joining > 0))
        nodes = tuple(replace(node, pieces=pieces) for node in plain.nodes)
        return [VersionedModel(replace(plain, nodes=nodes), 7)]

    first = recognize(seen, taught(0.0))
    apart, joined = (regroup(fine, first, taught(value)) for value in (-20.0, 20.0))
    assert apart.page == first.page
    assert len(joined.page.zones) < len(first.page.zones)
    assert joined.chosen is not None
    assert joined.match is not None
    assert joined.chosen == replace(first.chosen, cost=joined.match.cost), "what is whole was labelled again"
    assert len(joined.zones) == len(joined.page.zones)
    for found in (first, joined):
        assert [each.zone.id for each in found.zones] == [zone.id for zone in found.page.zones]
    texts = [sorted(word.text for zone in each.page.zones for word in zone.words) for each in (first, joined)]
    assert texts[0] == texts[1], "no word is lost"
    for zone in first.zones:  # each lies in a zone of its label
        assert any(
            each.label == zone.label
            and each.zone.box[0] <= zone.zone.box[0]
            and each.zone.box[3] >= zone.zone.box[3]
            for each in joined.zones
        )
    assert set(joined.match.backbone.values()) <= {zone.id for zone in joined.page.zones}
    unknown = replace(first, chosen=None)
    assert regroup(fine, unknown, taught(20.0)) is unknown

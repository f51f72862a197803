"""Neighbours in one print that samples label apart: each is a zone with its label, after samples or one feedback."""

import numpy as np
import pytest

from services.contract.layout_learning import VerifiedPage
from services.imaging.channels import luminance
from services.layout.content.content_features import content_features
from services.layout.learning.feedback import adapt_models
from services.layout.model.layout_model import LayoutModel
from services.layout.page import Page, Zone
from services.layout.pipeline import (
    VersionedModel,
    complete_recognition,
    complete_sample,
    fine_page,
    initialize_model,
    read_words,
    recognize,
)
from services.layout.recognition.results import Recognition
from services.layout.segmentation import FinePage
from simulation import invented
from simulation.labelled_zones import LabelledPage, ZoneSetter
from tests.services.layout.test_pipeline import TruthfulEngine, bare, rgb

STACKS = {
    "order": ("customer", "address"),
    "contact": ("name", "phone", "mail"),
}


def form(kind: str, seed: int) -> LabelledPage:
    """A form with a stack of lines in one print, which have labels of their own."""
    rng = np.random.default_rng([seed, len(kind)])
    setter = ZoneSetter(900, 1200)
    dx, dy = rng.uniform(-6, 6, 2)
    setter.text("company", ["ACME SERVICE"], 70 + dx, 60 + dy, 30)
    setter.text("title", ["WORK ORDER"], 600 + dx, 66 + dy, 22)
    street = [invented.street(rng), invented.town(rng)]
    lines = [[invented.firm(rng)], street]
    if kind == "contact":
        lines = [
            [invented.person(rng)],
            [invented.phone(rng)],
            [f"{street[1].split()[0].lower()}@example.org"],
        ]
    y = 190 + dy
    for label, texts in zip(STACKS[kind], lines, strict=True):
        y = setter.text(label, texts, 70 + dx, y, 18, leading=1.35)
    for row in range(int(rng.integers(3, 6))):
        setter.text("item", [invented.pick(rng, invented.POSITIONS)], 70 + dx, 400 + 50 * row + dy, 15)
    setter.text("footer", ["Thank you for your order."], 70 + dx, 1100 + dy, 15)
    return setter.page("order")


def learned(kind: str, samples: int) -> LayoutModel:
    pages = [form(kind, 1 + seed) for seed in range(samples)]
    views = [complete_sample(bare(page), rgb(page), TruthfulEngine(page)) for page in pages]
    return initialize_model("order", [verified for verified, _ in views], found=[found for _, found in views])


def segmented(page: LabelledPage) -> tuple[Page, FinePage]:
    image = rgb(page)
    return fine_page(image, read_words(luminance(image), TruthfulEngine(page)))


def recognized(page: LabelledPage, model: LayoutModel) -> Recognition:
    own, fine = segmented(page)
    models = [VersionedModel(model, 1)]
    return complete_recognition(fine, recognize(own, models), models)


def zones_of_stack(kind: str, seen: Recognition) -> list[tuple[str | None, int | None]]:
    return [
        (each.label, each.zone.lines)
        for each in sorted(seen.zones, key=lambda each: each.order)
        if each.label in STACKS[kind]
    ]


@pytest.mark.parametrize("kind", STACKS)
@pytest.mark.parametrize("samples", [1, 3])
def test_from_samples(kind: str, samples: int) -> None:
    model = learned(kind, samples)
    assert all(node.pieces.merged == samples for node in model.nodes if node.label in STACKS[kind])
    pages = [form(kind, seed) for seed in (10, 12)]
    blocks = [len(segmented(page)[1].blocks) for page in pages]
    assert sum(blocks) < sum(len(page.zones) for page in pages), "segmentation merges some of them"
    for page in pages:
        expected = [(zone.label, zone.lines) for zone in page.zones if zone.label in STACKS[kind]]
        assert zones_of_stack(kind, recognized(page, model)) == expected


def test_after_one_feedback() -> None:
    """The samples came without images, so that nobody knew what segmentation does; the person draws the zones."""
    pages = [form("order", 1 + seed) for seed in range(3)]
    model = initialize_model("order", [complete_sample(bare(page), None, None)[0] for page in pages])
    page = form("order", 5)
    seen = recognized(page, model)
    verified, _ = complete_sample(bare(page), rgb(page), TruthfulEngine(page))
    given = {zone.id: zone.label for zone in verified.zones}
    _, after = adapt_models(
        VerifiedPage(verified, "order", dict.fromkeys(given), "order", given, seen.page),
        {"order": model},
        {},
        content_features().names,
    )
    later = form("order", 12)
    expected = [(zone.label, zone.lines) for zone in later.zones if zone.label in STACKS["order"]]
    assert zones_of_stack("order", recognized(later, after["order"].model)) == expected


def test_a_zone_that_samples_label_otherwise_is_not_sure() -> None:
    """Somebody else's segmentation has one zone; nothing can cut it, and no label of it is nearly certain."""
    model = learned("order", 3)
    page = form("order", 10)
    verified, _ = complete_sample(bare(page), rgb(page), TruthfulEngine(page))
    upper, lower = (zone for zone in verified.zones if zone.label in STACKS["order"])
    x0, y0, x1, y1 = zip(upper.box, lower.box, strict=True)
    both = Zone(
        "both",
        (min(x0), min(y0), max(x1), max(y1)),
        lines=3,
        font_size=upper.font_size,
        line_spacing=lower.line_spacing,
        weight=upper.weight,
        alignment="left",
        appearance=lower.appearance,
        text=f"{upper.text}\n{lower.text}",
    )
    zones = (*(zone for zone in verified.zones if zone not in (upper, lower)), both)
    models = [VersionedModel(model, 1)]
    seen = complete_recognition(None, recognize(Page(verified.width, verified.height, zones), models), models)
    [one] = [each for each in seen.zones if each.zone.id == "both"]
    others = [each.confidence for each in seen.zones if each.label == "company"]
    assert one.confidence < 0.9 < min(others)

"""Measuring zones that came from elsewhere."""

from dataclasses import replace

import numpy as np
import pytest

from services.layout.page import Page, Zone
from services.layout.segmentation import measure_zones
from tests.services.layout.segmentation.pages import drawing, sample


def bare(kind: str, seed: int) -> Page:
    truth = sample(kind, seed)
    zones = tuple(
        Zone(zone.id, zone.box, kind=zone.kind, text=zone.text, label=zone.label) for zone in truth.zones
    )
    return Page(float(truth.width), float(truth.height), zones)


def test_what_is_missing_is_measured() -> None:
    truth, page = sample("two-column", 1), bare("two-column", 1)
    measured = measure_zones(drawing(truth), page)
    for zone, before, after in zip(truth.zones, page.zones, measured.zones, strict=True):
        assert (after.id, after.box, after.text, after.label) == (
            before.id,
            before.box,
            before.text,
            before.label,
        )
        if zone.kind != "text":
            assert replace(after, appearance=None) == before
            continue
        assert after.lines == zone.lines
        assert after.font_size == pytest.approx(zone.font_size, rel=0.2)
        assert after.weight is not None
        assert (after.line_spacing is None) == (zone.lines == 1)


def test_what_is_known_stays() -> None:
    image = drawing(sample("letter", 1))
    known = Zone("a", (0.0, 0.0, 1275.0, 1650.0), lines=99, font_size=1.5, line_spacing=2.5, weight=0.5)
    [after] = measure_zones(image, Page(1275.0, 1650.0, (known,))).zones
    assert (after.lines, after.font_size, after.line_spacing, after.weight) == (99, 1.5, 2.5, 0.5)
    assert after.alignment is not None


@pytest.mark.parametrize(
    "box", [(-500.0, -500.0, -10.0, -10.0), (1e9, 1e9, 2e9, 2e9), (600.0, 1600.0, 601.0, 1601.0)]
)
def test_zones_without_print_are_left_alone(box: tuple[float, float, float, float]) -> None:
    page = Page(1275.0, 1650.0, (Zone("a", box), Zone("b", box, kind="figure")))
    assert measure_zones(drawing(sample("letter", 1)), page) == page
    assert measure_zones(np.full((50, 50), 255, dtype=np.uint8), page) == page

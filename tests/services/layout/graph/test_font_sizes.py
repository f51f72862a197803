"""Font sizes: the em measured or estimated, the body's among other sizes, and classes against it."""

import pytest

from services.layout.graph.font_sizes import body_font_size, estimate_font_size, measure_font_classes
from services.layout.page import Page, Zone


def zone(height: float, **known: object) -> Zone:
    return Zone(id="z", box=(0.0, 0.0, 400.0, height), **known)  # type: ignore[arg-type]


def page(*zones: Zone) -> Page:
    return Page(1000.0, 1400.0, zones)


@pytest.mark.parametrize(
    ("sample", "em"),
    [
        (zone(100, font_size=21.0, line_spacing=60.0, lines=3), 21.0),
        (zone(100, line_spacing=24.0), 20.0),
        (zone(18, lines=1), 20.0),
        (zone(4 * 24 + 18, lines=5), 20.0),
        (zone(24 + 18, text="one\ntwo"), 20.0),
    ],
)
def test_the_em_is_the_best_that_is_known(sample: Zone, em: float) -> None:
    assert estimate_font_size(sample) == pytest.approx(em)


@pytest.mark.parametrize(
    "sample",
    [zone(50), zone(50, lines=0), zone(50, font_size=0.0), zone(50, kind="figure", font_size=12.0, lines=2)],
)
def test_nothing_is_made_up(sample: Zone) -> None:
    assert estimate_font_size(sample) is None
    assert body_font_size(page(sample)) is None
    assert measure_font_classes(page(sample)) == [None]


def test_an_empty_page_has_no_body() -> None:
    assert body_font_size(page()) is None
    assert measure_font_classes(page()) == []


def test_the_body_is_what_most_text_is_set_in() -> None:
    body = [zone(250, font_size=size, lines=10) for size in (19.9, 20.0, 20.1)]
    notes = [zone(20, font_size=16.0, lines=1) for _ in range(12)]
    title = zone(60, font_size=36.0, lines=1)
    found = page(title, *notes, *body)
    assert body_font_size(found) == pytest.approx(20.0)
    assert measure_font_classes(found) == ["large", *["small"] * 12, *["normal"] * 3]


def test_classes_do_not_depend_on_resolution() -> None:
    sizes = (9.0, 10.0, 11.0, 10.2, 9.8, 14.0)
    zones = [zone(200, font_size=size, lines=10) for size in sizes]
    enlarged = [zone(800, font_size=4 * size, lines=10) for size in sizes]
    classes = measure_font_classes(page(*zones))
    assert classes == measure_font_classes(page(*enlarged))
    assert classes == ["small", "normal", "large", "normal", "normal", "large"]


def test_an_estimated_size_needs_more_to_be_another() -> None:
    body = zone(234, font_size=20.0, lines=10)
    assert measure_font_classes(page(body, zone(22.5, lines=1), zone(36, lines=1)))[1:] == ["normal", "large"]

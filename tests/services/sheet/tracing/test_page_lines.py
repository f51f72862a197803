"""Rules are traced to a fraction of a pixel and letters are none; profiles stand in where characters do not chain."""

import numpy as np
import pytest

from services.arrays import Floats, GrayImage, Points
from services.geometry.page_map import PlaneMap
from services.geometry.photo_frame import PhotoFrame
from services.sheet.developable.observations import NO_LINES
from services.sheet.tracing.page_lines import trace_lines, traced_length
from services.sheet.tracing.page_text import TracedText
from services.sheet.tracing.rule_tracing import trace_rules
from tests.services.sheet.tracing.test_profile_tracing import words

SIZE = (700, 500)
VIEW = PhotoFrame(*SIZE)
FLAT = PlaneMap(np.eye(3))
TEXT_PX = 10.0


def gray_of(darkness: Floats) -> GrayImage:
    return np.asarray(np.round(255 * (1 - darkness)), np.uint8)


def rules(places: Floats, sag_px: float = 0.0) -> Floats:
    """Darkness (H, W) of thin strokes at heights `places`, in the middle by `sag_px` lower."""
    dark = np.zeros(SIZE[::-1], np.float32)
    y, x = np.arange(SIZE[1])[:, None], np.arange(SIZE[0])
    for place in places:
        at = place + sag_px * np.sin(np.pi * x / SIZE[0])
        dark = np.maximum(dark, 0.7 * np.clip(1.3 - np.abs(y - at), 0, 1) * ((x > 60) & (x < 640)))
    return dark


def page(darkness: Floats, positive: GrayImage | None = None) -> TracedText:
    """Text at the corners of a grid, so that the whole picture is looked at."""
    x, y = np.meshgrid(np.linspace(60, 640, 8), np.linspace(60, 440, 6))
    ink = darkness > 0.4
    return TracedText(
        gray_of(darkness),
        ink,
        np.ones_like(ink),
        1.0,
        np.column_stack([x.ravel(), y.ravel()]),
        TEXT_PX,
        positive,
    )


def in_photo(points: Points) -> Points:
    return VIEW.to_photo(points)


STAVES = np.concatenate([60.3 + 9 * np.arange(5), 200.6 + 9 * np.arange(5), 340.1 + 9 * np.arange(5)])


@pytest.mark.parametrize("sag_px", [0.0, 12.0])
@pytest.mark.parametrize("negative", [False, True])
def test_rules_are_traced_to_a_fraction_of_a_pixel(sag_px: float, *, negative: bool) -> None:
    drawn = rules(STAVES, sag_px)
    text = page(np.zeros_like(drawn), gray_of(drawn)) if negative else page(drawn)
    found = trace_rules(text, VIEW, FLAT)
    assert found.count == len(STAVES)
    for k in range(found.count):
        x, y = in_photo(found.points[found.index == k]).T
        off = y - sag_px * np.sin(np.pi * x / SIZE[0])
        nearest = STAVES[int(np.argmin(np.abs(STAVES - np.median(off))))]
        assert np.abs(off - nearest).max() < 0.5
        assert np.ptp(x) > 500


def test_lines_of_letters_are_no_rules() -> None:
    baselines = 60.3 + 24 * np.arange(15)[:, None] + np.zeros(SIZE[0])
    assert trace_rules(page(words(baselines, size=SIZE)), VIEW, FLAT).count == 0
    assert trace_rules(page(np.zeros(SIZE[::-1])), VIEW, FLAT) is NO_LINES


def test_rules_stand_beside_few_lines_of_text() -> None:
    drawn = np.maximum(rules(STAVES), words(np.array([[120.0], [150.0]]) + np.zeros(SIZE[0]), size=SIZE))
    found = trace_lines(page(drawn), VIEW, FLAT)
    assert found.count >= len(STAVES)
    assert traced_length(found) > 0.9 * len(STAVES) * 560 / VIEW.unit_px


def test_letters_that_hang_together_are_traced_by_profiles() -> None:
    baselines = 60.3 + 30 * np.arange(12)[:, None] + np.zeros(SIZE[0])
    drawn = words(baselines, size=SIZE)
    # A stroke at the head of the letters joins those of a word, as in Devanagari; words chain no better.
    for base in baselines[:, 0]:
        row = round(base - 8)
        drawn[row - 1 : row + 1] = np.maximum(
            drawn[row - 1 : row + 1], np.tile(np.arange(SIZE[0]) % 97 < 88, (2, 1))
        )
    drawn[:, :40] = drawn[:, 660:] = 0
    found = trace_lines(page(drawn), VIEW, FLAT)
    assert traced_length(found) > 0.8 * 12 * 600 / VIEW.unit_px

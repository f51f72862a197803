"""Whole sheets on their ground: frame, margins, light, shadow."""

import numpy as np
import pytest

from simulation.degradation import PHONE
from simulation.flat_page import Page, PageWord
from simulation.folded import folded_in_thirds
from simulation.sheets import SHEET_ASPECT, SHEET_VIEWS, Staging, photograph_sheet, with_margins

SIZE = (210, 270)
PRINT = Page(np.full((200, 152), 40, np.uint8), ((PageWord("word", (10.0, 20.0, 30.0, 32.0)),),))


def test_margins_are_white_and_the_words_move_along() -> None:
    sheet = with_margins(PRINT)
    assert (sheet.width, sheet.height) == (200, round(200 * SHEET_ASPECT))
    ys, xs = np.nonzero(sheet.image < 255)
    assert (xs.min(), xs.max(), len(xs)) == (24, 175, 152 * 200)
    x0, y0, x1, y1 = sheet.lines[0][0].box
    assert (x0 - xs.min(), y0 - ys.min(), x1 - x0, y1 - y0) == (10.0, 20.0, 20.0, 12.0)
    high = with_margins(Page(np.zeros((600, 152), np.uint8)))
    assert high.height / high.width == pytest.approx(SHEET_ASPECT, abs=0.01)
    assert high.height == 600 + 48


@pytest.mark.parametrize("margin", [0.05, 0.1])
def test_the_whole_sheet_is_in_view(margin: float) -> None:
    sheet = with_margins(PRINT)
    shape = folded_in_thirds(sheet.half_height_units, 20, -25)
    for view in SHEET_VIEWS:
        photo = photograph_sheet(
            sheet, view, shape, Staging(margin=margin), rng=np.random.default_rng(1), size=SIZE
        )
        outline = photo.truth.outline()
        least = min(outline.min(axis=0).min(), (np.array(SIZE) - 1 - outline.max(axis=0)).min())
        assert least > 0.8 * margin * min(SIZE)


def test_no_side_is_in_view_with_a_negative_margin() -> None:
    sheet = with_margins(PRINT)
    shape = folded_in_thirds(sheet.half_height_units, 20, -25)
    staging = Staging(margin=-0.1)
    photo = photograph_sheet(sheet, SHEET_VIEWS[0], shape, staging, rng=np.random.default_rng(1), size=SIZE)
    outline = photo.truth.outline()
    low, high = outline.min(axis=0), outline.max(axis=0)
    assert np.any(low < 0)
    assert np.any(high > np.array(SIZE) - 1)


def test_panels_shade_by_their_normals() -> None:
    blank = Page(np.full((283, 200), 255, np.uint8))
    shape = folded_in_thirds(blank.half_height_units, 25, 25)
    staging = Staging("black", lamp_deg=270.0, lamp_height_deg=40.0)
    photo = photograph_sheet(blank, SHEET_VIEWS[0], shape, staging, rng=np.random.default_rng(1), size=SIZE)
    heights = np.array([[0.0, -1.0], [0.0, 0.0], [0.0, 1.0]])
    at = np.round(photo.truth.sheet_to_photo(heights)).astype(int)
    head, middle, foot = (float(photo.image[y, x, 0]) for x, y in at)
    # The lamp is above: the head, which rises towards the viewer, turns away from it, and the foot to it.
    assert head < middle - 15 < foot - 30
    assert foot < 255


def test_the_sheet_throws_a_shadow_away_from_the_lamp() -> None:
    sheet = with_margins(PRINT)
    shape = folded_in_thirds(sheet.half_height_units, 30, 30)
    staging = Staging("white", lamp_deg=180.0, lamp_height_deg=30.0, margin=0.1)
    photo = photograph_sheet(sheet, SHEET_VIEWS[0], shape, staging, rng=np.random.default_rng(1), size=SIZE)
    edge = photo.truth.sheet_to_photo(np.array([[-1.0, -1.2], [1.0, -1.2]]))
    left, right = (int(v) for v in edge[:, 0])
    row = photo.image[round(edge[0, 1]), :, 0].astype(int)
    assert row[right + 4] < row[left - 5] - 20
    assert row[left - 8] == pytest.approx(row[0], abs=3)


def test_the_same_seed_gives_the_same_photo() -> None:
    sheet = with_margins(PRINT)
    shape = folded_in_thirds(sheet.half_height_units, 20, -25)
    first, again, other = (
        photograph_sheet(
            sheet, SHEET_VIEWS[1], shape, Staging(), dirt=PHONE, rng=np.random.default_rng(seed), size=SIZE
        ).image
        for seed in (1, 1, 2)
    )
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)

"""One polygon says where the paper ends, by the surest evidence; print and doubt keep what lies beyond."""

from dataclasses import replace

import numpy as np
import pytest

from services.arrays import Points
from services.rectify.shape_choice.shaped_page import ShapedPage
from services.rectify.view.paper_end import filled_hull, find_paper_end
from services.rectify.view.print_kept import sheet_print
from tests.services.rectify.view.test_print_kept import flat_page
from tests.services.scenes import Album, Shot
from tests.services.sheet.sheet_sides import outline_of

pytestmark = pytest.mark.pipeline


@pytest.fixture(scope="module")
def shot() -> Shot:
    return Album()["plain"]


def with_outline(shot: Shot, share: float = 1.0, confidence: float = 0.95) -> ShapedPage:
    """The page with an outline round this share of its text's width."""
    page = flat_page(shot)
    low, high = page.characters.min(axis=0) - 60, page.characters.max(axis=0) + 60
    right = low[0] + share * (high[0] - low[0])
    corners = np.array([low, [right, low[1]], [right, high[1]], [low[0], high[1]]])
    outline = outline_of(corners, 0.3, np.random.default_rng(0))
    return replace(page, outline=replace(outline, confidence=confidence))


def test_the_paper_ends_at_a_believed_outline(shot: Shot) -> None:
    page = with_outline(shot)
    found = find_paper_end(page, "sheet", sheet_print(page))
    assert page.outline is not None
    assert found.reach is page.outline.polygon
    assert found.white is page.outline.polygon
    assert found.whole


@pytest.mark.parametrize(("share", "confidence"), [(1.0, 0.7), (0.8, 0.95)])
def test_it_does_not_end_at_a_doubtful_one_or_one_that_leaves_text_out(
    shot: Shot, share: float, confidence: float
) -> None:
    page = with_outline(shot, share, confidence)
    found = find_paper_end(page, "sheet", sheet_print(page))
    assert page.outline is not None
    assert found.reach is not page.outline.polygon
    assert found.white is None or found.white is not page.outline.polygon


def test_print_beyond_it_is_not_drawn_white(shot: Shot) -> None:
    page = with_outline(shot)
    boxes = sheet_print(page)
    beside = boxes[:4] - boxes[:4].mean(axis=(0, 1)) + (page.characters.max(axis=0) + 200)
    found = find_paper_end(page, "sheet", np.concatenate([boxes, beside]))
    assert found.white is None
    assert found.reach is not None


def test_nothing_ends_between_given_corners_or_where_no_sheet_is_wanted(shot: Shot) -> None:
    page = with_outline(shot)
    boxes = sheet_print(page)
    given = replace(page, corners=np.zeros((4, 2)))
    for found in (find_paper_end(given, "sheet", boxes), find_paper_end(page, "photo", boxes)):
        assert found.reach is None
        assert found.white is None
        assert not found.whole


SHEETS: dict[str, tuple[Points, bool]] = {
    "whole": (np.array([[0.0, 0.0], [500.0, 0.0], [500.0, 700.0], [0.0, 700.0]]), True),
    "leaning": (np.array([[100.0, 40.0], [900.0, 90.0], [860.0, 1250.0], [60.0, 1180.0]]), True),
    "torn": (
        np.array([[0.0, 0.0], [500.0, 0.0], [500.0, 700.0], [250.0, 550.0], [0.0, 700.0]]),
        False,
    ),
    "opened book": (
        np.array([[0.0, 0.0], [400.0, 60.0], [800.0, 0.0], [800.0, 500.0], [400.0, 440.0], [0.0, 500.0]]),
        False,
    ),
}


@pytest.mark.parametrize("name", SHEETS)
def test_one_whole_sheet_fills_its_hull(name: str) -> None:
    outline, is_whole = SHEETS[name]
    hull = filled_hull(outline)
    assert (hull is not None) == is_whole
    assert hull is None or np.abs(hull[:, None] - outline[None]).sum(axis=2).min(axis=0).max() == 0

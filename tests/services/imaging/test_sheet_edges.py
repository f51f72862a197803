"""Edges of the sheet beside its text: page stacks, gutters and desks are told from frames, rules and pictures."""

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from services.arrays import Points
from services.imaging.sheet_edges import SheetEdges, find_sheet_edges
from simulation.degradation import desk_texture
from simulation.flat_page import Page
from simulation.pages import own_pages

Rgb = NDArray[np.uint8]
Gray = NDArray[np.float64]
LEFT, RIGHT, TOP, BOTTOM = 90, 110, 54, 58
"""Pixels of other things round the page in the drawn views."""


@pytest.fixture(scope="module")
def pages() -> tuple[Page, ...]:
    """Small pages: characters of 6 px."""
    return own_pages(420, 656)


def characters(page: Page) -> Points:
    """Points (N, 2) px on the page's words, about one a character."""
    points = [
        (x, 0.5 * (y0 + y1))
        for line in page.lines
        for x0, y0, x1, y1 in (word.box for word in line)
        for x in np.arange(x0 + 3, x1, 6.0)
    ]
    return np.array(points)


def as_view(gray: Gray, seed: int = 0) -> Rgb:
    """Warm light that falls off, a little noise, three channels."""
    rng = np.random.default_rng(seed)
    rows, columns = gray.shape
    light = 0.75 + 0.25 * np.linspace(0, 1, columns) * np.linspace(1, 0.6, rows)[:, None]
    noisy = gray * light + 2.0 * rng.standard_normal(gray.shape)
    return np.clip(noisy[..., None] * [1.0, 0.96, 0.88], 0, 255).astype(np.uint8)


def page_on(ground: Gray, page: Page) -> Gray:
    """The page on a ground that is larger by LEFT, RIGHT, TOP and BOTTOM."""
    view = ground.copy()
    view[TOP : TOP + page.height, LEFT : LEFT + page.width] = 0.9 * page.image.reshape(
        page.height, page.width
    )
    return view


def size_of_view(page: Page) -> tuple[int, int]:
    """(rows, columns) of `page_on`."""
    return page.height + TOP + BOTTOM, page.width + LEFT + RIGHT


def text_of_view(page: Page) -> Points:
    """Characters as they lie in `page_on`."""
    return np.asarray(characters(page) + np.array([LEFT, TOP]))


def sheared(view: Rgb, slope: float) -> Rgb:
    """Columns shifted by `slope` px a row about the middle row."""
    H = np.array([[1.0, slope, -slope * view.shape[0] / 2], [0.0, 1.0, 0.0]])
    turned = cv2.warpAffine(view, H, (view.shape[1], view.shape[0]), borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(turned, np.uint8)


def book(page: Page, seed: int = 0) -> Gray:
    """A page of a book: its stack at the left, gutter and facing page at the right, a dark desk above and below."""
    rng = np.random.default_rng(seed)
    rows, columns = size_of_view(page)
    view = np.full((rows, columns), 230.0)
    # Edges of sheets: streaks of a few gray values, one or two pixels wide.
    view[:, :LEFT] -= np.repeat(rng.uniform(0, 40, LEFT // 2), 2)
    view[:, LEFT - 2 : LEFT] = 205.0
    gutter = LEFT + page.width
    x = np.arange(columns - gutter)
    view[:, gutter:] = 225.0 - 90.0 * np.exp(-x / 25.0)
    view = page_on(view, page)
    # The page's own shade towards the gutter.
    view[:, gutter - 30 : gutter] *= 1.0 - 0.25 * np.linspace(0, 1, 30) ** 2
    view[:TOP] = view[-BOTTOM:] = 60.0
    return np.asarray(view)


@pytest.mark.parametrize("number", range(5))
@pytest.mark.parametrize("slope", [0.0, 0.04])
def test_a_page_of_a_book_ends_at_its_stack_and_its_gutter(
    pages: tuple[Page, ...], number: int, slope: float
) -> None:
    page = pages[number]
    view = sheared(as_view(book(page)), slope)
    text = text_of_view(page)
    text[:, 0] += slope * (text[:, 1] - view.shape[0] / 2)
    edges = find_sheet_edges(view, text, 6.0)
    bend = 0.25 * slope * page.height
    assert edges.left is not None
    assert edges.right is not None
    assert LEFT - bend - 6 < edges.left < LEFT + 1
    assert LEFT + page.width - 2 < edges.right < LEFT + page.width + bend + 8
    if slope == 0.0:
        assert edges.top is not None
        assert edges.bottom is not None
        assert TOP - 6 < edges.top <= TOP
        assert TOP + page.height - 1 <= edges.bottom < TOP + page.height + 6


def test_characters_read_in_the_stack_do_not_hide_the_edge(pages: tuple[Page, ...]) -> None:
    text = text_of_view(pages[0])
    junk = np.array([[20.0, 300.0], [26.0, 302.0], [32.0, 300.0], [60.0, 500.0]])
    edges = find_sheet_edges(as_view(book(pages[0])), np.concatenate([text, junk]), 6.0)
    assert edges.left is not None
    assert LEFT - 6 < edges.left < LEFT + 1


def test_a_sheet_on_a_desk(pages: tuple[Page, ...]) -> None:
    page = pages[1]
    rows, columns = size_of_view(page)
    desk = 0.6 * desk_texture(columns, rows, np.random.default_rng(3)).mean(axis=2)
    edges = find_sheet_edges(as_view(page_on(desk, page)), text_of_view(page), 6.0)
    found = np.array([edges.left, edges.top, edges.right, edges.bottom], float)
    assert np.abs(found - [LEFT, TOP, LEFT + page.width - 1, TOP + page.height - 1]).max() < 6


@pytest.mark.parametrize("number", range(5))
def test_nothing_is_cut_where_no_edge_is_seen(pages: tuple[Page, ...], number: int) -> None:
    page = pages[number]
    view = as_view(page_on(np.full(size_of_view(page), 229.5), page))
    assert find_sheet_edges(view, text_of_view(page), 6.0) == SheetEdges()


def box_round_the_text(page: Page, margin: int) -> tuple[tuple[int, int], tuple[int, int]]:
    """Corners of the text's box, larger by `margin`."""
    low, high = text_of_view(page).min(axis=0) - margin, text_of_view(page).max(axis=0) + margin
    return (int(low[0]), int(low[1])), (int(high[0]), int(high[1]))


@pytest.mark.parametrize("margin", [8, 14, 22])
def test_frames_and_rules_are_printed(pages: tuple[Page, ...], margin: int) -> None:
    page = pages[0]
    plain = page_on(np.full(size_of_view(page), 229.5), page)
    low, high = box_round_the_text(page, margin)
    framed = np.asarray(cv2.rectangle(plain.copy(), low, high, 30.0, 2), np.float64)
    assert find_sheet_edges(as_view(framed), text_of_view(page), 6.0) == SheetEdges()
    tinted = plain.copy()
    tinted[low[1] : high[1], low[0] : high[0]] *= 0.85
    assert find_sheet_edges(as_view(tinted), text_of_view(page), 6.0) == SheetEdges()


def test_a_picture_beside_the_text_is_printed(pages: tuple[Page, ...]) -> None:
    page = pages[0]
    view = page_on(np.full(size_of_view(page), 229.5), page)
    _, (_, bottom) = box_round_the_text(page, 0)
    view[TOP + 60 : bottom, 20:80] = 90.0
    assert find_sheet_edges(as_view(view), text_of_view(page), 6.0) == SheetEdges()


def test_a_dark_band_across_the_sheet_stays(pages: tuple[Page, ...]) -> None:
    page = pages[0]
    rows, columns = size_of_view(page)
    image = page.image.reshape(page.height, page.width).copy()
    first = int(characters(page)[:, 1].min()) - 12
    image[:first] = 110
    assert first > 20
    headed = Page(image, page.lines)
    ground = np.full((rows, columns), 45.0)
    edges = find_sheet_edges(as_view(page_on(ground, headed)), text_of_view(page), 6.0)
    assert edges.top is None or edges.top <= TOP
    assert edges.left is not None
    assert abs(edges.left - LEFT) < 6


@pytest.mark.parametrize("fading", [0, 110])
def test_a_sheet_ends_where_the_desk_lies_on_both_sides_of_its_own_sides(
    pages: tuple[Page, ...], fading: int
) -> None:
    page = pages[0]
    rows, columns = size_of_view(page)
    view = page_on(np.full((rows, columns), 60.0), page)
    first, last = TOP + page.height - fading, TOP + page.height
    # The paper curls up: towards its foot its sides fade.
    for row in range(first, last):
        fall = np.geomspace(60.0, 229.0, 2 + row - first)
        view[row, LEFT : LEFT + len(fall)] = fall
        view[row, LEFT + page.width - len(fall) : LEFT + page.width] = fall[::-1]
    text = text_of_view(page)
    edges = find_sheet_edges(as_view(view), text[text[:, 1] < last - 170], 6.0)
    assert edges.bottom is not None
    assert TOP + page.height - 1 <= edges.bottom < TOP + page.height + 6


def test_the_end_of_the_photo_is_no_edge(pages: tuple[Page, ...]) -> None:
    page = pages[2]
    view = as_view(page_on(np.full(size_of_view(page), 229.5), page))
    seen = np.ones(view.shape[:2], bool)
    seen[:, :40] = seen[:, -50:] = seen[:10] = seen[-12:] = False
    view[~seen] = 255
    assert find_sheet_edges(view, text_of_view(page), 6.0, seen) == SheetEdges()


def test_too_little_text_tells_nothing(pages: tuple[Page, ...]) -> None:
    assert find_sheet_edges(as_view(book(pages[0])), text_of_view(pages[0])[:12], 6.0) == SheetEdges()
    nowhere = np.full((100, 2), np.nan)
    assert find_sheet_edges(as_view(book(pages[0])), nowhere, 6.0) == SheetEdges()

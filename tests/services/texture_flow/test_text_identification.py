"""Characters of set pages are found; rules, borders, blobs and pictures beside them are not."""

from collections.abc import Callable

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from services.texture_flow.text_identification import (
    IdentifiedText,
    binarize_niblack,
    detect_edges,
    find_text_area,
    identify_text,
    keep_characters,
    measure_strokes,
)
from simulation.degradation import desk_texture
from simulation.flat_page import Page

Gray = NDArray[np.uint8]


def word_mask(page: Page) -> NDArray[np.bool_]:
    """(H, W) inside the boxes of the page's words."""
    mask = np.zeros(page.image.shape, bool)
    for line in page.lines:
        for word in line:
            x0, y0, x1, y1 = (round(value + 0.5) for value in word.box)
            mask[y0:y1, x0:x1] = True
    return mask


def test_characters_of_set_pages_are_kept(pages: tuple[Page, ...]) -> None:
    for page in pages:
        text, words, dark = identify_text(page.image), word_mask(page), page.image < 128
        assert (text.ink & dark & words).sum() > 0.98 * (dark & words).sum(), page.name
        assert not (text.ink & ~words).any(), page.name
        # Niblack's threshold takes some of the soft rim of a stroke, never plain paper.
        assert (text.ink & dark).sum() > 0.8 * text.ink.sum(), page.name
        assert (page.image[text.ink] < 250).all(), page.name


def test_components_are_the_characters(pages: tuple[Page, ...]) -> None:
    for page in pages:
        text = identify_text(page.image)
        letters = sum(len(word.text) for line in page.lines for word in line)
        # Dots of i and full stops are small; ligatures join two letters.
        assert 0.93 * letters < len(text.components.sizes) < 1.05 * letters, page.name
        c = text.components
        assert len(c.centres) == len(c.boxes) == len(c.sizes) == len(c.labels)
        corner = c.boxes[:, :2]
        assert (c.centres >= corner - 0.5).all()
        assert (c.centres <= corner + c.boxes[:, 2:] + 0.5).all()
        assert (np.unique(text.label_image[text.ink]) == np.sort(c.labels)).all()


def test_text_height_is_a_lower_case_characters(pages: tuple[Page, ...]) -> None:
    # Set at 21 px to the em: an x-height of 10 to 12 px. The second page is set a tenth larger.
    heights = [identify_text(page.image).text_height_px for page in pages[:2]]
    assert 9.5 < heights[0] < 12.5
    assert 1.03 < heights[1] / heights[0] < 1.2


def test_text_area_covers_the_lines_and_little_else(pages: tuple[Page, ...]) -> None:
    page = pages[0]
    text, words = identify_text(page.image), word_mask(page)
    assert text.area[words].mean() > 0.95
    rows, columns = np.where(words)
    beside = np.ones(words.shape, bool)
    beside[rows.min() - 30 : rows.max() + 30, columns.min() - 30 : columns.max() + 30] = False
    assert not text.area[beside].any()
    assert text.area_fraction == pytest.approx(text.area.mean())
    assert 0.4 < text.area_fraction < 0.7


# Things that are no text, each in the empty strip y 1340 to 1590, x 150 to 950 of the canvas or round the page.


def draw_rules(canvas: Gray) -> None:
    for y, thickness in ((1350, 2), (1380, 4), (1420, 8), (1480, 1)):
        cv2.line(canvas, (150, y), (950, y), 0, thickness)
    for x, thickness in ((60, 2), (90, 4), (1020, 8)):
        cv2.line(canvas, (x, 60), (x, 1600), 0, thickness)


def draw_slanted_rules(canvas: Gray) -> None:
    for k in range(6):
        cv2.line(canvas, (150, 1350 + 30 * k), (950, 1400 + 30 * k), 0, 1 + k, cv2.LINE_AA)


def draw_border(canvas: Gray) -> None:
    cv2.rectangle(canvas, (120, 60), (980, 1320), 0, 5)


def draw_table(canvas: Gray) -> None:
    for y in range(1350, 1600, 40):
        cv2.line(canvas, (150, y), (950, y), 0, 2)
    for x in range(150, 951, 100):
        cv2.line(canvas, (x, 1350), (x, 1590), 0, 2)


def draw_squares(canvas: Gray) -> None:
    for k, side in enumerate((8, 12, 20, 30, 60, 120)):
        cv2.rectangle(canvas, (150 + 130 * k, 1400), (150 + 130 * k + side, 1400 + side), 0, -1)


def draw_row_of_squares(canvas: Gray) -> None:
    for k in range(30):
        cv2.rectangle(canvas, (150 + 25 * k, 1400), (164 + 25 * k, 1414), 0, -1)


def draw_row_of_discs(canvas: Gray) -> None:
    for k in range(30):
        cv2.circle(canvas, (160 + 25 * k, 1400), 9, 0, -1, cv2.LINE_AA)


def draw_discs(canvas: Gray) -> None:
    for k, radius in enumerate((4, 6, 10, 15, 30, 60)):
        cv2.circle(canvas, (170 + 130 * k, 1450), radius, 0, -1, cv2.LINE_AA)


def draw_soft_picture(canvas: Gray) -> None:
    tones = np.random.default_rng(1).integers(30, 230, (5, 9), dtype=np.uint8)
    canvas[1340:1590, 150:950] = cv2.resize(tones, (800, 250), interpolation=cv2.INTER_CUBIC)
    cv2.rectangle(canvas, (150, 1340), (950, 1590), 0, 2)


def draw_wood(canvas: Gray) -> None:
    canvas[1340:1590, 150:950] = desk_texture(800, 250, np.random.default_rng(2))[..., 1]


def draw_foliage(canvas: Gray) -> None:
    """Noise of all sizes, that of a few pixels the strongest for its size."""
    rng = np.random.default_rng(3)
    tones = np.full((250, 800), 130.0)
    for cell, strength in ((3, 15), (8, 20), (30, 30), (100, 30)):
        coarse = rng.standard_normal((250 // cell + 2, 800 // cell + 2))
        size = (coarse.shape[1] * cell, coarse.shape[0] * cell)
        tones += strength * cv2.resize(coarse, size, interpolation=cv2.INTER_CUBIC)[:250, :800]
    canvas[1340:1590, 150:950] = np.clip(tones, 0, 255)


def draw_nothing(canvas: Gray) -> None:
    del canvas


def text_beside(
    page: Page, draw: Callable[[Gray], None]
) -> tuple[IdentifiedText, IdentifiedText, NDArray[np.bool_]]:
    """Text of a page alone and with what `draw` adds, and where that is."""
    canvas = np.full((1650, 1100), 255, np.uint8)
    canvas[50:1300, 150:950] = page.image
    alone = identify_text(canvas)
    drawn = canvas.copy()
    draw(drawn)
    return alone, identify_text(drawn), drawn != canvas


@pytest.mark.parametrize(
    "draw",
    [
        draw_rules,
        draw_slanted_rules,
        draw_border,
        draw_table,
        draw_squares,
        draw_row_of_squares,
        draw_row_of_discs,
        draw_discs,
        draw_soft_picture,
        draw_wood,
    ],
)
def test_what_is_no_text_is_kept_out(pages: tuple[Page, ...], draw: Callable[[Gray], None]) -> None:
    alone, text, decoy = text_beside(pages[0], draw)
    assert not (text.ink & decoy).any()
    assert (text.ink & alone.ink).sum() > 0.995 * alone.ink.sum()
    assert text.rejected_fraction > alone.rejected_fraction
    assert text.text_height_px == pytest.approx(alone.text_height_px, rel=0.05)


def test_a_rough_picture_is_mostly_kept_out(pages: tuple[Page, ...]) -> None:
    alone, text, decoy = text_beside(pages[0], draw_foliage)
    found, found_alone = (t.ink.sum() / (1 - t.rejected_fraction) for t in (text, alone))
    # Foliage does make blots like characters in rows; three quarters of them and more are refused.
    assert 0 < (text.ink & decoy).sum() < 0.25 * (found - found_alone)
    assert (text.ink & alone.ink).sum() > 0.99 * alone.ink.sum()


def test_a_page_with_a_picture(pages: tuple[Page, ...]) -> None:
    alone, with_picture = identify_text(pages[0].image), identify_text(pages[2].image)
    assert alone.rejected_fraction < 0.02
    assert 0.03 < with_picture.rejected_fraction < 0.3


def test_only_text_of_the_region_counts(pages: tuple[Page, ...]) -> None:
    page = pages[0]
    region = np.zeros(page.image.shape, bool)
    region[300:700, 100:600] = True
    whole, part = identify_text(page.image), identify_text(page.image, region)
    assert not part.ink[~region].any()
    inner = region & (cv2.erode(region.astype(np.uint8), np.ones((61, 61))) > 0)
    assert (part.ink & inner).sum() > 0.98 * (whole.ink & inner).sum()
    nothing = identify_text(page.image, np.zeros(page.image.shape, bool))
    assert len(nothing.components.sizes) == 0


@pytest.mark.parametrize("turns", [1, 2, 3])
def test_a_turned_page_has_the_same_text(pages: tuple[Page, ...], turns: int) -> None:
    straight = identify_text(pages[3].image)
    turned = identify_text(np.ascontiguousarray(np.rot90(pages[3].image, turns)))
    back = np.rot90(turned.ink, -turns)
    assert (back ^ straight.ink).sum() < 0.01 * straight.ink.sum()
    assert turned.text_height_px == pytest.approx(straight.text_height_px, rel=0.02)


def test_cut_characters_at_the_photos_rim_do_not_count(pages: tuple[Page, ...]) -> None:
    cut = pages[0].image[205:900, 200:600]
    text = identify_text(np.ascontiguousarray(cut))
    assert len(text.components.sizes) > 200
    for edge in (text.ink[0], text.ink[-1], text.ink[:, 0], text.ink[:, -1]):
        assert not edge.any()


def draw_tiny(kind: str, shape: tuple[int, int]) -> Gray:
    rng = np.random.default_rng(4)
    values = {
        "white": np.full(shape, 255),
        "black": np.zeros(shape),
        "gray": np.full(shape, 128),
        "noise": rng.integers(0, 256, shape),
        "chequers": 255 * (np.indices(shape).sum(axis=0) % 2),
    }
    return values[kind].astype(np.uint8)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("shape", [(1, 1), (3, 3), (20, 20), (1, 200), (200, 1), (400, 300)])
@pytest.mark.parametrize("kind", ["white", "black", "gray", "noise", "chequers"])
def test_images_without_text_are_answered(kind: str, shape: tuple[int, int]) -> None:
    text = identify_text(draw_tiny(kind, shape))
    assert text.ink.shape == text.area.shape == text.label_image.shape == shape
    assert 0.0 <= text.rejected_fraction <= 1.0
    assert np.isfinite(text.text_height_px)
    if kind != "noise":
        assert len(text.components.sizes) == 0
        assert text.text_height_px == 0.0


def test_edges_are_where_the_steps_are() -> None:
    gray = np.full((400, 300), 255, np.uint8)
    gray[:, 150:] = 40
    edges = detect_edges(gray)
    assert edges[50:-50, 145:155].any(axis=1).all()
    assert not edges[:, :140].any()
    assert not edges[:, 160:].any()


def test_paper_grain_makes_no_edges() -> None:
    grain = np.random.default_rng(5).normal(245, 2, (400, 300))
    assert detect_edges(np.clip(grain, 0, 255).astype(np.uint8)).mean() < 0.01


def test_niblacks_threshold_is_that_of_the_definition() -> None:
    gray = np.random.default_rng(6).integers(0, 256, (40, 50), dtype=np.uint8)
    area = np.ones(gray.shape, bool)
    area[:, 30:] = False
    ink = binarize_niblack(gray, area, 9, -0.2, 12.0)
    for y, x in ((10, 10), (20, 25), (35, 5), (17, 22), (30, 29)):
        window = gray[y - 4 : y + 5, x - 4 : x + 5].astype(float)
        assert ink[y, x] == (gray[y, x] < window.mean() - 0.2 * window.std())
    assert not ink[:, 30:].any()
    assert not binarize_niblack(gray, area, 9, -0.2, 128.0).any()  # no window deviates so much


@pytest.mark.parametrize("width", [2, 4, 9, 16])
def test_stroke_width_of_bars_and_rings(width: int) -> None:
    ink = np.zeros((200, 300), np.uint8)
    cv2.rectangle(ink, (20, 20), (20 + width - 1, 180), 1, -1)
    cv2.circle(ink, (180, 100), 60, 1, width)
    count, labels, stats, _ = cv2.connectedComponentsWithStats(ink)
    assert count == 3
    strokes = measure_strokes(ink > 0, np.asarray(labels), stats[:, cv2.CC_STAT_AREA].astype(float))
    assert (np.abs(strokes[1:] - width) < 1.0 + 0.1 * width).all()


def test_closing_fills_gaps_up_to_its_diameter() -> None:
    edges = np.zeros((60, 200), bool)
    edges[30, [20, 28, 80, 110]] = True
    area = find_text_area(edges, 11)
    assert area[30, 20:29].all()
    assert not area[30, 81:110].any()


def test_nothing_is_dropped_when_nothing_would_be_left(pages: tuple[Page, ...]) -> None:
    text = identify_text(pages[0].image)
    count = len(text.components.sizes)
    assert keep_characters(text, np.zeros(count, bool)) is text
    assert keep_characters(text, np.ones(count, bool)) is text


def test_kept_characters_keep_their_ink(pages: tuple[Page, ...]) -> None:
    text = identify_text(pages[0].image)
    upper = text.components.centres[:, 1] < 600
    kept = keep_characters(text, upper)
    assert len(kept.components.sizes) == upper.sum()
    assert (kept.ink <= text.ink).all()
    assert not kept.ink[620:].any()
    assert (kept.ink[:580] == text.ink[:580]).all()
    assert not kept.area[660:].any()
    lost = 1 - kept.ink.sum() / text.ink.sum()
    assert kept.rejected_fraction == pytest.approx(1 - (1 - text.rejected_fraction) * (1 - lost))

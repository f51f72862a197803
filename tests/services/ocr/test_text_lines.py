"""Lines are found where they were set, and cut level."""

import cv2
import numpy as np
import pytest
from PIL import ImageDraw

from services.arrays import GrayImage
from services.ocr.text_lines import TextLine, TextLines, cut_line, detect_text_lines
from tests.services.ocr.pages import blank, set_lines, text_page


def hits(found: TextLines, truth: tuple[int, int, int, int]) -> list[TextLine]:
    """Found lines whose middle lies in the box."""
    x0, y0, x1, y1 = truth
    return [
        line
        for line in found.lines
        if x0 <= (line.box[0] + line.box[2]) / 2 <= x1 and y0 <= (line.box[1] + line.box[3]) / 2 <= y1
    ]


@pytest.mark.parametrize("scale", [0.6, 1.0, 2.5])
def test_every_line_is_found_within_a_share_of_its_height(scale: float) -> None:
    page = blank(round(900 * scale), round(1200 * scale))
    boxes = set_lines(page, (round(60 * scale), round(60 * scale)), 20, round(28 * scale))
    found = detect_text_lines(np.asarray(page, dtype=np.uint8))
    rows, columns = found.rows, found.columns
    assert rows.mass > 10 * columns.mass
    assert not rows.inverted
    for box in boxes:
        (line,) = hits(rows, box)
        tolerance = 0.35 * (box[3] - box[1])
        assert np.allclose(line.box, box, atol=tolerance)
        assert abs(line.slope) < 0.01


def test_columns_are_sought_only_when_asked_for() -> None:
    found = detect_text_lines(text_page())
    assert found.rows.mass > 1
    assert "columns" not in vars(found)
    assert found.mass == max(found.rows.mass, found.columns.mass)


@pytest.mark.parametrize("turns", [1, 3])
def test_turned_page_has_its_lines_along_the_columns(turns: int) -> None:
    page = text_page()
    found = detect_text_lines(np.ascontiguousarray(np.rot90(page, turns)))
    rows, columns = found.rows, found.columns
    assert columns.mass > 10 * rows.mass
    assert len([line for line in columns.lines if line.width_px > 300]) == 20


def test_light_print_on_a_dark_ground() -> None:
    rows = detect_text_lines(text_page(ink=235, ground=30)).rows
    assert rows.inverted
    assert len([line for line in rows.lines if line.width_px > 300]) == 20


def test_lines_stay_within_their_column() -> None:
    page = blank(1000, 1200)
    set_lines(page, (50, 60), 30, 22, words=6)
    set_lines(page, (540, 60), 30, 22, words=6)
    rows = detect_text_lines(np.asarray(page, dtype=np.uint8)).rows
    for line in rows.lines:
        assert line.box[2] < 540 or line.box[0] > 500


def test_rules_of_a_table_do_not_join_its_cells() -> None:
    page = blank(900, 900)
    boxes = set_lines(page, (70, 70), 12, 28, words=3, leading=2.0)
    draw = ImageDraw.Draw(page)
    for row in range(14):
        draw.line((50, 55 + 56 * row, 850, 55 + 56 * row), fill=0, width=3)
    for x in (50, 600, 850):
        draw.line((x, 55, x, 55 + 56 * 13), fill=0, width=3)
    rows = detect_text_lines(np.asarray(page, dtype=np.uint8)).rows
    for box in boxes:
        assert any(line.width_px > 0.8 * (box[2] - box[0]) for line in hits(rows, box))
    assert all(line.width_px < 600 for line in rows.lines)


def test_heading_and_small_print_are_both_found() -> None:
    page = blank(1000, 1000)
    heading = set_lines(page, (40, 40), 1, 90, words=3)
    small = set_lines(page, (40, 400), 12, 20)
    rows = detect_text_lines(np.asarray(page, dtype=np.uint8)).rows
    for box in [*heading, *small]:
        assert any(line.width_px > 0.8 * (box[2] - box[0]) for line in hits(rows, box))


def test_print_is_found_beside_a_large_dark_margin() -> None:
    page = np.full((1700, 1400), 12, np.uint8)
    page[200:1400, 200:1100] = text_page()
    noise = np.random.default_rng(0).normal(0, 5, page.shape)
    found = detect_text_lines(np.clip(page + noise, 0, 255).astype(np.uint8))
    rows, columns = found.rows, found.columns
    assert rows.mass > 5 * columns.mass
    assert len([line for line in rows.lines if line.width_px > 300]) >= 20


@pytest.mark.parametrize("value", [0, 128, 255])
@pytest.mark.parametrize("shape", [(1, 1), (2, 300), (40, 40), (400, 300)])
def test_blank_pages_have_no_lines(shape: tuple[int, int], value: int) -> None:
    found = detect_text_lines(np.full(shape, value, np.uint8))
    rows, columns = found.rows, found.columns
    assert rows.lines == columns.lines == ()
    assert rows.mass == columns.mass == 0.0


def correlation(a: GrayImage, b: GrayImage) -> float:
    width = min(a.shape[1], b.shape[1])
    return float(np.corrcoef(a[:, :width].ravel(), b[:, :width].ravel())[0, 1])


@pytest.mark.parametrize("slope", [-0.06, 0.03, 0.06])
def test_sloping_line_is_cut_level(slope: float) -> None:
    page = blank(1000, 300)
    set_lines(page, (60, 130), 1, 36, words=6)
    level = np.asarray(page, dtype=np.uint8)
    shear = np.array([[1.0, 0.0, 0.0], [slope, 1.0, -500 * slope]])
    warped = cv2.warpAffine(level, shear, (1000, 300), flags=cv2.INTER_CUBIC, borderValue=255)
    sheared = np.asarray(warped, dtype=np.uint8)
    (line,) = detect_text_lines(sheared).rows.lines
    assert line.slope == pytest.approx(slope, abs=0.006)
    y, x = np.nonzero(cut_line(sheared, line, False) < 128)
    assert abs(np.polyfit(x, y, 1)[0]) < 0.006
    assert y.min() >= 2
    assert y.max() <= 33


@pytest.mark.parametrize("scale", [0.5, 1.0, 3.0])
def test_crop_has_the_asked_height_and_the_same_content_at_any_scale(scale: float) -> None:
    page = blank(round(1200 * scale), round(200 * scale))
    set_lines(page, (round(60 * scale), round(70 * scale)), 1, round(48 * scale), words=5)
    image = np.asarray(page, dtype=np.uint8)
    (line,) = detect_text_lines(image).rows.lines
    crop = cut_line(image, line, False, height_px=36)
    assert crop.shape[0] == 36
    assert crop.shape[1] <= 26 * 36
    assert crop.min() == 0
    assert np.median(crop) > 250
    reference = np.asarray(cv2.resize(image, (1200, 200), interpolation=cv2.INTER_AREA), dtype=np.uint8)
    (line,) = detect_text_lines(reference).rows.lines
    assert correlation(crop, cut_line(reference, line, False)) > 0.8


def test_inverted_line_is_cut_dark_on_white() -> None:
    image = text_page(ink=235, ground=30, lines=3, height=300)
    rows = detect_text_lines(image).rows
    crop = cut_line(image, max(rows.lines, key=lambda line: line.width_px), rows.inverted)
    assert np.median(crop) == 255
    assert 0.05 < np.mean(crop < 128) < 0.4


def test_shadow_edge_across_a_line_is_evened_out() -> None:
    page = blank(900, 120)
    ((x0, y0, x1, y1),) = set_lines(page, (60, 40), 1, 28)
    image = np.asarray(page, dtype=np.float64).copy()
    image[:, (x0 + x1) // 2 :] *= 0.35
    shaded = np.rint(image).astype(np.uint8)
    crop = cut_line(shaded, TextLine((float(x0), float(y0), float(x1), float(y1)), 0.0, 1.0), False)
    left, right = crop[:, :200], crop[:, -200:]
    assert np.percentile(left, 60) == np.percentile(right, 60) == 255
    assert np.mean(right < 100) > 0.05


@pytest.mark.parametrize("box", [(-20.0, -9.0, 100.0, 20.0), (850.0, 1180.0, 990.0, 1230.0)])
def test_line_at_the_border_is_cut_from_what_there_is(box: tuple[float, float, float, float]) -> None:
    crop = cut_line(text_page(), TextLine(box, 0.01, 1.0), False)
    assert crop.shape[0] == 36
    assert crop.dtype == np.uint8

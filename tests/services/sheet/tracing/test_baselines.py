"""Baselines, paragraphs and margins of pages whose lines are known."""

import cv2
import numpy as np
import pytest

from services.arrays import Vector
from services.sheet.tracing.baselines import Baselines, detect_baselines, find_margins, group_paragraphs
from simulation.flat_page import Page


def slopes_deg(lines: Baselines) -> Vector:
    """Slope (L,) of each baseline."""
    way = lines.ends - lines.starts
    return np.asarray(np.degrees(np.arctan2(way[:, 1], way[:, 0])))


def lines_at(y: list[float], left: float = 100.0, right: float = 600.0, height: float = 10.0) -> Baselines:
    """Level lines one below the other."""
    count = len(y)
    starts = np.stack([np.full(count, left), np.array(y)], axis=1)
    ends = np.stack([np.full(count, right), np.array(y)], axis=1)
    return Baselines(starts, ends, np.full(count, height), np.full(count, 0.1))


def test_every_line_is_found_where_it_is_set(pages: tuple[Page, ...]) -> None:
    for page in pages:
        lines = detect_baselines(page.image < 128)
        assert abs(len(lines) - len(page.lines)) <= 1, page.name
        assert (np.diff(lines.starts[:, 1] + lines.ends[:, 1]) >= 0).all()
        # Each ends where a line of words ends, and its foot is the boxes' of words without descenders.
        extents = np.array([(line[0].box[0], line[-1].box[2]) for line in page.lines])
        feet = np.array(
            [
                np.median([w.box[3] for w in line if not set(w.text) & set("gjpqy,;Q()")])
                for line in page.lines
            ]
        )
        off = np.abs(extents - np.stack([lines.starts[:, 0], lines.ends[:, 0]], axis=1)[:, None]).sum(axis=2)
        off += np.abs(feet - lines.starts[:, 1:])
        # Less than a text height in all. Justified lines of narrow columns have gaps that part some of them.
        whole = (np.nanmin(off, axis=1) < 12).mean()
        assert whole > (0.85 if page.name == "own-5" else 0.97), page.name


def test_slopes_are_those_of_the_page(pages: tuple[Page, ...]) -> None:
    for page in pages:
        lines = detect_baselines(page.image < 128)
        slopes, length = slopes_deg(lines), lines.ends[:, 0] - lines.starts[:, 0]
        assert np.median(np.abs(slopes)) < 0.05, page.name
        assert abs(np.average(slopes, weights=length)) < 0.02, page.name
        # Short lines are less certain, and say so.
        expected = np.degrees(np.sqrt(2) * lines.deviations / length)
        assert (np.abs(slopes) < 6 * expected + 0.02).all(), page.name


def enlarge(page: Page, factor: float) -> np.ndarray:
    """The page's picture (H, W) with `factor` times the pixels on a side."""
    return np.asarray(cv2.resize(page.image, None, fx=factor, fy=factor, interpolation=cv2.INTER_CUBIC))


@pytest.mark.parametrize(("factor", "tolerance_deg"), [(1.0, 0.08), (2.0, 0.03)])
@pytest.mark.parametrize("angle_deg", [-1.0, -0.3, 0.1, 0.2, 0.5, 1.0])
def test_slopes_of_a_turned_page(
    pages: tuple[Page, ...], angle_deg: float, factor: float, tolerance_deg: float
) -> None:
    # Characters of 13 px end at whole pixels, which hides slopes of less than a pixel a line; twice as many do not.
    page, gray = pages[1], enlarge(pages[1], factor)
    height, width = gray.shape
    # cv2's positive angles are counter-clockwise.
    turn = cv2.getRotationMatrix2D((width / 2, height / 2), -angle_deg, 1.0)
    turned = cv2.warpAffine(gray, turn, (width, height), flags=cv2.INTER_CUBIC, borderValue=(255.0,))
    lines = detect_baselines(turned < 128)
    length = lines.ends[:, 0] - lines.starts[:, 0]
    assert abs(len(lines) - len(page.lines)) <= 1
    assert abs(np.average(slopes_deg(lines), weights=length) - angle_deg) < tolerance_deg


@pytest.mark.parametrize("threshold", [110, 150, 190])
def test_thick_or_thin_print_that_gets_smaller_stays_level(pages: tuple[Page, ...], threshold: int) -> None:
    # The photo shows the right side of the page a third smaller; strokes gain or lose the same there as at the left.
    gray = enlarge(pages[1], 1.6)
    height, width = gray.shape
    corners = np.array([[0, 0], [width, 0], [width, height], [0, height]], np.float32)
    seen = np.array([[0, 0], [width, height / 6], [width, height * 5 / 6], [0, height]], np.float32)
    H = cv2.getPerspectiveTransform(corners, seen)
    photo = cv2.warpPerspective(gray, H, (width, height), flags=cv2.INTER_AREA, borderValue=(255.0,))
    ink = (cv2.GaussianBlur(photo, (0, 0), 1.0) < threshold).astype(np.uint8) * 255
    flat = cv2.warpPerspective(ink, np.linalg.inv(H), (width, height), flags=cv2.INTER_LINEAR)
    lines = detect_baselines(flat > 127)
    assert len(lines) >= 30
    assert abs(np.average(slopes_deg(lines), weights=lines.ends[:, 0] - lines.starts[:, 0])) < 0.03


def test_paragraphs_have_equal_spacing(pages: tuple[Page, ...]) -> None:
    for page, least in zip(pages, (2, 2, 2, 2, 4), strict=True):
        lines = detect_baselines(page.image < 128)
        paragraphs = group_paragraphs(lines)
        assert len(paragraphs) >= least, page.name
        assert sum(len(p.lines) for p in paragraphs) > 0.85 * len(lines), page.name
        y = 0.5 * (lines.starts[:, 1] + lines.ends[:, 1])
        spacings = []
        for paragraph in paragraphs:
            slope, level = np.polyfit(paragraph.order, y[paragraph.lines], 1)
            # Lines are set to whole pixels.
            assert np.abs(y[paragraph.lines] - level - slope * paragraph.order).max() < 1.0, page.name
            spacings.append(slope)
        # All of a page's running text is set with one leading: 1.42 of the body.
        assert np.ptp(spacings) < 0.01 * np.mean(spacings), page.name


def test_leading_is_known(pages: tuple[Page, ...]) -> None:
    lines = detect_baselines(pages[0].image < 128)
    paragraph = max(group_paragraphs(lines), key=lambda p: len(p.lines))
    y = 0.5 * (lines.starts[:, 1] + lines.ends[:, 1])
    slope = np.polyfit(paragraph.order, y[paragraph.lines], 1)[0]
    assert slope == pytest.approx(1.42 * 21, abs=0.05)


def test_two_spacings_are_two_paragraphs() -> None:
    upper, lower = [100.0 + 20 * k for k in range(6)], [300.0 + 30 * k for k in range(5)]
    paragraphs = group_paragraphs(lines_at(upper + lower))
    assert [p.lines.tolist() for p in paragraphs] == [list(range(6)), list(range(6, 11))]
    assert [p.order.tolist() for p in paragraphs] == [list(range(6)), list(range(5))]


@pytest.mark.parametrize("missing", [2, 3, 5])
def test_a_missing_line_does_not_bend_the_spacing(missing: int) -> None:
    y = [100.0 + 20 * k for k in range(12) if k != missing]
    lines = lines_at(y)
    paragraphs = group_paragraphs(lines)
    assert sum(len(p.lines) for p in paragraphs) >= 6
    for paragraph in paragraphs:
        steps = np.diff(np.array(y)[paragraph.lines]) / np.diff(paragraph.order)
        assert np.allclose(steps, 20.0)


def test_columns_and_sizes_are_not_mixed() -> None:
    left = lines_at([100.0 + 20 * k for k in range(6)], 100, 300)
    right = lines_at([110.0 + 20 * k for k in range(6)], 350, 550)
    large = lines_at([220.0 + 20 * k for k in range(4)], 100, 300, height=16.0)
    parts = (left, right, large)
    both = Baselines(
        np.concatenate([p.starts for p in parts]),
        np.concatenate([p.ends for p in parts]),
        np.concatenate([p.heights for p in parts]),
        np.concatenate([p.deviations for p in parts]),
    )
    found = sorted(p.lines.tolist() for p in group_paragraphs(both))
    assert found == [list(range(6)), list(range(6, 12)), list(range(12, 16))]


def test_flush_margins(pages: tuple[Page, ...]) -> None:
    justified, ragged, columns = (detect_baselines(pages[k].image < 128) for k in (0, 3, 4))
    for lines, sides in ((justified, ("left", "right")), (ragged, ("left",))):
        for side in sides:
            x = (lines.starts if side == "left" else lines.ends)[:, 0]
            fullest = find_margins(lines, side)[0]
            assert len(fullest) > 0.7 * len(lines)
            assert np.ptp(x[fullest]) <= np.median(lines.heights)
    # Ragged ends gather nowhere like that; two columns have two margins on each side.
    assert len(find_margins(ragged, "right")[0]) < 0.4 * len(ragged)
    for side in ("left", "right"):
        assert [len(group) > 0.3 * len(columns) for group in find_margins(columns, side)[:2]] == [True, True]


def test_margins_are_disjoint_and_full(pages: tuple[Page, ...]) -> None:
    lines = detect_baselines(pages[0].image < 128)
    groups = find_margins(lines, "left")
    members = np.concatenate(groups)
    assert len(np.unique(members)) == len(members)
    assert all(len(group) >= 5 for group in groups)
    assert [len(g) for g in groups] == sorted((len(g) for g in groups), reverse=True)


@pytest.mark.parametrize("shape", [(1, 1), (3, 3), (20, 20), (200, 300)])
@pytest.mark.parametrize("filled", [False, True])
def test_no_lines_in_blank_or_black_views(shape: tuple[int, int], filled: bool) -> None:
    lines = detect_baselines(np.full(shape, filled))
    assert len(lines) == 0
    assert lines.starts.shape == lines.ends.shape == (0, 2)
    assert group_paragraphs(lines) == []
    assert find_margins(lines, "left") == find_margins(lines, "right") == []


def test_scattered_blots_make_no_long_lines() -> None:
    rng = np.random.default_rng(3)
    ink = np.zeros((800, 600), np.uint8)
    for x, y in rng.uniform([20, 20], [580, 780], (150, 2)):
        cv2.circle(ink, (int(x), int(y)), 5, 1, -1)
    assert len(detect_baselines(ink > 0)) <= 2


def test_one_word_is_no_line() -> None:
    ink = np.zeros((100, 200), np.uint8)
    for k in range(4):
        cv2.rectangle(ink, (20 + 14 * k, 40), (29 + 14 * k, 52), 1, -1)
    assert len(detect_baselines(ink > 0)) == 0

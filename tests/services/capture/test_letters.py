"""Height of small letters and detail of strokes on drawn lines of text, sharp, blurred and noisy."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from services.arrays import Floats, GrayImage, Points
from services.capture.letter_size import LetterRows, measure_letter_rows, text_axes
from services.capture.quality import CaptureQuality, measure_quality
from services.capture.readability import predict_character_error
from services.capture.stroke_detail import StrokeDetail, measure_strokes

LETTER_PX = 16.0


def lines_of_text(turn_deg: float = 0.0) -> tuple[GrayImage, Points, Floats]:
    """A page (900 x 900) with 14 lines of strokes 16 px high and 3 px wide, turned; places of its letters, its mesh."""
    page = np.full((900, 900), 230, np.uint8)
    rng, centres = np.random.default_rng(3), []
    for top in range(120, 760, 46):
        x = 120
        while x < 770:
            page[top : top + 16, x : x + 3] = 20
            page[top + int(rng.integers(14)) :, :][:3, x : x + 10] = 20
            centres.append((x + 4.0, top + 8.0))
            x += 13 if rng.random() > 0.15 else 26
    c, s = np.cos(np.radians(turn_deg)), np.sin(np.radians(turn_deg))
    turn = np.array([[c, -s, 450 - 450 * c + 450 * s], [s, c, 450 - 450 * s - 450 * c]])
    nodes = np.stack(np.meshgrid(np.linspace(100, 800, 9), np.linspace(100, 800, 9)), axis=-1)
    turned = cv2.warpAffine(page, turn, (900, 900), flags=cv2.INTER_LINEAR, borderValue=(230,))
    return (
        np.asarray(turned, np.uint8),
        np.array(centres) @ turn[:, :2].T + turn[:, 2],
        nodes @ turn[:, :2].T + turn[:, 2],
    )


def spoilt(image: GrayImage, *, blur_px: float = 0.0, noise: float = 0.0) -> GrayImage:
    """The image, blurred and noisy."""
    values = cv2.GaussianBlur(image, (0, 0), blur_px).astype(float) if blur_px else image.astype(float)
    values += np.random.default_rng(5).normal(0, noise, image.shape) if noise else 0.0
    return np.clip(values, 0, 255).astype(np.uint8)


def figures(image: GrayImage, centres: Points, mesh: Floats) -> CaptureQuality:
    """Of the photo, whose characters are as high as the letters."""
    found = measure_quality(image, centres, np.full(len(centres), LETTER_PX), mesh)
    assert found is not None
    return found


@pytest.mark.parametrize("turn_deg", [0.0, 12.0, 90.0, -160.0])
def test_axes_run_along_the_lines(turn_deg: float) -> None:
    _, centres, mesh = lines_of_text(turn_deg)
    axes = text_axes(mesh, centres)
    along = [np.cos(np.radians(turn_deg)), np.sin(np.radians(turn_deg))]
    np.testing.assert_allclose(axes, np.tile(along, (len(centres), 1)), atol=1e-9)
    unknown = text_axes(np.full((3, 3, 2), np.nan), centres[:2])
    np.testing.assert_allclose(unknown, [[1, 0], [1, 0]])


@pytest.mark.parametrize("turn_deg", [0.0, 12.0, -160.0])
@pytest.mark.parametrize("known_px", [5.0, 16.0, 40.0])
def test_the_height_is_that_of_the_letters_whatever_was_known(turn_deg: float, known_px: float) -> None:
    """Components are a third of a letter in noise, and words in blur."""
    image, centres, mesh = lines_of_text(turn_deg)
    axes = text_axes(mesh, centres)
    sharp = measure_letter_rows(image, centres, axes, known_px).height_px
    assert sharp == pytest.approx(LETTER_PX, rel=0.35)
    blurred = measure_letter_rows(spoilt(image, blur_px=4.0, noise=20.0), centres, axes, known_px)
    assert blurred.height_px == pytest.approx(sharp, rel=0.4)


def test_paper_has_no_letters() -> None:
    blank, places = np.full((200, 200), 230, np.uint8), np.full((5, 2), 100.0)
    assert measure_letter_rows(blank, places, np.tile([1.0, 0.0], (5, 1)), 11.0) == LetterRows(11.0, 0.0)


@pytest.mark.parametrize("crooked_deg", [0.0, 4.0, -8.0])
def test_lines_that_are_not_level_are_seen_and_their_letters_are_as_high(crooked_deg: float) -> None:
    """Lines of creased paper run at an angle to the rows of the flat page."""
    image, centres, _ = lines_of_text(12.0 + crooked_deg)
    c, s = np.cos(np.radians(12.0)), np.sin(np.radians(12.0))
    rows = measure_letter_rows(image, centres, np.tile([c, s], (len(centres), 1)), LETTER_PX)
    assert np.degrees(rows.tilt_rad) == pytest.approx(abs(crooked_deg), abs=0.6)
    assert rows.height_px == pytest.approx(LETTER_PX, rel=0.35)


def test_crooked_lines_are_read_worse() -> None:
    image, centres, mesh = lines_of_text()
    level = figures(image, centres, mesh)
    crooked = predict_character_error(replace(level, line_tilt_rad=level.line_tilt_rad + 0.1))
    assert crooked > predict_character_error(level) + 0.05


def detail(image: GrayImage, centres: Points, mesh: Floats) -> StrokeDetail:
    """Of the photo's strokes."""
    return measure_strokes(image, centres, text_axes(mesh, centres), LETTER_PX)


@pytest.mark.parametrize("turn_deg", [0.0, 12.0])
def test_motion_takes_the_detail_of_its_direction(turn_deg: float) -> None:
    image, centres, mesh = lines_of_text(turn_deg)
    angle = np.radians(turn_deg)
    kernel = np.zeros((15, 15), np.float32)
    end = (round(7 + 6 * np.cos(angle)), round(7 + 6 * np.sin(angle)))
    cv2.line(kernel, (14 - end[0], 14 - end[1]), end, (1.0,))
    moved = np.asarray(cv2.filter2D(image, -1, kernel / kernel.sum()), np.uint8)
    before, after = detail(image, centres, mesh), detail(moved, centres, mesh)
    assert after.along < 0.4 * before.along
    assert after.across > 0.7 * before.across
    assert after.least <= after.along


def test_noise_and_faint_ink_do_not_count_as_detail() -> None:
    image, centres, mesh = lines_of_text()
    sharp = detail(image, centres, mesh)
    faint = np.asarray(200 + (image.astype(float) - 200) * 0.2, np.uint8)
    assert detail(faint, centres, mesh).along == pytest.approx(sharp.along, rel=0.1)
    assert detail(spoilt(image, noise=25.0), centres, mesh).along == pytest.approx(sharp.along, rel=0.2)


def test_large_letters_are_reduced_first() -> None:
    image, centres, mesh = lines_of_text()
    large = np.ascontiguousarray(np.kron(image, np.ones((3, 3), np.uint8)))
    axes = text_axes(mesh, centres)
    found = measure_strokes(large, 3 * centres + 1, axes, 3 * LETTER_PX)
    assert found.along == pytest.approx(detail(image, centres, mesh).along, rel=0.1)


def test_each_damage_lets_more_errors_expect() -> None:
    image, centres, mesh = lines_of_text()
    expected = [predict_character_error(figures(image, centres, mesh))]
    for blur_px in (2.0, 4.0, 7.0):
        expected.append(predict_character_error(figures(spoilt(image, blur_px=blur_px), centres, mesh)))
    assert np.all(np.diff(expected) > 0)
    assert expected[0] < 0.02
    assert expected[-1] > 0.5
    noisy = predict_character_error(figures(spoilt(image, noise=60.0), centres, mesh))
    assert noisy > expected[0]

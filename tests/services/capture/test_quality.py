"""Figures of drawn photos whose height, blur, contrast and light are known, and what is advised."""

from dataclasses import replace
from itertools import pairwise

import cv2
import numpy as np
import pytest

from services.arrays import Points
from services.capture.advice import advise
from services.capture.quality import CaptureQuality, measure_quality
from services.capture.readability import predict_character_error, predict_error_of_reading
from services.ocr.engine import Word
from services.text.page_text import doubtful_letters

HEIGHT_PX = 24.0
GOOD = CaptureQuality(24.0, 24.0, 0.8, 0.8, 0.0, 0.0, 0.0)


def characters_on(image: np.ndarray, step: int = 48, ink: int = 20) -> Points:
    """Draw squares of 24 pixels on a grid; their centres."""
    centres = []
    for y in range(60, image.shape[0] - 50, step):
        for x in range(60, image.shape[1] - 50, step):
            image[y - 12 : y + 12, x - 12 : x + 12] = ink
            centres.append((x - 0.5, y - 0.5))
    return np.array(centres, np.float64)


def measured(image: np.ndarray, centres: Points, mesh: np.ndarray | None = None) -> CaptureQuality:
    """Its figures."""
    found = measure_quality(image, centres, np.full(len(centres), HEIGHT_PX), mesh)
    assert found is not None
    return found


@pytest.mark.parametrize("sigma_px", [1.0, 2.0, 4.0])
def test_blur_is_that_of_the_edges(sigma_px: float) -> None:
    image = np.full((600, 600), 230, np.uint8)
    centres = characters_on(image)
    blurred = np.asarray(cv2.GaussianBlur(image, (0, 0), sigma_px), np.uint8)
    assert measured(blurred, centres).blur_px == pytest.approx(sigma_px, rel=0.2)
    noisy = blurred + np.random.default_rng(1).normal(0, 4, blurred.shape)
    noise = measured(np.clip(noisy, 0, 255).astype(np.uint8), centres).blur_px
    assert noise == pytest.approx(sigma_px, rel=0.35)


@pytest.mark.parametrize(
    ("brightness", "ink", "codes"), [(0.18, 20, ["more-light"]), (1.0, 20, []), (1.0, 190, [])]
)
def test_more_light_is_advised_where_the_paper_is_dark(brightness: float, ink: int, codes: list[str]) -> None:
    # Faint print on bright paper gains nothing by light.
    image = np.full((600, 600), 230, np.uint8)
    centres = characters_on(image, ink=ink)
    quality = measured(np.asarray(brightness * image, np.uint8), centres)
    assert quality.paper_level == pytest.approx(230 * brightness, abs=2)
    assert [advice.code for advice in advise(quality) if advice.code == "more-light"] == codes


@pytest.mark.parametrize("ink", [20, 120, 180])
def test_contrast_is_that_of_ink_and_paper(ink: int) -> None:
    image = np.full((600, 600), 230, np.uint8)
    quality = measured(image, characters_on(image, ink=ink))
    assert quality.contrast == pytest.approx((230 - ink) / 230, abs=0.05)
    assert (quality.glare_fraction, quality.shadow_fraction) == (0.0, 0.0)


def test_light_print_has_the_figures_of_its_negative() -> None:
    image = np.full((600, 600), 235, np.uint8)
    centres = characters_on(image)
    heights = np.full(len(centres), HEIGHT_PX)
    image = np.asarray(cv2.GaussianBlur(image, (0, 0), 1.5), np.uint8)
    of_dark, of_light = (
        measured(image, centres),
        measure_quality(255 - image, centres, heights, is_light=True),
    )
    assert of_light == of_dark
    assert measured(255 - image, centres) != of_dark
    # Dark paper round light print is no shadow.
    image[:, :300] = 240
    apart = np.array([each for each in centres if each[0] > 330])
    half = measure_quality(255 - image, apart, heights[: len(apart)], is_light=True)
    assert half is not None
    assert half.shadow_fraction == 0.0


def test_the_least_height_is_that_of_the_farthest_print() -> None:
    image = np.full((600, 600), 230, np.uint8)
    centres = np.repeat(characters_on(image), 10, axis=0)
    heights = 10 + centres[:, 1] / 30
    found = measure_quality(image, centres, heights)
    assert found is not None
    assert 11 < found.text_height_min_px < 15
    assert found.text_height_median_px == pytest.approx(np.median(heights))


def test_text_at_the_border_is_cut_off() -> None:
    image = np.full((600, 600), 230, np.uint8)
    centres = characters_on(image)
    cut = np.concatenate([centres, [[5.0, 100.0]] * len(centres)])
    assert measured(image, centres).cut_off_fraction == 0.0
    assert measured(image, cut).cut_off_fraction == pytest.approx(0.5)


@pytest.mark.parametrize(("tilt_deg", "cut"), [(0, 0.0), (60, 0.0), (80, 1.0)])
def test_text_seen_obliquely_is_lost(tilt_deg: float, cut: float) -> None:
    """An affine view of a plane that is tilted about the vertical."""
    image = np.full((600, 600), 230, np.uint8)
    centres = characters_on(image)
    x, y = np.meshgrid(np.linspace(0, 599, 49), np.linspace(0, 599, 49))
    cosine = np.cos(np.radians(tilt_deg))
    mesh = np.stack([300 + (x - 300) * cosine, y], axis=-1)
    assert measured(image, centres, mesh).cut_off_fraction == pytest.approx(cut, abs=0.02)


def test_glare_and_shadow_are_large_parts_without_detail() -> None:
    image = np.full((600, 600), 200, np.uint8)
    centres = characters_on(image)
    image[150:350, 150:350] = 255
    image[400:500, 100:500] = 3
    area = np.ptp(centres[:, 0]) * np.ptp(centres[:, 1])
    quality = measured(image, centres[image[centres[:, 1].astype(int), centres[:, 0].astype(int)] == 20])
    assert quality.glare_fraction == pytest.approx(200 * 200 / area, rel=0.15)
    assert quality.shadow_fraction == pytest.approx(100 * 400 / area, rel=0.15)
    # White paper in a bright photo is no glare.
    bright = np.full((600, 600), 255, np.uint8)
    assert measured(bright, characters_on(bright)).glare_fraction == 0.0


@pytest.mark.parametrize(("paper", "glare"), [(255, 0.0), (245, 0.14)])
def test_white_paper_between_gray_panels_is_no_glare(paper: int, glare: float) -> None:
    """Of a page of a file: half of it is gray panels, and a white box in one is empty."""
    image = np.full((600, 600), paper, np.uint8)
    image[280:] = 120
    centres = characters_on(image)
    image[280:520] = 120
    image[86:230, 36:304] = 120
    image[90:226, 40:300] = 255
    places = centres.astype(int)
    assert measured(image, centres[image[places[:, 1], places[:, 0]] == 20]).glare_fraction == pytest.approx(
        glare, abs=0.03
    )


def test_a_white_part_with_print_is_no_glare() -> None:
    """Of a screenshot: white panels on a gray ground, and on one of them nothing is printed."""
    image = np.full((600, 600), 225, np.uint8)
    image[40:560, 40:220] = 255
    centres = characters_on(image)
    assert measured(image, centres).glare_fraction == 0.0
    image[40:560, 340:420] = 255
    left = centres[(centres[:, 0] < 340) | (centres[:, 0] > 420)]
    assert measured(image, left).glare_fraction == pytest.approx(80 / 490, rel=0.2)


def test_the_blurred_third_is_named() -> None:
    image = np.full((600, 900), 230, np.uint8)
    centres = characters_on(image)
    image[:, :300] = cv2.GaussianBlur(image, (0, 0), 5.0)[:, :300]
    assert measured(image, centres).blurred_side == "left"


def test_without_characters_there_are_no_figures() -> None:
    empty = np.zeros((0, 2))
    assert measure_quality(np.zeros((9, 9), np.uint8), empty, np.zeros(0), None) is None


@pytest.mark.parametrize(
    ("worse", "code"),
    [
        ({"text_height_min_px": 7.0}, "come-closer"),
        ({"blur_px": 6.0}, "hold-still"),
        ({"blurred_side": "left"}, "focus-evenly"),
        ({"line_tilt_rad": 0.05}, "flatten-sheet"),
        ({"paper_level": 43.0}, "more-light"),
        ({"cut_off_fraction": 0.2}, "show-all-text"),
        ({"glare_fraction": 0.1}, "avoid-glare"),
        ({"shadow_fraction": 0.1}, "avoid-shadow"),
    ],
)
def test_every_fault_has_its_advice_and_costs(worse: dict[str, object], code: str) -> None:
    figures = {name: getattr(GOOD, name) for name in CaptureQuality.__dataclass_fields__}
    quality = CaptureQuality(**{**figures, **worse})
    assert [advice.code for advice in advise(quality)] == [code]
    assert predict_character_error(quality) >= predict_character_error(GOOD)
    assert advise(GOOD) == ()


def test_a_reading_with_more_doubtful_letters_has_more_errors() -> None:
    def page(unsure: int) -> list[Word]:
        return [Word("letters", (0, 0, 90, 30), 0.3 if index < unsure else 0.96) for index in range(10)]

    shares = [doubtful_letters(page(unsure)) for unsure in (0, 3, 10)]
    assert shares == pytest.approx([0.006, 0.25, 0.82], abs=0.03)
    assert doubtful_letters([]) == 1.0, "where nothing was read, nothing is sure"
    errors = [predict_error_of_reading(GOOD, share) for share in shares]
    assert 0.0 < errors[0] < errors[1] < errors[2] < 1.0
    assert all(error < share for error, share in zip(errors, shares, strict=True)), (
        "a wrong word has right letters"
    )
    cut = predict_error_of_reading(replace(GOOD, cut_off_fraction=0.5), shares[0])
    assert cut == pytest.approx(0.5 + 0.5 * errors[0]), "what is cut off is lost"


def test_tiny_letters_are_read_worse_than_their_blur_says() -> None:
    """Below 4 px they are too small to read, however sharp."""
    expected = [
        predict_character_error(replace(GOOD, letter_px=each, worst_blur_px=1.0)) for each in (2, 2.8, 4, 8)
    ]
    assert all(worse > better for worse, better in pairwise(expected))
    assert expected[0] > 3 * expected[2]


def test_the_sentence_says_the_figure() -> None:
    (advice,) = advise(CaptureQuality(7.2, 18.0, 0.8, 0.8, 0.0, 0.0, 0.0))
    assert advice.detail == "Come closer: letters are 7 pixels high, 14 read well."


@pytest.mark.parametrize("angle_deg", [0.0, 90.0])
def test_motion_blurs_one_direction_which_is_the_worst(angle_deg: float) -> None:
    image = np.full((600, 600), 230, np.uint8)
    centres = characters_on(image)
    kernel = np.full((1, 9), 1 / 9) if angle_deg == 0.0 else np.full((9, 1), 1 / 9)
    quality = measured(np.asarray(cv2.filter2D(image, -1, kernel), np.uint8), centres)
    assert quality.blur_px < 1.0, "other edges are sharp"
    assert quality.worst_blur_px > 2.0, "a box of 9 pixels has a standard deviation of 2.6"
    assert predict_character_error(quality) > 2 * predict_character_error(measured(image, centres))


@pytest.mark.parametrize("sigma", [4.0, 12.0])
def test_noise_is_that_of_the_paper(sigma: float) -> None:
    image = np.full((600, 600), 210, np.uint8)
    centres = characters_on(image, ink=60)
    noisy = image + np.random.default_rng(2).normal(0, sigma, image.shape)
    quality = measured(np.clip(noisy, 0, 255).astype(np.uint8), centres)
    assert quality.noise == pytest.approx(sigma / 150, rel=0.35)


def test_figures_of_a_reduced_photo_are_those_of_the_whole() -> None:
    image = np.full((600, 600), 230, np.uint8)
    centres = characters_on(image)
    blurred = np.asarray(cv2.GaussianBlur(image, (0, 0), 4.0), np.uint8)
    half = np.asarray(cv2.resize(blurred, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA), np.uint8)
    reduced = measure_quality(half, (centres + 0.5) / 2 - 0.5, np.full(len(centres), HEIGHT_PX / 2))
    assert reduced is not None
    whole, enlarged = measured(blurred, centres), reduced.enlarged(2)
    assert enlarged.text_height_median_px == whole.text_height_median_px
    assert enlarged.blur_px == pytest.approx(whole.blur_px, rel=0.1)
    assert enlarged.contrast == pytest.approx(whole.contrast, abs=0.05)

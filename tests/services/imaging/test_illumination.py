"""Known gain fields over a page that the test sets itself."""

import tracemalloc
from functools import cache

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from services.imaging import illumination
from services.imaging.illumination import (
    estimate_background,
    flatten_illumination,
)
from services.imaging.normalization import normalize_illumination

PAPER = 220.0
SIZE = (980, 700)
"""Of a page whose print is large enough for every step."""


def set_page(height: int, width: int) -> NDArray[np.float64]:
    """A page that a test may change: its reflectance, as `reflectance_of`."""
    return reflectance_of(height, width).copy()


@cache
def reflectance_of(height: int, width: int) -> NDArray[np.float64]:
    """Reflectance (H, W) of a page of text lines: 1 for paper, about 0.1 for ink."""
    page = np.full((height, width), 255, np.uint8)
    scale = width / 1000
    for line in range(int(0.08 * height), int(0.93 * height), max(8, int(34 * scale))):
        cv2.putText(
            page, "Rectification of document images taken by camera phones", (int(60 * scale), line),
            cv2.FONT_HERSHEY_SIMPLEX, 0.85 * scale, 25, max(1, round(2 * scale)), cv2.LINE_AA,
        )  # fmt: skip
    return np.asarray(page / 255.0)


def gain_field(kind: str, height: int, width: int) -> NDArray[np.float64]:
    """Light (H, W), at most 1."""
    y, x = np.mgrid[0:height, 0:width] / max(height, width)
    fields = {
        "even": np.ones_like(x),
        "slope": 1.0 - 0.6 * x - 0.1 * y,
        "vignette": 1.0 / (1.0 + 1.5 * ((x - 0.4) ** 2 + (y - 0.5) ** 2)),
        "lamp": 0.3 + 0.7 * np.exp(-4.0 * ((x - 0.2) ** 2 + (y - 0.3) ** 2)),
        "shadow": np.where(x + 0.4 * y > 0.6, 0.4, 1.0),
    }
    return np.asarray(fields[kind])


def take_photo(reflectance: NDArray[np.float64], gain: NDArray[np.float64]) -> NDArray[np.uint8]:
    return np.asarray(np.rint(PAPER * reflectance * gain), dtype=np.uint8)


@pytest.mark.parametrize("kind", ["even", "slope", "vignette", "lamp"])
@pytest.mark.parametrize(("height", "width"), [(1400, 1000), (700, 1000), (280, 200)])
def test_smooth_light_is_recovered_within_bounds_on_both_sides(kind: str, height: int, width: int) -> None:
    gain = gain_field(kind, height, width)
    background = estimate_background(take_photo(set_page(height, width), gain))
    ratio = background / (PAPER * gain)
    assert ratio.min() > 0.90
    assert ratio.max() < 1.10
    assert abs(np.median(ratio) - 1.0) < 0.01


def test_shadow_edge_stays_where_it_is() -> None:
    height, width = 1400, 1000
    gain = gain_field("shadow", height, width)
    background = estimate_background(take_photo(set_page(height, width), gain))
    wrong = np.abs(background / (PAPER * gain) - 1.0) > 0.05
    edge = cv2.dilate((gain < 1).astype(np.uint8), np.ones((61, 61))) != (gain < 1)
    edge |= cv2.erode((gain < 1).astype(np.uint8), np.ones((61, 61))) != (gain < 1)
    assert not np.any(wrong & ~edge)
    assert wrong.mean() < 0.03


@pytest.mark.parametrize("kind", ["even", "slope", "vignette", "lamp"])
def test_flat_page_shows_white_paper_and_ink_of_the_right_reflectance(kind: str) -> None:
    page = set_page(*SIZE)
    flat = flatten_illumination(take_photo(page, gain_field(kind, *page.shape)))
    assert np.percentile(flat[page == 1.0], 5) > 240
    ink = page < 0.15
    assert np.quantile(np.abs(flat[ink] / 255.0 - page[ink]), 0.99) < 0.04


def test_colour_keeps_its_hue() -> None:
    page = set_page(700, 500)
    gain = gain_field("slope", 700, 500)
    colour = np.array([1.0, 0.9, 0.7])
    photo = np.rint(PAPER * (page * gain)[..., None] * colour).astype(np.uint8)
    flat = flatten_illumination(photo)
    paper = flat[page == 1.0].astype(float)
    # Red saturates first, as the gain is that of the luminance; green and blue stay in proportion.
    assert np.median(paper[:, 2] / paper[:, 1]) == pytest.approx(0.7 / 0.9, abs=0.02)
    assert np.std(paper[:, 2]) < 4.0


@pytest.mark.pipeline
@settings(max_examples=15, deadline=None)
@given(scale=st.floats(0.5, 2.0), kind=st.sampled_from(["slope", "vignette", "lamp"]))
def test_background_follows_the_scale_of_the_photo(scale: float, kind: str) -> None:
    page = set_page(900, 700)
    photo = take_photo(page, gain_field(kind, 900, 700))
    size = (round(700 * scale), round(900 * scale))
    scaled = np.asarray(cv2.resize(photo, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)
    expected = cv2.resize(estimate_background(photo), size, interpolation=cv2.INTER_LINEAR).astype(float)
    difference = np.abs(estimate_background(scaled) - expected)
    assert np.mean(difference) < 3.0
    assert np.quantile(difference, 0.99) < 10.0


@settings(max_examples=10, deadline=None)
@given(turns=st.integers(0, 3), flip=st.booleans(), kind=st.sampled_from(["slope", "shadow", "lamp"]))
def test_background_turns_with_the_photo(turns: int, flip: bool, kind: str) -> None:
    photo = take_photo(set_page(600, 400), gain_field(kind, 600, 400))
    background = estimate_background(photo)
    photo, background = np.rot90(photo, turns), np.rot90(background, turns)
    if flip:
        photo, background = photo[:, ::-1], background[:, ::-1]
    assert np.max(np.abs(estimate_background(np.ascontiguousarray(photo)) - background.astype(float))) <= 2


def test_given_text_height_removes_large_print_that_the_default_keeps() -> None:
    photo = np.full((800, 800), 200, np.uint8)
    cv2.putText(photo, "BIG", (60, 520), cv2.FONT_HERSHEY_SIMPLEX, 11, 20, 60, cv2.LINE_AA)
    background = estimate_background(photo, text_height_px=240.0)
    assert background.min() > 195


def test_gain_is_bounded_on_a_dark_desk() -> None:
    photo = np.full((600, 600), 4, np.uint8)
    photo[150:450, 150:450] = 240
    assert estimate_background(photo).min() == 40
    assert flatten_illumination(photo)[:100].max() <= 4 * 255 / 40 + 1


@pytest.mark.parametrize("shape", [(1, 1), (1, 7), (7, 1), (2, 2), (3, 500), (500, 3), (1, 5000), (33, 47)])
@pytest.mark.parametrize("value", [0, 1, 128, 255])
def test_constant_images_of_any_size(shape: tuple[int, int], value: int) -> None:
    photo = np.full(shape, value, np.uint8)
    background = estimate_background(photo)
    assert background.shape == shape
    assert background.dtype == np.uint8
    assert np.all(background == max(1, value))
    flat = flatten_illumination(photo)
    assert np.all(flat == (255 if value else 0))
    colour = flatten_illumination(np.repeat(photo[..., None], 3, axis=2))
    assert colour.shape == (*shape, 3)
    assert np.array_equal(colour[..., 1], flat)


@settings(max_examples=30, deadline=None)
@given(height=st.integers(1, 60), width=st.integers(1, 60), seed=st.integers(0, 99))
def test_any_noise_gives_an_image_of_the_same_shape(height: int, width: int, seed: int) -> None:
    photo = np.random.default_rng(seed).integers(0, 256, (height, width), dtype=np.uint8)
    before = photo.copy()
    flat = flatten_illumination(photo)
    assert flat.shape == photo.shape
    assert flat.dtype == np.uint8
    assert np.array_equal(photo, before)
    # The gain is never below 1: no pixel gets darker.
    assert np.all(flat >= photo)


def take_colour_photo(
    reflectance: NDArray[np.float64], gain: NDArray[np.float64], haze: float = 0.0
) -> NDArray[np.uint8]:
    """(H, W, 3) photo of a gray page; `haze` is added light, which makes ink lighter."""
    level = PAPER * gain * (reflectance * (1 - haze) + haze)
    return np.repeat(np.rint(level).astype(np.uint8)[..., None], 3, axis=2)


def tinted_photo(tint: tuple[float, float, float]) -> NDArray[np.uint8]:
    """A page (*SIZE, 3), brighter in its middle, whose paper has this colour."""
    light = gain_field("vignette", *SIZE)[..., None] * np.array(tint)
    return np.rint(PAPER * set_page(*SIZE)[..., None] * light).astype(np.uint8)


@cache
def level_on_white_paper() -> float:
    """Median of normalized ink."""
    white = normalize_illumination(tinted_photo((1.0, 1.0, 1.0)))
    return float(np.median(white[set_page(*SIZE) < 0.12]))


@pytest.mark.parametrize("kind", ["even", "slope", "vignette", "lamp", "shadow"])
@pytest.mark.parametrize("haze", [0.0, 0.3])
def test_normalized_page_is_dark_on_white_everywhere(kind: str, haze: float) -> None:
    page = set_page(*SIZE)
    gain = gain_field(kind, *page.shape)
    result = normalize_illumination(take_colour_photo(page, gain, haze))
    assert np.ptp(result, axis=2).max() == 0
    level = result[..., 0]
    # The penumbra of a shadow's edge is a tile wide at most.
    edge = cv2.morphologyEx(gain, cv2.MORPH_GRADIENT, np.ones((41, 41))) > 0.3
    paper, ink = (page == 1.0) & ~edge, (page < 0.12) & ~edge
    assert np.percentile(level[paper], 2) > 235
    assert np.percentile(level[ink], 98) < 60
    assert np.percentile(level[ink], 50) > 5
    thirds = np.array_split(np.arange(page.shape[1]), 3)
    means = [level[:, part][ink[:, part]].mean() for part in thirds]
    assert np.ptp(means) < 16


def test_normalized_transition_between_ink_and_paper_is_kept() -> None:
    page = np.asarray(cv2.GaussianBlur(set_page(1400, 1000), (0, 0), 2.0), dtype=np.float64)
    result = normalize_illumination(take_colour_photo(page, gain_field("slope", 1400, 1000)))[..., 0]
    middle = [result[(page > low) & (page < low + 0.1)].mean() for low in np.arange(0.4, 1.0, 0.1)]
    assert np.all(np.diff(middle) > 10)
    # Not a binary image: as many middle tones as the page has.
    assert np.mean((result > 80) & (result < 220)) > 0.5 * np.mean((page > 0.4) & (page < 0.9))


@pytest.mark.parametrize(
    ("ink", "strong", "weak"), [((200, 30, 40), 0, 1), ((30, 60, 190), 2, 0), ((20, 140, 60), 1, 0)]
)
def test_coloured_ink_stays_coloured(ink: tuple[int, int, int], strong: int, weak: int) -> None:
    page = set_page(1400, 1000)
    tint = np.ones((1400, 1000, 3))
    tint[500:800] = (np.array(ink) / 255 - 0.1) / 0.9  # lines in the middle are printed in colour
    reflectance = 1 - (1 - page[..., None]) * (1 - np.clip(tint, 0, 1))
    reflectance[:500], reflectance[800:] = page[:500, :, None], page[800:, :, None]
    photo = np.rint(PAPER * reflectance * gain_field("slope", 1400, 1000)[..., None]).astype(np.uint8)
    result = normalize_illumination(photo)
    coloured = np.zeros(page.shape, bool)
    coloured[510:790] = page[510:790] < 0.12
    mean = result[coloured].mean(axis=0)
    assert mean[strong] - mean[weak] > 60
    black = np.zeros(page.shape, bool)
    black[:490] = page[:490] < 0.12
    assert result[black].mean() < 50
    assert np.percentile(result[page == 1.0], 5) > 235


def test_coloured_paper_keeps_its_colour() -> None:
    paper = normalize_illumination(tinted_photo((1.0, 0.95, 0.6)))[set_page(*SIZE) == 1.0].astype(float)
    assert np.median(paper[:, 2] / paper[:, 1]) == pytest.approx(0.6 / 0.95, abs=0.03)
    assert np.percentile(paper[:, 1], 5) > 235


@pytest.mark.parametrize("tint", [(1.0, 0.95, 0.82), (0.92, 1.0, 0.9), (0.85, 0.93, 1.0)])
def test_a_tint_of_the_light_goes_and_ink_stays_as_dark_as_on_white_paper(
    tint: tuple[float, float, float],
) -> None:
    page = set_page(*SIZE)
    result = normalize_illumination(tinted_photo(tint)).astype(int)
    assert np.ptp(np.median(result[page == 1.0], axis=0)) <= 3
    assert np.percentile(result[page == 1.0], 5) > 235
    assert abs(np.median(result[page < 0.12]) - level_on_white_paper()) < 6


@pytest.mark.parametrize("kind", ["even", "slope"])
def test_picture_is_neither_bleached_nor_crushed(kind: str) -> None:
    page = set_page(1400, 1000)
    coarse = np.random.default_rng(4).uniform(0.1, 0.75, (18, 24))
    picture = cv2.resize(coarse, (700, 500), interpolation=cv2.INTER_CUBIC).clip(0.05, 0.85)
    page[450:950, 150:850] = picture
    result = normalize_illumination(take_colour_photo(page, gain_field(kind, *page.shape)))[..., 0]
    inside = (slice(480, 920), slice(180, 820))
    shown = result[inside] / 255.0
    assert np.mean(shown) == pytest.approx(np.mean(page[inside]), abs=0.12)
    assert np.std(shown) == pytest.approx(np.std(page[inside]), rel=0.35)
    assert np.corrcoef(shown.ravel(), page[inside].ravel())[0, 1] > 0.93
    outside = page == 1.0
    assert np.percentile(result[outside], 3) > 230


@pytest.mark.parametrize("shape", [(1, 1), (1, 40), (40, 1), (2, 3), (64, 64), (300, 200)])
@pytest.mark.parametrize("value", [0, 1, 77, 255])
def test_image_without_print_is_returned_as_it_is(shape: tuple[int, int], value: int) -> None:
    image = np.full((*shape, 3), value, np.uint8)
    result = normalize_illumination(image)
    assert np.array_equal(result, image)
    assert not np.shares_memory(result, image)


@settings(max_examples=30, deadline=None)
@given(height=st.integers(1, 90), width=st.integers(1, 90), seed=st.integers(0, 99))
def test_normalizing_noise_gives_an_image_of_the_same_shape(height: int, width: int, seed: int) -> None:
    image = np.random.default_rng(seed).integers(0, 256, (height, width, 3), dtype=np.uint8)
    before = image.copy()
    result = normalize_illumination(image)
    assert result.shape == image.shape
    assert result.dtype == np.uint8
    assert np.array_equal(image, before)


@pytest.mark.pipeline
@settings(max_examples=6, deadline=None)
@given(turns=st.integers(0, 3), flip=st.booleans(), kind=st.sampled_from(["slope", "lamp"]))
def test_normalization_turns_with_the_photo(turns: int, flip: bool, kind: str) -> None:
    def turned(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
        image = np.rot90(image, turns)
        return np.ascontiguousarray(image[:, ::-1] if flip else image)

    photo = take_colour_photo(set_page(840, 560), gain_field(kind, 840, 560), 0.2)
    difference = normalize_illumination(turned(photo)).astype(float) - turned(normalize_illumination(photo))
    assert np.mean(np.abs(difference)) < 1.0
    assert np.quantile(np.abs(difference), 0.999) < 12


@pytest.mark.pipeline
@settings(max_examples=6, deadline=None)
@given(scale=st.floats(0.7, 1.6), kind=st.sampled_from(["slope", "lamp"]))
def test_normalization_follows_the_scale_of_the_photo(scale: float, kind: str) -> None:
    photo = take_colour_photo(set_page(1100, 800), gain_field(kind, 1100, 800), 0.2)
    size = (round(800 * scale), round(1100 * scale))
    scaled = np.asarray(cv2.resize(photo, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)
    expected = cv2.resize(normalize_illumination(photo), size, interpolation=cv2.INTER_AREA).astype(float)
    assert np.mean(np.abs(normalize_illumination(scaled) - expected)) < 5.0


def test_row_bands_leave_no_seam(monkeypatch: pytest.MonkeyPatch) -> None:
    photo = take_colour_photo(set_page(700, 500), gain_field("lamp", 700, 500), 0.2)
    whole = normalize_illumination(photo), flatten_illumination(photo)
    monkeypatch.setattr(illumination, "_BAND_PIXELS", 500 * 37)
    banded = normalize_illumination(photo), flatten_illumination(photo)
    assert np.array_equal(whole[0], banded[0])
    assert np.array_equal(whole[1], banded[1])


def test_twelve_megapixels_need_little_memory_beside_the_result() -> None:
    small = take_colour_photo(set_page(800, 600), gain_field("slope", 800, 600), 0.2)
    photo = np.asarray(cv2.resize(small, (3000, 4000), interpolation=cv2.INTER_LINEAR), dtype=np.uint8)
    tracemalloc.start()
    try:
        normalize_illumination(photo)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert photo.nbytes < peak < photo.nbytes + 120e6

"""A halved image keeps places, levels and colours."""

import cv2
import numpy as np
import pytest

from services.imaging.reduction import Halves, halve, reduce_exactly, reduce_image


@pytest.mark.parametrize("size", [(400, 300), (401, 303)])
def test_places_stay_where_the_conventions_put_them(size: tuple[int, int]) -> None:
    x, y = np.meshgrid(np.arange(size[0]), np.arange(size[1]))
    image = np.round(20 + 0.25 * x + 0.3 * y).astype(np.uint8)
    small = halve(image).astype(float)
    columns, rows = np.meshgrid(*(2 * np.arange(side // 2) + 0.5 for side in size))
    assert small.shape == columns.shape
    assert np.abs(small - (20 + 0.25 * columns + 0.3 * rows)).max() <= 1.0


def test_fine_stripes_become_gray_and_colours_are_kept() -> None:
    assert np.ptp(halve(np.tile(np.array([0, 255], np.uint8), (64, 32)))) == 0
    image = np.random.default_rng(1).integers(0, 255, (40, 61, 3), dtype=np.uint8)
    assert halve(image).shape == (20, 30, 3)
    assert np.allclose(halve(image).mean(axis=(0, 1)), image[:, :60].mean(axis=(0, 1)), atol=1)


@pytest.mark.parametrize("factor", [0.9, 0.55, 0.4, 0.23])
def test_a_reduced_image_keeps_places_at_any_factor(factor: float) -> None:
    x, y = np.meshgrid(np.arange(401), np.arange(303))
    image = np.round(20 + 0.25 * x + 0.3 * y).astype(np.uint8)
    small = reduce_image(image, factor).astype(float)
    rows, columns = np.indices(small.shape)
    expected = 20 + 0.25 * ((columns + 0.5) / factor - 0.5) + 0.3 * ((rows + 0.5) / factor - 0.5)
    assert np.abs(np.array(small.shape) - factor * np.array(image.shape)).max() <= 1
    # Half a pixel of the answer at each far end, and the rounding of levels.
    assert np.abs(small - expected).max() <= 0.55 * 0.5 / factor + 1.0


@pytest.mark.parametrize("factor", [0.41, 0.2])
def test_exact_factors_put_places_where_they_are(factor: float) -> None:
    x, y = np.meshgrid(np.arange(402), np.arange(306))
    image = np.round(20 + 0.25 * x + 0.3 * y).astype(np.uint8)
    small, exact = reduce_exactly(image, factor)
    assert np.array_equal(small, reduce_image(image, factor))
    rows, columns = np.indices(small.shape)
    expected = 20 + 0.25 * ((columns + 0.5) / exact[0] - 0.5) + 0.3 * ((rows + 0.5) / exact[1] - 0.5)
    # By the rounded sizes the far end would be off by 0.18 and 0.65 levels.
    assert abs(float((small - expected)[-16:-1, -16:-1].mean())) < 0.1


def test_an_image_is_reduced_by_averages_and_never_enlarged() -> None:
    gray = np.random.default_rng(0).integers(0, 256, (60, 80), dtype=np.uint8)
    assert reduce_image(gray, 1.5) is gray
    half = reduce_image(gray, 0.5)
    assert half.shape == (30, 40)
    assert np.abs(half - gray.reshape(30, 2, 40, 2).mean(axis=(1, 3))).max() <= 1
    assert reduce_image(gray, 0.001).shape == (1, 1)
    assert reduce_image(gray, 0.001, least_side_px=8).shape == (8, 8)
    assert np.abs(float(reduce_image(gray, 0.3).mean()) - gray.mean()) < 2


def test_halves_are_made_once_and_reduce_as_the_image_itself() -> None:
    image = np.random.default_rng(2).integers(0, 255, (203, 301, 3), dtype=np.uint8)
    halves = Halves(image)
    assert halves.image is image
    assert np.array_equal(halves.halved(2), halve(halve(image)))
    assert halves.halved(2) is halves.halved(2)
    assert Halves.of(halves) is halves
    for factor in (0.9, 0.3, 0.11):
        assert np.array_equal(reduce_image(halves, factor), reduce_image(image, factor))


@pytest.mark.parametrize("fine", [True, False])
@pytest.mark.parametrize("factor", [0.11, 0.3, 0.5, 0.55, 0.66, 0.8])
def test_reduction_averages_noise_as_areas_do(factor: float, fine: bool) -> None:
    rng = np.random.default_rng(3)
    noise = np.clip(rng.normal(128, 20, (600, 800)), 0, 255).astype(np.uint8)
    small = reduce_image(noise, factor, fine=fine)
    areas = cv2.resize(noise, (small.shape[1], small.shape[0]), interpolation=cv2.INTER_AREA)
    assert 0.6 < float(small.std()) / float(areas.std()) < 1.06


def test_halves_of_small_photos_are_made_once() -> None:
    small, large = (np.zeros((side, side, 3), np.uint8) for side in (400, 2200))
    for image, is_kept in ((small, True), (large, False)):
        halves = Halves(image)
        assert (halves.halved(1) is halves.halved(1)) == is_kept
        assert np.array_equal(halves.halved(1), halve(image))
        assert halves.halved(2) is halves.halved(2)

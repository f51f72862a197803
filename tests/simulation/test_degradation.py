"""Spoiling does as much as it says: no less, no more, and the same again for the same seed."""

import cv2
import numpy as np
import pytest

from simulation.degradation import (
    PHONE,
    Degradation,
    Exposure,
    degrade,
    desk_texture,
    expose,
    shadow_field,
)

GRAY = np.full((240, 320, 3), 128, np.uint8)


def _rng(seed: int = 7) -> np.random.Generator:
    return np.random.default_rng(seed)


def test_the_default_spoils_nothing() -> None:
    assert np.array_equal(degrade(GRAY, Degradation(), _rng()), GRAY)


def test_noise_has_the_asked_strength() -> None:
    noisy = degrade(GRAY, Degradation(noise_sigma=6.0), _rng()).astype(float) - 128
    # Rounding to whole gray values adds 1/12 to the variance.
    assert 0.97 < noisy.std() / np.sqrt(36 + 1 / 12) < 1.03
    assert abs(noisy.mean()) < 0.1
    assert abs(np.corrcoef(noisy[..., 0].ravel(), noisy[..., 1].ravel())[0, 1]) < 0.02


def test_blur_has_the_asked_width() -> None:
    point = np.zeros((81, 81, 3), np.uint8)
    point[38:43, 38:43] = 255
    values = degrade(point, Degradation(blur_sigma_px=3.0), _rng())[..., 0].astype(float)
    x = np.arange(81) - 40
    variance = (values.sum(axis=0) * x**2).sum() / values.sum()
    # 5 px box: (25 - 1) / 12 = 2 of its own.
    assert 0.85 < (variance - 2.0) / 9.0 < 1.1


def test_motion_smears_one_way() -> None:
    point = np.zeros((81, 81, 3), np.uint8)
    point[38:43, 38:43] = 255
    values = degrade(point, Degradation(motion_px=15.0), _rng())[..., 0].astype(float)
    at = np.argwhere(values > 0) - 40
    spread = np.linalg.eigvalsh(np.cov(at.T, aweights=values[values > 0]))
    assert spread[0] == pytest.approx(2.0, abs=0.5)
    assert spread[1] == pytest.approx(2.0 + 15.0**2 / 12, rel=0.12)


def test_vignetting_darkens_corners_by_its_share() -> None:
    spoilt = degrade(GRAY, Degradation(vignetting=0.4), _rng())
    assert spoilt[120, 160, 0] == 128
    for corner in ((0, 0), (0, -1), (-1, 0), (-1, -1)):
        assert spoilt[corner][0] == pytest.approx(128 * 0.6, abs=1)


def test_shadow_reaches_its_depth_and_leaves_light() -> None:
    for seed in range(20):
        light = shadow_field(320, 240, 0.5, _rng(seed))
        assert light.min() == pytest.approx(0.5, abs=1e-4)
        assert light.max() == pytest.approx(1.0, abs=1e-4)
        assert np.abs(np.diff(light, axis=1)).max() < 0.2


def test_jpeg_changes_little_at_good_quality_and_much_at_bad() -> None:
    picture = cv2.GaussianBlur(_rng().integers(0, 255, (160, 160, 3), dtype=np.uint8), (0, 0), 2)

    def error(quality: int) -> float:
        spoilt = degrade(picture, Degradation(jpeg_quality=quality), _rng()).astype(float)
        return float(np.abs(spoilt - picture).mean())

    assert 0 < error(95) < 3
    assert error(10) > 2 * error(95)


def test_colours_keep_their_order_through_jpeg() -> None:
    red = np.zeros((32, 32, 3), np.uint8)
    red[..., 0] = 200
    assert degrade(red, Degradation(jpeg_quality=90), _rng())[16, 16].argmax() == 0


def test_the_same_seed_gives_the_same_photo() -> None:
    first, second = degrade(GRAY, PHONE, _rng(1)), degrade(GRAY, PHONE, _rng(1))
    assert np.array_equal(first, second)
    assert not np.array_equal(first, degrade(GRAY, PHONE, _rng(2)))
    assert np.array_equal(desk_texture(90, 70, _rng(1)), desk_texture(90, 70, _rng(1)))


@pytest.mark.parametrize("size", [(320, 240), (37, 500)])
def test_the_desk_is_textured_and_fills_its_size(size: tuple[int, int]) -> None:
    desk = desk_texture(*size, _rng())
    assert desk.shape == (size[1], size[0], 3)
    assert 4 < desk[..., 0].astype(float).std() < 80
    assert desk.mean() > 15


@pytest.mark.parametrize(
    "wrong", [{"shadow": 1.2}, {"vignetting": -0.1}, {"noise_sigma": -1.0}, {"jpeg_quality": 0}]
)
def test_impossible_degradations_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=r"shares|negative|quality"):
        Degradation(**wrong)  # type: ignore[arg-type]


def test_exposure_does_as_it_says() -> None:
    assert np.array_equal(expose(GRAY, Exposure()), GRAY)
    darker = expose(GRAY, Exposure(gain=0.5, balance=(1.0, 0.9, 0.8)))
    assert darker[0, 0].tolist() == [64, 58, 51]
    assert expose(GRAY, Exposure(gamma=2.0))[0, 0, 0] == round(128**2 / 255)
    slanted = expose(GRAY, Exposure(slant=(0.2, -0.1)))[..., 0].astype(float)
    assert slanted[120, -1] - slanted[120, 0] == pytest.approx(0.4 * 128, abs=1.5)
    assert slanted[-1, 160] - slanted[0, 160] == pytest.approx(-0.2 * 128, abs=1.5)
    with pytest.raises(ValueError, match="positive"):
        Exposure(gain=0.0)

"""Means and lengths over channels: against numpy's reductions."""

import numpy as np
import pytest

from services.imaging.channels import (
    BLACK_LEVELS,
    length_of_channels,
    log_brightness,
    mean_of_channels,
)


@pytest.mark.parametrize("channels", [2, 3])
@pytest.mark.parametrize("precision", [np.float32, np.float64])
def test_channels_are_summed_as_by_numpy(channels: int, precision: type) -> None:
    image = np.random.default_rng(channels).normal(0, 50, (31, 43, channels)).astype(precision)
    for found, expected in (
        (mean_of_channels(image), image.mean(axis=2)),
        (length_of_channels(image), np.linalg.norm(image, axis=2)),
    ):
        assert found.dtype == expected.dtype == precision
        assert np.allclose(found, expected, rtol=0, atol=100 * np.finfo(precision).eps)


def test_the_logarithm_of_brightness_is_that_of_the_mean() -> None:
    image = np.random.default_rng(4).integers(0, 256, (90, 131, 3), dtype=np.uint8)
    expected = np.log(mean_of_channels(image.astype(np.float32)) + BLACK_LEVELS)
    assert np.array_equal(log_brightness(image), expected)

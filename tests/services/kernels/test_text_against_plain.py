"""The kernels of the search for text and its directions beside their plain versions."""

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes

from services.arrays import Mask
from services.imaging.binary_masks import (
    close_mask,
    close_mask_plain,
    spread_mask,
    spread_mask_plain,
    threshold_by_windows,
    threshold_by_windows_plain,
)
from services.imaging.components import (
    keep_components,
    keep_components_plain,
    label_components,
    label_components_plain,
    sum_distances,
    sum_distances_plain,
)
from services.imaging.illumination import flatten_part, flatten_part_plain
from services.kernels.library import find_kernels
from services.texture_flow.projection_profiles import (
    WindowShape,
    measure_turned,
    measure_turned_plain,
    measure_windows,
    measure_windows_plain,
)

pytestmark = pytest.mark.skipif(find_kernels() is None, reason="needs kernels, which a C compiler makes")
SHAPES = array_shapes(min_dims=2, max_dims=2, min_side=1, max_side=150)
SEEDS = st.integers(0, 2**32 - 1)
SHARES = st.sampled_from([0.0, 0.02, 0.3, 0.5, 0.9, 1.0])
"""Of set pixels."""


def drawn(shape: tuple[int, ...], seed: int, share: float, blur: float = 0.0) -> Mask:
    """A mask of noise, or of blobs where that is blurred."""
    noise = np.random.default_rng(seed).random(shape)
    if blur:
        noise = cv2.GaussianBlur(noise, (0, 0), blur)
        share = 0.5 + (share - 0.5) / 10
    return np.asarray(noise < share)


@given(SHAPES, SEEDS, SHARES, st.integers(0, 90))
def test_spread_and_closed_masks(shape: tuple[int, ...], seed: int, share: float, half: int) -> None:
    mask, side = drawn(shape, seed, share), 2 * half + 1
    assert np.array_equal(spread_mask(mask, side), spread_mask_plain(mask, side))
    assert np.array_equal(close_mask(mask, side), close_mask_plain(mask, side))
    closed = cv2.morphologyEx(mask.view(np.uint8), cv2.MORPH_CLOSE, np.ones((side, side), np.uint8))
    assert np.array_equal(close_mask(mask, side), closed > 0)


def test_parts_of_masks_are_spread() -> None:
    part = drawn((70, 200), 3, 0.05)[5:60, 7:150]
    assert np.array_equal(spread_mask(part, 5), spread_mask_plain(part, 5))


def test_squares_have_a_middle() -> None:
    with pytest.raises(ValueError, match="odd"):
        spread_mask(np.ones((4, 4), bool), 2)


@given(SHAPES, SEEDS, SHARES, st.integers(1, 90))
def test_thresholds(shape: tuple[int, ...], seed: int, share: float, half: int) -> None:
    rng = np.random.default_rng(seed)
    gray = np.where(drawn(shape, seed, 0.3, 2.0), 60, 220) + rng.integers(-20, 20, shape)
    gray, area = gray.astype(np.uint8), drawn(shape, seed + 1, share, 3.0)
    ours = threshold_by_windows(gray, area, 2 * half + 1, -0.2, 12.0)
    assert np.array_equal(ours, threshold_by_windows_plain(gray, area, 2 * half + 1, -0.2, 12.0))


@pytest.mark.parametrize("level", [0, 255])
def test_windows_of_the_largest_size_do_not_overflow(level: int) -> None:
    gray = np.full((200, 190), level, np.uint8)
    gray[::2] = 255 - level
    area = np.ones(gray.shape, bool)
    ours = threshold_by_windows(gray, area, 181, -0.2, 12.0)
    assert np.array_equal(ours, threshold_by_windows_plain(gray, area, 181, -0.2, 12.0))
    assert ours.any()


@given(SHAPES, SEEDS, SHARES, st.sampled_from([0.0, 1.0, 3.0]))
def test_components(shape: tuple[int, ...], seed: int, share: float, blur: float) -> None:
    mask = drawn(shape, seed, share, blur)
    ours, plain = label_components(mask), label_components_plain(mask)
    assert ours.total == plain.total
    for one, other in zip(ours[1:], plain[1:], strict=True):
        assert one.dtype == other.dtype
        assert np.array_equal(one, other, equal_nan=one.dtype == np.float64)
    chosen = np.random.default_rng(seed).random(ours.total) < 0.5
    kept = keep_components(mask, ours.labels, chosen)
    assert np.array_equal(kept, keep_components_plain(mask, ours.labels, chosen))
    distances = sum_distances(mask, ours.labels, ours.total)
    if not mask.all():  # without ground everything is far
        np.testing.assert_allclose(distances, sum_distances_plain(mask, ours.labels, ours.total), rtol=1e-6)


def test_components_of_bytes_and_of_parts() -> None:
    mask = drawn((90, 131), 5, 0.4).astype(np.uint8)[3:80, 2:120] * 7
    assert np.array_equal(label_components(mask).labels, label_components_plain(mask > 0).labels)


@given(
    SEEDS,
    st.integers(0, 9),
    st.floats(-0.3, 0.3),
    st.floats(0.4, 3.0),
    st.sampled_from([(60, 12), (24, 5), (7, 3)]),
)
def test_windows(seed: int, count: int, turn: float, step: float, columns: tuple[int, int]) -> None:
    """Windows in the image, at its border, and beyond; the last bits are those of the machine's BLAS."""
    rng = np.random.default_rng(seed)
    ink = drawn((90, 130), seed, 0.4, 1.5)
    centres = rng.uniform((-30, -30), (160, 120), (count, 2))
    angles = turn + rng.normal(0, 0.02, count)
    along = step * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    across = 0.5 * np.stack([-np.sin(angles), np.cos(angles)], axis=1)
    slopes = np.linspace(-0.15, 0.15, 5)
    margin = int(np.ceil(0.15 * columns[0] / 2)) + 4
    shape = WindowShape(2 * margin + 37, columns[0], margin, columns[1])
    ours = measure_windows(ink, centres, along, across, slopes, shape)
    plain = measure_windows_plain(ink, centres, along, across, slopes, shape)
    for one, other in zip(ours, plain, strict=True):
        assert one.dtype == other.dtype
        np.testing.assert_allclose(one, other, rtol=1e-5, atol=1e-4)


def test_shifts_beyond_the_margin_are_refused() -> None:
    ink, at = np.ones((20, 20), bool), np.ones((2, 2))
    with pytest.raises(ValueError, match="margin"):
        measure_windows(ink, at, at, at, np.array([0.5]), WindowShape(30, 24, 4, 6))


@given(SEEDS, st.integers(0, 20), st.integers(0, 60), st.integers(0, 12))
def test_turned_windows(seed: int, count: int, half: int, reach: int) -> None:
    rng = np.random.default_rng(seed)
    whole = cv2.GaussianBlur(drawn((60, 90), seed, 0.3).astype(np.float32), (0, 0), 1.0)
    turned = whole[7:-4, 3:-9]
    height, width = turned.shape
    places = rng.integers(reach, (width - reach, height - reach), (count, 2))
    ours, plain = np.zeros((2, count, 2, 3))
    measure_turned(turned, places, reach, 2 * half + 1, ours[:, :, 1])
    measure_turned_plain(turned, places, reach, 2 * half + 1, plain[:, :, 1])
    assert np.array_equal(ours, plain)


def test_profiles_beyond_a_turned_image_are_refused() -> None:
    with pytest.raises(ValueError, match="lie in the image"):
        measure_turned(np.zeros((20, 20), np.float32), np.array([[3, 10]]), 4, 5, np.zeros((1, 2)))


@given(SHAPES, array_shapes(min_dims=2, max_dims=2, min_side=1, max_side=40), SEEDS, st.floats(0.01, 1.5))
def test_parts_in_even_light(shape: tuple[int, ...], lit: tuple[int, ...], seed: int, factor: float) -> None:
    rng = np.random.default_rng(seed)
    part, light = (rng.integers(0, 256, size, np.uint8) for size in (shape, lit))
    shift = rng.uniform(-20, 40, 2)
    light_from_part = np.array([[factor, 0.0, shift[0]], [0.0, 0.9 * factor, shift[1]]])
    ours = flatten_part(part, light, light_from_part)
    assert np.array_equal(ours, flatten_part_plain(part, light, light_from_part))


def test_turned_parts_are_refused() -> None:
    image = np.ones((9, 9), np.uint8)
    with pytest.raises(ValueError, match="axes"):
        flatten_part(image, image, np.array([[1.0, 0.1, 0.0], [0.0, 1.0, 0.0]]))


def test_a_column_of_an_image_is_one() -> None:
    # NumPy calls it contiguous, whatever the step along its single column is.
    column = np.ones((3, 5), bool)[1::2, 2::3][:, :1]
    assert column.strides == (10, 3)
    assert np.array_equal(label_components(column).labels, label_components_plain(column).labels)
    assert np.array_equal(spread_mask(column, 3), spread_mask_plain(column, 3))


def test_windows_of_a_part_of_an_image() -> None:
    ink = drawn((800, 800), 5, 0.4)[::2, ::2]
    at, slopes, shape = np.full((3, 2), 40.0), np.array([0.0]), WindowShape(30, 24, 4, 6)
    steps = np.tile([[1.0, 0.0], [0.0, 1.0]], (3, 1, 1))
    part = measure_windows(ink, at, steps[:, 0], steps[:, 1], slopes, shape)
    packed = measure_windows(ink.copy(), at, steps[:, 0], steps[:, 1], slopes, shape)
    assert all(np.array_equal(one, other) for one, other in zip(part, packed, strict=True))
    assert part.amount.min() > 0

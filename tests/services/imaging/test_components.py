"""Components of masks: against OpenCV's default algorithm, and against masks whose components are known."""

import cv2
import numpy as np
import pytest

from services.imaging.components import (
    USUAL_COMPONENTS,
    component_boxes,
    component_boxes_plain,
    label_components,
)
from services.kernels.library import find_kernels


@pytest.mark.parametrize("seed", range(8))
def test_components_are_numbered_and_measured_as_by_the_default_algorithm(seed: int) -> None:
    rng = np.random.default_rng(seed)
    noise = cv2.GaussianBlur(rng.random(rng.integers(3, 300, 2)), (0, 0), rng.uniform(0.3, 2.0))
    mask = noise > rng.uniform(0.45, 0.6)
    count, labels, stats, centres = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=8)
    found = label_components(mask)
    assert found.total == count
    assert np.array_equal(found.labels, labels)
    assert np.array_equal(found.stats[1:], stats[1:])
    assert np.array_equal(found.centres[1:], centres[1:])
    assert found.stats[0].tolist() == [0, 0, mask.shape[1], mask.shape[0], np.count_nonzero(~mask)]
    assert np.allclose(found.centres[0], centres[0], equal_nan=True)


def test_pixels_that_touch_at_corners_are_one_component() -> None:
    mask = np.zeros((6, 8), bool)
    mask[1, 1] = mask[2, 2] = True
    mask[4, 5:7] = True
    found = label_components(mask)
    assert found.total == 3
    assert found.labels[1, 1] == found.labels[2, 2] != found.labels[4, 5]
    assert found.stats[found.labels[1, 1]].tolist() == [1, 1, 2, 2, 2]
    assert found.centres[found.labels[4, 5]].tolist() == [5.5, 4.0]


@pytest.mark.parametrize("dtype", [np.bool_, np.uint8])
def test_a_mask_may_be_empty_or_full(dtype: type[np.generic]) -> None:
    empty, full = label_components(np.zeros((5, 7), dtype)), label_components(np.ones((5, 7), dtype))
    assert empty.total == 1
    assert empty.stats.tolist() == [[0, 0, 7, 5, 35]]
    assert full.stats[1].tolist() == [0, 0, 7, 5, 35]
    assert full.stats[0, 4] == 0
    assert full.centres[1].tolist() == [3.0, 2.0]


@pytest.mark.skipif(find_kernels() is None, reason="needs kernels, which a C compiler makes")
@pytest.mark.parametrize("size", [(1, 1), (1, 90), (75, 1), (61, 83), (300, 401)])
@pytest.mark.parametrize("share", [0.0, 0.1, 0.4, 0.7, 1.0])
def test_the_kernel_has_the_same_boxes_in_the_same_order(size: tuple[int, int], share: float) -> None:
    rng = np.random.default_rng([*size, round(10 * share)])
    for smooth in (0.0, 2.0):
        noise = rng.random(size)
        noise = cv2.GaussianBlur(noise, (0, 0), smooth) if smooth else noise
        mask = np.asarray(noise <= np.quantile(noise, share)) if share else np.zeros(size, bool)
        for held in (mask, np.pad(mask, 2)[2:-2, 2:-2]):
            np.testing.assert_array_equal(component_boxes(held), component_boxes_plain(held))


def test_more_components_than_usual_are_found() -> None:
    mask = np.zeros((400, 400), bool)
    mask[::2, ::2] = True
    assert len(component_boxes(mask)) == 200 * 200 > USUAL_COMPONENTS

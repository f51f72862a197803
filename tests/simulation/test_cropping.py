"""Cut photos show the same, and their truth says the same of it."""

import numpy as np
import pytest

from simulation.cropping import Cut, crop_photo
from simulation.flat_page import Page
from simulation.scenes import BOOK, POSES, photograph

PAGE = Page(np.random.default_rng(0).integers(0, 255, (250, 160), dtype=np.uint8))


@pytest.mark.parametrize("cut", [Cut("right", 0.25), Cut("left", 0.25), Cut("bottom", 0.2), Cut("top", 0.1)])
def test_pixels_and_truth_move_together(cut: Cut) -> None:
    whole = photograph(PAGE, POSES[0], 0.1, BOOK, size=(210, 270))
    part = crop_photo(whole, cut)
    left = round(0.25 * 210) if cut.side == "left" else 0
    top = 27 if cut.side == "top" else 0
    height, width = part.image.shape[:2]
    assert np.array_equal(part.image, whole.image[top : top + height, left : left + width])
    assert (width * height) / (210 * 270) == pytest.approx(1 - cut.share, abs=0.01)
    points = np.random.default_rng(1).uniform([20, 20], [width - 20, height - 20], (50, 2))
    shift = np.array([left, top])
    np.testing.assert_allclose(
        part.truth.photo_to_page(points), whole.truth.photo_to_page(points + shift), atol=1e-9
    )
    np.testing.assert_allclose(part.truth.normals(points), whole.truth.normals(points + shift), atol=1e-9)
    assert np.linalg.norm(part.truth.camera.offset_px) > 10
    # 35 mm equivalents count in diagonals: of the cut photo they promise less.
    assert part.exif_focal_length_px is not None
    ratio = np.hypot(width, height) / np.hypot(210, 270)
    assert part.exif_focal_length_px == pytest.approx(ratio * part.truth.focal_length_px, rel=0.03)

"""Two whole photos of a sheet that was bent between them become the better one of both."""

import cv2
import numpy as np
import pytest

from services.arrays import RgbImage
from services.contract.mosaic import MosaicParameters
from services.mosaic.disagreement import Disagreement, disagreement_notices
from services.mosaic.pipeline import mosaic
from tests.services.mosaic.views import page_image

pytestmark = pytest.mark.pipeline
SCANS = MosaicParameters(upright=False, rectify=False)


def bent_otherwise(page: RgbImage, most_px: float) -> RgbImage:
    """The page with print that is displaced within every few words, by up to `most_px`."""
    height, width = page.shape[:2]
    coarse = np.random.default_rng(3).uniform(-most_px, most_px, (height // 160, width // 160, 2))
    shift = cv2.resize(coarse.astype(np.float32), (width, height), interpolation=cv2.INTER_CUBIC)
    y, x = np.indices((height, width), np.float32)
    return np.asarray(
        cv2.remap(page, x + shift[..., 0], y + shift[..., 1], cv2.INTER_LINEAR, borderValue=(255, 255, 255)),
        np.uint8,
    )


def least_difference(page: RgbImage, scan: RgbImage) -> float:
    """Mean absolute difference of the middles, at the best shift."""
    middle = cv2.cvtColor(scan[300:900, 150:650], cv2.COLOR_RGB2GRAY)
    gray = cv2.cvtColor(page, cv2.COLOR_RGB2GRAY)
    found = cv2.matchTemplate(gray, middle, cv2.TM_CCOEFF_NORMED)
    _, _, _, (left, top) = cv2.minMaxLoc(found)
    part = gray[top : top + middle.shape[0], left : left + middle.shape[1]]
    return float(np.abs(part.astype(np.float64) - middle).mean())


@pytest.mark.parametrize("base", [0, 1])
def test_one_of_two_that_disagree_is_drawn(base: int) -> None:
    page = page_image()
    scans = [page, bent_otherwise(page, 6.0)]
    result = mosaic(scans, MosaicParameters(upright=False, rectify=False, base=base))
    assert [notice.code for notice in result.warnings] == ["sheet-moved"]
    assert f"images[{1 - base}]" in result.warnings[0].detail
    assert all(patch.placed for patch in result.patches)
    # The page lies as its leader does, but for a shift of a few pixels, and its words are not displaced.
    apart = [least_difference(result.image, scan) for scan in scans]
    assert apart[base] < 0.4 * apart[1 - base]


def test_views_that_agree_are_drawn_together() -> None:
    page = page_image()
    result = mosaic([page, bent_otherwise(page, 0.3)], SCANS)
    assert "sheet-moved" not in [notice.code for notice in result.warnings]


def test_a_notice_names_both() -> None:
    (notice,) = disagreement_notices([Disagreement(2, 0, 0.2)])
    assert (notice.code, "images[2]" in notice.detail, "images[0]" in notice.detail) == (
        "sheet-moved",
        True,
        True,
    )

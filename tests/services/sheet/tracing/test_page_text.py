"""Words between others belong to the text."""

import cv2
import numpy as np
import pytest

from services.sheet.tracing.page_text import CLOSING, TracedText


@pytest.mark.parametrize("height_px", [0.2, 3.0, 11.0, 60.0])
def test_filled_area_is_the_closing_of_the_text(height_px: float) -> None:
    rng = np.random.default_rng(8)
    area = cv2.dilate((rng.random((150, 220)) > 0.999).astype(np.uint8), np.ones((5, 9), np.uint8)) > 0
    area[:4, :4] = True
    gray = np.zeros(area.shape, np.uint8)
    text = TracedText(gray, area, area, 1.0, np.zeros((0, 2)), height_px)
    side = max(round(CLOSING * height_px), 1) | 1
    closed = cv2.morphologyEx(area.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((side, side), np.uint8))
    assert np.array_equal(
        text.filled_area, cv2.dilate(closed, np.ones((side // 4 | 1, side // 4 | 1), np.uint8)) > 0
    )

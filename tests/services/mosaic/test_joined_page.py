"""Photos that do not show the page's shape by themselves are joined, and then made flat together."""

import numpy as np
import pytest

from services.contract.mosaic import MosaicParameters
from services.errors import NoText
from services.geometry.homographies import translation
from services.mosaic import pipeline
from services.mosaic.pipeline import mosaic
from services.mosaic.results import MosaicResult
from tests.services.mosaic.test_pipeline import SIZE, frontal_error_px
from tests.services.mosaic.views import look_at, page_image, photograph

pytestmark = pytest.mark.pipeline

WIDTH, PART = SIZE
LOWER = 480
"""Rows from the upper photo to the lower one."""
CAMERA = look_at((500.0, 780.0), 20.0, 60.0, 0.85, WIDTH, LOWER + PART)


def join(monkeypatch: pytest.MonkeyPatch) -> MosaicResult:
    """Two parts of one photo, as if neither had enough print."""

    def refuse(*_: object) -> None:
        raise NoText("too little print")

    monkeypatch.setattr(pipeline, "flatten_photo", refuse)
    whole = photograph(page_image(), CAMERA, WIDTH, LOWER + PART)
    return mosaic([whole[:PART], whole[LOWER:]], MosaicParameters(upright=False))


def test_photos_without_a_shape_are_made_flat_together(monkeypatch: pytest.MonkeyPatch) -> None:
    result = join(monkeypatch)
    assert not result.warnings
    assert frontal_error_px(result, [CAMERA, np.asarray(translation(0, -LOWER) @ CAMERA)]) < 2.0


def test_photos_that_show_no_shape_together_say_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pipeline, "flatten_joined", lambda *_: None)
    assert [notice.code for notice in join(monkeypatch).warnings] == ["not-flat"]

"""The pipelines' stand-ins, in their places."""

import pytest

from services.operations import mosaic, rectify
from tests.services.operations.pipelines import MosaicPipeline, RectifyPipeline


@pytest.fixture
def pipeline(monkeypatch: pytest.MonkeyPatch) -> RectifyPipeline:
    """Of `rectify`."""
    stand_in = RectifyPipeline()
    monkeypatch.setattr(rectify, "rectify", stand_in)
    monkeypatch.setattr(rectify, "rectify_spread", stand_in.rectify_spread)
    monkeypatch.setattr(rectify, "ocr_engine", lambda language: "an engine")
    return stand_in


@pytest.fixture
def mosaic_pipeline(monkeypatch: pytest.MonkeyPatch) -> MosaicPipeline:
    """Of `mosaic`."""
    stand_in = MosaicPipeline()
    monkeypatch.setattr(mosaic, "mosaic", stand_in)
    monkeypatch.setattr(mosaic, "ocr_engine", lambda language: "an engine")
    return stand_in

"""Which focal length is known beforehand, and what a page alone has shown."""

import math

import pytest

from services.contract.cameras import CameraMemory
from services.contract.rectify import RectifyParameters
from services.geometry.photo_frame import PhotoFrame
from services.rectify.analysis.focal_length import focal_prior, remembered, seen_focal_length
from services.rectify.results import CameraEstimate

FRAME = PhotoFrame(400, 300)
PRECISE = CameraMemory("a", math.log(2.0), 0.012, 10)


@pytest.mark.parametrize(
    ("given", "exif", "memory", "source"),
    [
        (500.0, 480.0, PRECISE, "given"),
        (None, 480.0, PRECISE, "remembered"),
        (None, None, PRECISE, "remembered"),
        (None, 480.0, CameraMemory("a", 0.7, 0.05, 10), "exif"),
        (None, None, CameraMemory("a", 0.7, 0.05, 2), "assumed"),
        (None, None, None, "assumed"),
    ],
)
def test_the_more_precise_focal_length_is_used(
    given: float | None, exif: float | None, memory: CameraMemory | None, source: str
) -> None:
    assert focal_prior(FRAME, given, exif, memory).source == source


def test_a_camera_is_known_by_its_name() -> None:
    assert remembered(RectifyParameters(camera="a", cameras=(PRECISE,))) is PRECISE
    assert remembered(RectifyParameters(camera="b", cameras=(PRECISE,))) is None
    assert remembered(RectifyParameters(cameras=(PRECISE,))) is None


def test_the_prior_is_taken_out_of_what_a_page_shows() -> None:
    asked = RectifyParameters(camera="a", cameras=(PRECISE,))
    # The page says log 2.1 with a deviation of 0.024, twice the memory's: the fit is a fifth of the way.
    alone, prior = math.log(2.1), PRECISE.log_focal
    fitted = math.exp(prior + (alone - prior) / 5) * FRAME.unit_px
    camera = CameraEstimate(fitted, 1.0, "remembered", log_focal_deviation=0.024)
    seen = seen_focal_length(FRAME, camera, asked, None)
    assert seen is not None
    assert seen == (pytest.approx(2.1 * FRAME.unit_px, rel=1e-6), 0.024)


@pytest.mark.parametrize(
    "camera",
    [
        CameraEstimate(500.0, 1.0, "assumed", log_focal_deviation=None),
        CameraEstimate(500.0, 1.0, "estimated", log_focal_deviation=0.2),
        CameraEstimate(500.0, 1.0, "given", log_focal_deviation=0.01),
        CameraEstimate(500.0, 1.0, "estimated", (9.0, 9.0), "estimated", 0.01),
    ],
)
def test_other_pages_show_none(camera: CameraEstimate) -> None:
    assert seen_focal_length(FRAME, camera, RectifyParameters(), None) is None

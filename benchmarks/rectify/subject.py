"""What is being measured: the only calls of the benchmarks into the rectification."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import cast

import numpy as np

from benchmarks.common.figures import StripErrors
from benchmarks.common.residuals import (
    direction_error_deg,
    field_of_view_error_deg,
    normal_error_deg,
    ruling_errors,
    strip_of,
)
from benchmarks.dissertation_chain.flow_regression import regress_flow
from benchmarks.dissertation_chain.rulings.page_rulings import MAJOR_SIGMA, MINOR_SIGMA
from benchmarks.dissertation_chain.strip_page import find_strips
from services.arrays import RgbImage, Vector
from services.contract.images import DocumentLimits, Encoding, ImageLimits
from services.contract.rectify import Corners, RectifyParameters
from services.geometry.focal_prior import typical_focal_prior
from services.geometry.photo_frame import PhotoFrame
from services.imaging.codec import decode_image
from services.ocr.engine import OcrEngine
from services.operations.rectify_documents import rectify_uploads
from services.rectify import spread
from services.rectify.analysis.page_analysis import PageAnalysis, analyse_photo
from services.rectify.pipeline import rectify
from services.rectify.results import RectifyResult
from simulation.flat_page import Points
from simulation.truth import Truth


@dataclass(frozen=True, slots=True)
class FlowErrors:
    """Mean direction errors over the text (2.5), degrees; NaN where no flow was found."""

    major_deg: float
    minor_deg: float


def rectify_photo(
    photo: RgbImage,
    ocr: OcrEngine | None,
    exif_focal_length_px: float | None = None,
    corners: Points | None = None,
) -> RectifyResult:
    """The rectification as the service calls it, without EXIF (as the dissertation's) unless it is given.

    `corners` (4, 2) are given as by a person, where all of them lie in the photo.
    """
    height, width = photo.shape[:2]
    if corners is None or (corners < 0).any() or (corners > [width - 1, height - 1]).any():
        return rectify(photo, RectifyParameters(), exif_focal_length_px, ocr)
    known = cast(Corners, tuple((float(x), float(y)) for x, y in corners))
    return rectify(photo, RectifyParameters(corners=(known,)), exif_focal_length_px, ocr)


def rectify_spread(photo: RgbImage, ocr: OcrEngine | None) -> list[RectifyResult]:
    """The pages that are answered of the photo of an opened book, in reading order."""
    return list(spread.rectify_spread(photo, RectifyParameters(pages="both"), ocr=ocr).pages)


def rectify_file(path: Path, ocr: OcrEngine | None) -> tuple[RgbImage, Callable[[], RectifyResult]]:
    """The decoded photo, and the call that rectifies it with what its EXIF says, as the service would.

    Raises
    ------
    DocumentError
        When the file is no picture that the service accepts.
    """
    decoded = decode_image(path.read_bytes(), ImageLimits())
    return decoded.pixels, lambda: rectify(decoded.pixels, RectifyParameters(), decoded.focal_length_px, ocr)


def rectify_bytes(upload: bytes) -> dict[str, float]:
    """All that a worker does with an upload: decode, rectify, encode. Returns the stages' milliseconds."""
    reply = rectify_uploads([upload], RectifyParameters(), Encoding(), DocumentLimits())
    return dict(reply.answer.timings_ms)


def measure_steps(
    photo: RgbImage, truth: Truth, points: Points, *, curved: bool
) -> tuple[FlowErrors, StripErrors]:
    """The steps before the answer: both flows at photo points (N, 2) in the text and, of a curved page, strips.

    Raises
    ------
    DocumentError
        When the photo shows no text.
    """
    analysis = analyse_photo(photo)
    view = PhotoFrame(photo.shape[1], photo.shape[0])
    flows = curved_flows(analysis) if curved else flat_flows(analysis)
    strips = measure_strips(analysis, view, truth, points) if curved else StripErrors()
    return measure_flows(flows, truth, points), strips


@dataclass(frozen=True, slots=True)
class Flows:
    """Directions (N,) of both flows at photo points (N, 2); no minor flow where no strokes were found."""

    major: Callable[[Points], Vector]
    minor: Callable[[Points], Vector] | None


def flat_flows(analysis: PageAnalysis) -> Flows:
    """The dense fields of the analysis (2.3)."""
    return Flows(analysis.major_field.at, analysis.minor_field.at if analysis.minor_field else None)


def curved_flows(analysis: PageAnalysis) -> Flows:
    """Both flows between their samples: the dense fields would flatten the page's bends."""
    height = analysis.text_height_px
    major = regress_flow(analysis.major, MAJOR_SIGMA * height)
    minor = None if analysis.minor is None else regress_flow(analysis.minor, MINOR_SIGMA * height)
    return Flows(major.at, None if minor is None else minor.at)


def measure_flows(flows: Flows, truth: Truth, points: Points) -> FlowErrors:
    """Both texture flows as measured, before any shape is fitted to them, at photo points in the text."""
    if not len(points):
        return FlowErrors(float("nan"), float("nan"))
    major = direction_error_deg(flows.major(points), truth.major_flow(points))
    if flows.minor is None:
        return FlowErrors(major, float("nan"))
    return FlowErrors(major, direction_error_deg(flows.minor(points), truth.minor_flow(points)))


def measure_strips(analysis: PageAnalysis, view: PhotoFrame, truth: Truth, points: Points) -> StripErrors:
    """The dissertation's steps from the flows to rulings (3.3.3), their vanishing points (3.3.4) and strips (3.3.5)."""
    page = find_strips(analysis.evidence(view), typical_focal_prior())
    if page is None:
        return StripErrors()
    # The vanishing points in photo pixels; NaN where none is known.
    rulings, shape = page.rulings, page.shape
    meetings = rulings.vanishing_points.directions @ view.H_photo_centred.T
    meetings[~np.isfinite(rulings.vanishing_points.deviations)] = np.nan
    places = np.asarray(rulings.projected.points * view.unit_px + view.centre, np.float64)
    found = ruling_errors(places, np.asarray(rulings.projected.angles, np.float64), truth, meetings)
    strips = page.surface(view)
    place = strip_of(strips, points)
    return StripErrors(
        found.photo_deg,
        found.space_deg,
        field_of_view_error_deg(shape.initial_focal * view.unit_px, truth),
        normal_error_deg(np.asarray(shape.initial_normals, np.float64)[place], truth, points),
        field_of_view_error_deg(shape.focal * view.unit_px, truth),
        normal_error_deg(strips.normals[place], truth, points),
    )

"""What is being measured: the only calls of the benchmarks into the rectification."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from benchmarks.residuals import direction_error_deg
from services.arrays import RgbImage
from services.imaging.codec import ImageLimits, decode_image
from services.ocr.engine import OcrEngine
from services.operations import EncodingOptions, rectify_upload
from services.rectify.analysis import analyse_photo
from services.rectify.parameters import RectifyParameters
from services.rectify.pipeline import rectify
from services.rectify.results import RectifyResult
from simulation.flat_page import Points
from simulation.truth import Truth


@dataclass(frozen=True, slots=True)
class FlowErrors:
    """Mean direction errors over the text (2.5), degrees; NaN where no flow was found."""

    major_deg: float
    minor_deg: float


def rectify_photo(photo: RgbImage, ocr: OcrEngine | None) -> RectifyResult:
    """The rectification as the service calls it, without EXIF (as the dissertation's)."""
    return rectify(photo, RectifyParameters(), None, ocr)


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
    reply = rectify_upload(upload, RectifyParameters(), EncodingOptions(), ImageLimits())
    timings = reply.document["timings_ms"]
    assert isinstance(timings, dict)
    return {str(stage): float(spent) for stage, spent in timings.items()}


def measure_flows(photo: RgbImage, truth: Truth, points: Points) -> FlowErrors:
    """Both texture flows as measured, before any shape is fitted to them, at photo points in the text."""
    analysis = analyse_photo(photo)
    if not len(points):
        return FlowErrors(float("nan"), float("nan"))
    major = direction_error_deg(analysis.major_field.at(points), truth.major_flow(points))
    if analysis.minor_field is None:
        return FlowErrors(major, float("nan"))
    return FlowErrors(major, direction_error_deg(analysis.minor_field.at(points), truth.minor_flow(points)))

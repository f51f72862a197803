"""Which way up a page is: the orientation of its view, or the notice that it is unknown."""

from collections.abc import Callable

from services.arrays import GrayImage, RgbImage
from services.geometry.page_frame import Frame, resize_frame
from services.imaging.channels import luminance
from services.imaging.illumination import flatten_illumination
from services.imaging.reduction import reduce_image
from services.notices import Notice
from services.ocr.engine import OcrEngine
from services.rectify.analysis.page_analysis import PageAnalysis
from services.rectify.results import Orientation
from services.rectify.view.drawing import draw_gray_view
from services.rectify.view.orientation import estimate_orientation

LONG_SIDE_PX = 1600
"""Long side of the photo in which a few words are read, where its text was not found."""


def orient_page(
    photo: RgbImage, analysis: PageAnalysis | None, frame: Frame, ocr: OcrEngine | None
) -> tuple[Orientation, Notice | None]:
    """Orientation of the flat view, and a notice if it is unknown."""
    return tell_orientation(lambda: draw_for_reading(photo, analysis, frame), ocr)


def draw_for_reading(photo: RgbImage, analysis: PageAnalysis | None, frame: Frame) -> GrayImage:
    """Small flat view in gray under even light, in which words can be read."""
    if analysis is not None:
        text = analysis.strokes
        return draw_gray_view(text.image, text.factor, resize_frame(frame, text.factor), text.origin)
    factor = min(1.0, LONG_SIDE_PX / max(photo.shape))
    gray = reduce_image(luminance(photo), factor)
    return draw_gray_view(flatten_illumination(gray), factor, resize_frame(frame, factor))


def tell_orientation(
    draw: Callable[[], GrayImage], ocr: OcrEngine | None
) -> tuple[Orientation, Notice | None]:
    """Orientation of the flat-fielded view that `draw` returns, and a notice if it is unknown."""
    if ocr is None:
        return Orientation(0, False, None), Notice(
            "ocr-unavailable",
            "no OCR engine is installed, so the page may be upside down; text lines are horizontal.",
        )
    orientation = estimate_orientation(draw(), ocr)
    if (orientation.confidence or 0.0) < 0.5:
        return orientation, Notice(
            "orientation-unknown",
            "too little could be read to tell which way up the page is; it was not turned.",
        )
    return orientation, None

"""What a worker makes ready once."""

from contextlib import suppress
from pathlib import Path

import numpy as np

from services.arrays import RgbImage
from services.contract.images import Encoding, ImageLimits
from services.contract.layout import LayoutOptions, LayoutSettings
from services.contract.rectify import RectifyParameters
from services.errors import DocumentError
from services.imaging.codec import encode_image
from services.operations.layout import recognize_upload
from services.operations.reader import ocr_engine
from services.operations.rectify import rectify_upload


def warm_up(content_features: Path | None = None) -> dict[str, object]:
    """Do once what every first request would pay for: imports, the OCR engine, one tiny picture.

    `content_features` is the operator's settings file of content features, if there is one.
    Returns what is at hand: `ocr`, the engine's name or None.

    Raises
    ------
    InvalidContentSettings
        When that file cannot be used.
    """
    engine = ocr_engine()
    sheet = encode_image(_draw_sheet(), "jpeg")
    with suppress(DocumentError):  # if this is no text to the pipeline, the road to that answer is warm now
        rectify_upload(sheet, RectifyParameters(), Encoding("jpeg"), ImageLimits())
    recognize_upload(
        sheet, None, None, [], LayoutOptions(), LayoutSettings(content_features=content_features)
    )
    return {"ocr": None if engine is None else engine.name}


def _draw_sheet() -> RgbImage:
    """(480, 360, 3): dark strokes in words and lines on white, a page in miniature."""
    sheet = np.full((480, 360, 3), 255, np.uint8)
    for line, top in enumerate(range(40, 440, 20)):
        for stroke, left in enumerate(range(40, 320, 5)):
            if (stroke + 3 * line) % 7:  # every seventh is a gap between words
                sheet[top + stroke % 3 : top + 9, left : left + 3] = 30
    return sheet

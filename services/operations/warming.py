"""Preparation of a worker before its first request."""

from contextlib import suppress
from pathlib import Path

import numpy as np

from services.arrays import RgbImage
from services.contract.images import DocumentLimits, Encoding
from services.contract.layout import LayoutOptions, LayoutSettings
from services.contract.rectify import RectifyParameters
from services.contract.worker_facts import WorkerFacts
from services.errors import DocumentError
from services.imaging.codec import encode_image
from services.ocr.tesseract import installed_languages
from services.operations.layout import recognize_upload
from services.operations.reader import ocr_engine
from services.operations.rectify_documents import rectify_uploads


def warm_up(content_features: Path | None = None) -> WorkerFacts:
    """Import modules, open the OCR engine and rectify a small picture, so that the first request is not slower.

    `content_features` is the operator's settings file of content features (None: the file of this package).

    Raises
    ------
    InvalidContentSettings
        When that file is invalid.
    """
    engine = ocr_engine()
    sheet = encode_image(_draw_sheet(), "jpeg")
    with suppress(DocumentError):  # the modules are loaded even if the pipeline finds no text
        rectify_uploads([sheet], RectifyParameters(), Encoding("jpeg"), DocumentLimits())
    recognize_upload(
        sheet, None, None, [], LayoutOptions(), LayoutSettings(content_features=content_features)
    )
    return WorkerFacts() if engine is None else WorkerFacts(engine.name, tuple(installed_languages()))


def _draw_sheet() -> RgbImage:
    """A small page (240, 200, 3): lines of words made of dark strokes on white.

    The first photo after it takes as long as after a page of four times the pixels, which cost a worker 0.8 s more.
    """
    sheet = np.full((240, 200, 3), 255, np.uint8)
    for line, top in enumerate(range(40, 200, 20)):
        for stroke, left in enumerate(range(40, 160, 5)):
            if (stroke + 3 * line) % 7:  # every seventh is a gap between words
                sheet[top + stroke % 3 : top + 9, left : left + 3] = 30
    return sheet

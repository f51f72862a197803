"""The OCR engine that a worker's operations share."""

import functools

from services.ocr.engine import OcrEngine
from services.ocr.tesseract import open_engine


@functools.cache
def ocr_engine() -> OcrEngine | None:
    """The OCR engine of this process, opened at first use; None when none is installed."""
    return open_engine()

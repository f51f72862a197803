"""The OCR engine that a worker's operations share."""

import functools

from services.ocr.engine import OcrEngine
from services.ocr.tesseract import open_engine


@functools.cache
def ocr_engine() -> OcrEngine | None:
    """This process's OCR engine, opened at first use; None where none is installed."""
    return open_engine()

"""The OCR engines that a worker's operations share."""

import functools

from services.ocr.engine import OcrEngine
from services.ocr.tesseract import open_engine

MOST_ENGINES = 3
"""Engines that a worker keeps, one a language (20 to 80 MB each)."""


@functools.lru_cache(maxsize=MOST_ENGINES)
def ocr_engine(language: str | None = None) -> OcrEngine | None:
    """The OCR engine of this process for `language` (None: the default), opened at first use; None if there is none."""
    return open_engine(language)

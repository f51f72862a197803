"""Reading text: a small seam, and the engines behind it."""

import logging
from functools import cache

from services.ocr.engine import OcrEngine

_log = logging.getLogger(__name__)


def open_engine() -> OcrEngine | None:
    """A new engine for the calling thread or process; None where none is installed (told once in the log)."""
    from services.ocr.tesseract import EngineUnavailable, TesseractEngine

    try:
        return TesseractEngine()
    except EngineUnavailable as error:
        _tell_once(str(error))
        return None


@cache
def _tell_once(reason: str) -> None:
    _log.warning("No text is read, and pages are not turned upright: %s.", reason)

"""Print that the engine's page layout lost: lines first, then the lone numbers that are left of columns."""

from collections.abc import Sequence

from services.arrays import GrayImage
from services.ocr.engine import OcrEngine, Word
from services.ocr.lost_lines import with_lost_lines
from services.ocr.lost_numbers import with_lost_numbers


def with_lost_print(
    gray: GrayImage, words: Sequence[Word], engine: OcrEngine, ends_s: float = float("inf")
) -> list[Word]:
    """`words` of the page `gray` (H, W) in even light, and those that the engine reads in single lines and numbers.

    None is read after `ends_s` (of `time.process_time`).
    """
    return with_lost_numbers(gray, with_lost_lines(gray, words, engine, ends_s), engine, ends_s)

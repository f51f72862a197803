"""Interface of OCR engines; the service also works without one."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from services.arrays import GrayImage

MADE_UP = 0.3
"""Confidence below which a word that lies in no line of print is none: engines read specks and pictures as such."""
UNSURE = 0.5
"""Confidence below which a word may be wrong; a line that is read with more is print, however it looks."""

CERTAIN = 1.0
"""Confidence of a word that was not read, since the page's file says it. No engine is so sure."""


@dataclass(frozen=True, slots=True)
class Word:
    """A read word: its text, box (x0, y0, x1, y1) in pixels, and confidence 0-1.

    `line` numbers the lines of a reading; None where the engine names none.
    """

    text: str
    box: tuple[float, float, float, float]
    confidence: float
    line: int | None = None


class OcrEngine(Protocol):
    """An engine that reads dark text on a light background; one object per thread or process."""

    name: str

    def read_page(self, image: GrayImage) -> list[Word]:
        """Words of a whole page, in reading order."""
        ...

    def read_line(self, image: GrayImage) -> tuple[str, float]:
        """Text of one horizontal line crop, and the length-weighted confidence of its words, 0-1."""
        ...


@dataclass(frozen=True, slots=True)
class ReadDirection:
    """Orientation of a page: the clockwise rotation of its print (0, 90, 180 or 270 degrees).

    `confidence` is the engine's own measure, without an upper bound (15 is reliable for Tesseract). `script` is that of
    the print by its name in Unicode or one of Tesseract's (Japanese, Hangul); empty if it is not known.
    """

    turned_deg: int
    confidence: float
    script: str = ""


@runtime_checkable
class DirectionDetector(Protocol):
    """Optional part of an engine: detects the direction of a page, also in scripts that it cannot read."""

    def detect_direction(self, image: GrayImage) -> ReadDirection | None:
        """Direction of dark print on a whole page; None if there is too little print."""
        ...


@runtime_checkable
class LineReader(OcrEngine, Protocol):
    """An engine that also reads a line crop as words, without looking for lines in it."""

    def read_line_words(self, image: GrayImage) -> list[Word]:
        """Words of one horizontal line; boxes are in pixels of `image` (H, W) uint8."""
        ...


@runtime_checkable
class BoundedReader(OcrEngine, Protocol):
    """An engine that stops reading a page when its time is over."""

    def read_page_within(self, image: GrayImage, seconds: float) -> tuple[list[Word], bool]:
        """Words of a page that were read in `seconds` of processor time, and whether others were left."""
        ...


class SecondReader(Protocol):
    """Reads pages that an engine reads poorly."""

    def read_page_within(self, image: GrayImage, seconds: float) -> tuple[list[Word], bool]:
        """See `BoundedReader`. Confidences mean what those of the assisted engine mean."""
        ...


@runtime_checkable
class AssistedReader(OcrEngine, Protocol):
    """An engine that a second reader assists."""

    def second_reader(self) -> SecondReader | None:
        """That reader, opened at the first call; None if there is none for what the engine reads."""
        ...


def mean_confidence(words: Sequence[Word]) -> float:
    """Mean confidence of the words' letters; 0 without words."""
    letters = sum(len(word.text) for word in words)
    return sum(len(word.text) * word.confidence for word in words) / max(letters, 1)

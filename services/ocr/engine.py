"""Interface of OCR engines; the service also works without one."""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from services.arrays import GrayImage


@dataclass(frozen=True, slots=True)
class Word:
    """A read word: its text, box (x0, y0, x1, y1) in pixels, and confidence 0-1."""

    text: str
    box: tuple[float, float, float, float]
    confidence: float


class OcrEngine(Protocol):
    """An engine that reads dark text on a light ground; one object per thread or process."""

    name: str

    def read_page(self, image: GrayImage) -> list[Word]:
        """Words of a whole page, in reading order."""
        ...

    def read_line(self, image: GrayImage) -> tuple[str, float]:
        """Text of one horizontal line crop, and the length-weighted confidence of its words, 0-1."""
        ...


@dataclass(frozen=True, slots=True)
class ReadDirection:
    """How a page lies: the clockwise turn that its print has (0, 90, 180 or 270 degrees).

    `confidence` is the engine's own measure, without an upper bound (of Tesseract's, 15 is fair).
    """

    turned_deg: int
    confidence: float


@runtime_checkable
class DirectionDetector(Protocol):
    """What an engine may offer beside reading: the direction of a page, also in scripts it cannot read."""

    def detect_direction(self, image: GrayImage) -> ReadDirection | None:
        """Direction of the print on a whole page, dark on light; None where too little is seen."""
        ...

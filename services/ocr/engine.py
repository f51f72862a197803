"""The seam behind which text is read; the service starts and works without any engine."""

from dataclasses import dataclass
from typing import Protocol

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

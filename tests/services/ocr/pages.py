"""Pages of text that the tests set themselves, with Pillow's own font."""

from collections.abc import Sequence

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from services.arrays import GrayImage

_TEXT = (
    "the quick brown fox jumps over a lazy dog while images of documents taken by phones are "
    "rectified and read again by machines that know nothing about their contents"
)
WORDS = _TEXT.split()


def text_of_line(index: int, words: int) -> str:
    """Some words, others for every line."""
    return " ".join(WORDS[(5 * index + k) % len(WORDS)] for k in range(words))


def blank(width: int, height: int, ground: int = 255) -> Image.Image:
    return Image.new("L", (width, height), ground)


def set_lines(
    page: Image.Image,
    origin: tuple[int, int],
    lines: int,
    size_px: int,
    *,
    words: int = 8,
    ink: int = 20,
    leading: float = 1.5,
) -> Sequence[tuple[int, int, int, int]]:
    """Draw lines of text; the ink box (x0, y0, x1, y1) of each."""
    draw = ImageDraw.Draw(page)
    font = ImageFont.load_default(size_px)
    boxes = []
    for index in range(lines):
        place = (origin[0], origin[1] + round(index * size_px * leading))
        text = text_of_line(index, words)
        draw.text(place, text, fill=ink, font=font)
        x0, y0, x1, y1 = draw.textbbox(place, text, font=font)
        boxes.append((int(x0), int(y0), int(x1), int(y1)))
    return boxes


def text_page(
    *,
    width: int = 900,
    height: int = 1200,
    lines: int = 20,
    size_px: int = 28,
    ink: int = 20,
    ground: int = 255,
) -> GrayImage:
    page = blank(width, height, ground)
    set_lines(page, (60, 60), lines, size_px, ink=ink)
    return np.asarray(page, dtype=np.uint8)

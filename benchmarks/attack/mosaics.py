"""Mosaics of photos that are one and the same, or that have nothing in common."""

import io
import random
from functools import cache

import httpx
from PIL import Image, ImageDraw, ImageFont

from benchmarks.attack.clients import Answer, answer_of
from benchmarks.attack.row import Attack

MOST = 16
_SIZE, _MARGIN, _LETTER, _LEADING = (1600, 2100), 120, 30, 44
_TIMEOUT_S = 300.0


@cache
def printed_page(number: int, quality: int = 85) -> bytes:
    """A page of random words, a JPEG file of 3.4 megapixels; pages of different numbers have no words in common."""
    chance = random.Random(number)
    page = Image.new("RGB", _SIZE, "white")
    draw, font = ImageDraw.Draw(page), ImageFont.load_default(_LETTER)
    for top in range(_MARGIN, _SIZE[1] - _MARGIN, _LEADING):
        line = ""
        while draw.textlength(line, font) < _SIZE[0] - 2 * _MARGIN - 150:
            line += "".join(chance.choices("abcdefghijklmnopqrstuvwxyz", k=chance.randint(2, 9))) + " "
        draw.text((_MARGIN, top), line, "black", font)
    buffer = io.BytesIO()
    page.save(buffer, "JPEG", quality=quality)
    return buffer.getvalue()


def _join(photos: list[bytes], url: str) -> Answer:
    files = [("images", (f"{number}.jpg", photo)) for number, photo in enumerate(photos)]
    return answer_of(httpx.post(url + "/mosaic", files=files, data={"format": "json"}, timeout=_TIMEOUT_S))


ATTACKS = (
    Attack(
        "16 photos that are the same file",
        lambda url: _join([printed_page(0)] * MOST, url),
        ("ok",),
        is_quick=False,
    ),
    Attack(
        "the same photo encoded in 16 ways",
        lambda url: _join([printed_page(0, 70 + number) for number in range(MOST)], url),
        ("ok",),
        is_quick=False,
    ),
    Attack(
        "16 photos that have nothing in common",
        lambda url: _join([printed_page(number) for number in range(MOST)], url),
        ("not-overlapping",),
        is_quick=False,
    ),
)

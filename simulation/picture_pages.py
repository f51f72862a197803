"""Sheets without printed text: drawings, photographs, forms, music, handwriting, posters."""

from collections.abc import Callable, Mapping

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from simulation.flat_page import Page

Size = tuple[int, int]

_WHITE = (255, 255, 255)
_INK = (25, 25, 30)


def _drawing(size: Size, rng: np.random.Generator) -> Image.Image:
    """Hills, a house, trees and a sun in pen, hatched here and there."""
    width, height = size
    sheet = Image.new("RGB", size, _WHITE)
    pen = ImageDraw.Draw(sheet)
    thick = max(2, width // 400)
    for level in (0.45, 0.55, 0.68):
        x = np.linspace(0.08, 0.92, 60)
        y = level + 0.05 * np.sin(x * rng.uniform(4, 9) + rng.uniform(0, 6)) + 0.004 * rng.normal(size=60)
        pen.line([(a * width, b * height) for a, b in zip(x, y, strict=True)], _INK, thick)
    left, top = 0.3 * width, 0.58 * height
    wide, high = 0.28 * width, 0.16 * height
    pen.rectangle((left, top, left + wide, top + high), outline=_INK, width=thick)
    roof = [(left, top), (left + wide / 2, top - 0.1 * height), (left + wide, top), (left, top)]
    pen.line(roof, _INK, thick)
    for step in range(14):
        x0 = left + wide * step / 14
        pen.line((x0, top + high, x0 + wide / 14, top + high * 0.55), _INK, max(1, thick // 2))
    pen.ellipse(
        (0.7 * width, 0.12 * height, 0.85 * width, 0.12 * height + 0.15 * width), outline=_INK, width=thick
    )
    for _ in range(9):
        x0, y0 = rng.uniform(0.1, 0.9) * width, rng.uniform(0.72, 0.88) * height
        pen.line((x0, y0, x0, y0 - 0.06 * height), _INK, thick)
        for _ in range(12):
            dx, dy = rng.normal(scale=0.02 * width, size=2)
            pen.arc(
                (x0 + dx - 14, y0 - 0.07 * height + dy - 14, x0 + dx + 14, y0 - 0.07 * height + dy + 14),
                0,
                300,
                _INK,
                thick,
            )
    return sheet


def _photograph(size: Size, rng: np.random.Generator) -> Image.Image:
    """A landscape in colours with a white border, as a print has."""
    width, height = size
    border = round(0.04 * width)
    inner = (width - 2 * border, height - 2 * border)
    y = np.linspace(0, 1, inner[1])[:, None]
    picture = np.empty((inner[1], inner[0], 3))
    for channel, (top, foot) in enumerate(((90, 200), (140, 190), (220, 170))):
        picture[..., channel] = top + (foot - top) * np.minimum(y / 0.5, 1.0)
    x = np.linspace(0, 1, inner[0])
    for level, colour in ((0.45, (120, 130, 150)), (0.58, (80, 110, 80)), (0.75, (60, 80, 40))):
        ridge = level + sum(
            rng.uniform(0.01, 0.05) / k * np.sin(2 * np.pi * k * x + rng.uniform(0, 6)) for k in (1, 2, 4, 9)
        )
        picture[y > ridge] = colour
    clouds = cv2.resize(rng.normal(size=(9, 7)), inner, interpolation=cv2.INTER_CUBIC)
    grain = cv2.resize(rng.normal(size=(inner[1] // 6, inner[0] // 6)), inner, interpolation=cv2.INTER_CUBIC)
    picture += (18 * clouds + 9 * grain)[..., None]
    sheet = Image.new("RGB", size, _WHITE)
    sheet.paste(Image.fromarray(np.clip(picture, 0, 255).astype(np.uint8)), (border, border))
    return sheet


def _form(size: Size, rng: np.random.Generator) -> Image.Image:
    """A form of rules, boxes to tick and a shaded head."""
    width, height = size
    sheet = Image.new("RGB", size, _WHITE)
    pen = ImageDraw.Draw(sheet)
    left, right = 0.09 * width, 0.91 * width
    pen.rectangle((left, 0.07 * height, right, 0.12 * height), fill=(60, 80, 120))
    y = 0.16 * height
    for row in range(18):
        high = 0.036 * height
        pen.rectangle((left, y, right, y + high), outline=_INK, width=2)
        for cut in np.sort(rng.uniform(0.15, 0.9, row % 4)):
            x = left + cut * (right - left)
            pen.line((x, y, x, y + high), _INK, 2)
        if row % 3 == 2:
            for place in (0.03, 0.13):
                x = left + place * (right - left)
                pen.rectangle((x, y + 0.3 * high, x + 0.45 * high, y + 0.75 * high), outline=_INK, width=2)
        y += high * (1.5 if row % 6 == 5 else 1.0)
    return sheet


def _music(size: Size, rng: np.random.Generator) -> Image.Image:
    """Staves of five lines with bars, notes and beams."""
    width, height = size
    sheet = Image.new("RGB", size, _WHITE)
    pen = ImageDraw.Draw(sheet)
    left, right, gap = 0.08 * width, 0.92 * width, 0.0085 * width
    for top in np.arange(0.09, 0.9, 0.075) * height:
        for line in range(5):
            pen.line((left, top + line * gap, right, top + line * gap), _INK, max(1, width // 800))
        for bar in np.linspace(left, right, 5):
            pen.line((bar, top, bar, top + 4 * gap), _INK, max(2, width // 600))
        for place in np.arange(left + 5 * gap, right - 2 * gap, 3.6 * gap):
            y = top + gap * float(rng.integers(-1, 10)) / 2
            pen.ellipse((place - 0.65 * gap, y - 0.5 * gap, place + 0.65 * gap, y + 0.5 * gap), fill=_INK)
            pen.line((place + 0.6 * gap, y, place + 0.6 * gap, y - 3.3 * gap), _INK, max(2, width // 700))
    return sheet


def _handwriting(size: Size, rng: np.random.Generator) -> Image.Image:
    """A note: loops of a pen along lines that are not quite straight, ragged at their right."""
    width, height = size
    sheet = Image.new("RGB", size, _WHITE)
    pen = ImageDraw.Draw(sheet)
    em = 0.022 * width
    for line in range(17):
        x, y = 0.1 * width, (0.1 + 0.047 * line) * height
        end = width * rng.uniform(0.55, 0.9)
        slope = rng.normal(scale=0.008)
        while x < end:
            strokes = int(rng.integers(3, 9))
            t = np.linspace(0, 2 * np.pi * strokes, 26 * strokes)
            tall = np.interp(t, np.linspace(0, t[-1], strokes + 1), rng.uniform(0.35, 1.1, strokes + 1))
            along = x + em * (t / (2 * np.pi) * 0.8 + 0.3 * np.sin(t))
            down = y + slope * (along - 0.1 * width) - em * tall * (0.5 - 0.5 * np.cos(t))
            pen.line(list(zip(along, down, strict=True)), (30, 40, 110), max(2, width // 450), joint="curve")
            x = float(along[-1]) + 1.1 * em
    return sheet


def _poster(size: Size, rng: np.random.Generator) -> Image.Image:
    """Fields of colour, a diagram of boxes, and a coloured bleed at the head."""
    width, height = size
    sheet = Image.new("RGB", size, (250, 248, 240))
    pen = ImageDraw.Draw(sheet)
    pen.rectangle((0, 0, width, 0.16 * height), fill=(40, 90, 150))
    for row, column in np.ndindex(3, 2):
        x, y = (0.08 + 0.45 * column) * width, (0.24 + 0.24 * row) * height
        colour = tuple(int(value) for value in rng.integers(60, 230, 3))
        pen.rectangle((x, y, x + 0.36 * width, y + 0.15 * height), fill=colour, outline=_INK, width=3)
        if row < 2:
            middle = x + 0.18 * width
            pen.line((middle, y + 0.15 * height, middle, y + 0.24 * height), _INK, 4)
    pen.ellipse((0.4 * width, 0.4 * height, 0.6 * width, 0.4 * height + 0.2 * width), fill=(220, 60, 50))
    return sheet


_KINDS: Mapping[str, tuple[Callable[[Size, np.random.Generator], Image.Image], float]] = {
    "drawing": (_drawing, 1.414),
    "photograph": (_photograph, 1.5),
    "form": (_form, 1.294),
    "music": (_music, 1.333),
    "handwriting": (_handwriting, 1.414),
    "poster": (_poster, 1.25),
}
"""How each is drawn, and its height over its width: ISO 216, 10 x 15 cm, US letter, quarto, ISO 216, 8 x 10 in."""

PICTURE_PAGES = tuple(_KINDS)


def picture_page(name: str, width: int = 1700, seed: int = 1) -> Page:
    """The sheet of that name, whole, in colour.

    Raises
    ------
    KeyError
        When there is none of that name.
    """
    draw, aspect = _KINDS[name]
    sheet = draw((width, round(width * aspect)), np.random.default_rng(seed))
    pixels: NDArray[np.uint8] = np.asarray(sheet)
    return Page(pixels, paper=int(pixels[-1, -1].min()), name=name)

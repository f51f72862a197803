"""Zones with their labels, and the setter that places (and, if wanted, draws) them on a page."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Literal

import numpy as np
from PIL import Image, ImageDraw, ImageFont

DPI = 150
"""Lengths of a setter are in pixels of a page of 150 dpi, as most scans of letters are kept."""
MEASURED_AT_PX = 200
"""Size at which a letter's extents are measured; they are kept as shares of the em."""


@dataclass(frozen=True, slots=True)
class LabelledZone:
    """One zone and what it is; `box` (x0, y0, x1, y1) and `font_size` (the em, 0 without print) in pixels."""

    id: str
    box: tuple[int, int, int, int]
    label: str
    lines: int
    font_size: float
    text: str
    kind: Literal["text", "figure", "rule", "noise"] = "text"


@dataclass(frozen=True, slots=True, eq=False)
class LabelledPage:
    """A page of a known class with the truth of its zones, in reading order.

    `image` is (H, W) uint8, or None when the page was not drawn. Rules between zones are drawn, but are no zones.
    """

    image: np.ndarray | None
    width: int
    height: int
    dpi: int
    document_class: str
    zones: tuple[LabelledZone, ...]

    def document(self) -> dict[str, Any]:
        """The page as a sample of the interface: ready for JSON."""
        zones = [
            {
                "id": zone.id,
                "box": list(zone.box),
                "label": zone.label,
                "kind": zone.kind,
                "font_size": zone.font_size,
                "lines": zone.lines,
                "text": zone.text,
            }
            for zone in self.zones
        ]
        return {"width": self.width, "height": self.height, "zones": zones}


class ZoneSetter:
    """Places zones on a page of `width` x `height` (pixels at 150 dpi), then scaled by `scale`.

    A text's `y` is the top of its first line; the answer is where the next line would begin.
    """

    def __init__(self, width: int, height: int, *, scale: float = 1.0, draw: bool = True) -> None:
        if not 0.2 <= scale <= 4.0:
            raise ValueError("scale is between 0.2 and 4")
        self.width, self.height, self.scale = width, height, scale
        self.zones: list[LabelledZone] = []
        self._size = (round(width * scale), round(height * scale))
        self._canvas = Image.new("L", self._size, 255) if draw else None
        self._pen = ImageDraw.Draw(self._canvas) if self._canvas is not None else None

    def text(
        self,
        label: str,
        lines: Sequence[str],
        x: float,
        y: float,
        size: float,
        *,
        align: Literal["left", "centre", "right"] = "left",
        leading: float = 1.25,
        bold: bool = False,
        indent: float = 0.0,
        justified_to: float | None = None,
        ink_above: float = 0.0,
    ) -> float:
        """Set lines at `x` (their left, middle or right); all but the last stretched to `justified_to` wide.

        `ink_above` is the height of a scribble over the first line that belongs to the zone (a signature).
        """
        em = max(4, round(size * self.scale))
        left, right = float("inf"), float("-inf")
        top = bottom = 0.0
        for number, line in enumerate(lines):
            # The baseline stands 0.8 em under the top of the line: the typeface's ascender.
            baseline = round(self.scale * (y + number * leading * size) + 0.8 * em)
            start = self.scale * (x + (indent if number == 0 else 0.0))
            words = line.split()
            widths = [_set_width(word, em) for word in words]
            space = _extents(" ")[0] * em
            if justified_to is not None and number < len(lines) - 1 and len(words) > 1:
                room = self.scale * (justified_to - (indent if number == 0 else 0.0))
                space = (room - sum(widths)) / (len(words) - 1)
            length = sum(widths) + space * (len(words) - 1)
            start -= {"left": 0.0, "centre": length / 2, "right": length}[align]
            left = min(left, start + _extents(line[0])[1] * em)
            last = _extents(line[-1])
            right = max(right, start + length + (last[3] - last[0]) * em)
            if number == 0:
                top = baseline + min(_extents(letter)[2] for letter in line) * em
            bottom = max(bottom, baseline + max(_extents(letter)[4] for letter in line) * em)
            self._draw_words(words, widths, start, baseline, space, em, bold=bold)
        thick = _stroke(em) if bold else 0
        if ink_above > 0:
            top -= self.scale * ink_above
            self._scribble((left, top, left + 0.8 * (right - left), top + self.scale * 0.9 * ink_above))
        box = (left - thick, top - thick, right + thick, bottom + thick)
        self._add(label, box, len(lines), size * self.scale, "\n".join(lines), "text")
        return y + len(lines) * leading * size

    def paragraph(
        self,
        label: str,
        text: str,
        x: float,
        y: float,
        size: float,
        measure: float,
        *,
        leading: float = 1.25,
        indent: float = 0.0,
        justified: bool = False,
        bold: bool = False,
        align: Literal["left", "centre"] = "left",
    ) -> float:
        """Break a text into lines of at most `measure` and set them."""
        lines = broken(text, size, measure, indent)
        return self.text(
            label, lines, x, y, size, align=align, leading=leading, indent=indent, bold=bold,
            justified_to=measure if justified else None,
        )  # fmt: skip

    def figure(self, label: str, box: tuple[float, float, float, float]) -> None:
        """A picture: a frame with tones and a curve."""
        x0, y0, x1, y1 = (round(self.scale * value) for value in box)
        if self._pen is not None:
            self._pen.rectangle(
                (x0, y0, x1 - 1, y1 - 1), fill=215, outline=0, width=max(1, round(self.scale))
            )
            steps = np.linspace(0.0, 1.0, 60)
            curve = np.stack(
                [x0 + (x1 - x0) * steps, (y0 + y1) / 2 - 0.35 * (y1 - y0) * np.sin(9.0 * steps)], axis=1
            )
            self._pen.line(
                [(float(u), float(v)) for u, v in curve], fill=0, width=max(2, round(3 * self.scale))
            )
        self._add(label, (x0, y0, x1, y1), 0, 0.0, "", "figure")

    def handwriting(self, label: str, box: tuple[float, float, float, float]) -> None:
        """A scribble that fills the box."""
        x0, y0, x1, y1 = (self.scale * value for value in box)
        self._scribble((x0, y0, x1, y1))
        self._add(label, (x0, y0, x1, y1), 0, 0.0, "", "noise")

    def stamp(self, text: str, x: float, y: float, size: float) -> None:
        """One line of print in a frame."""
        self.text("stamp", [text], x, y, size, bold=True)
        zone = self.zones.pop()
        pad = 0.4 * size * self.scale
        box = (zone.box[0] - pad, zone.box[1] - pad, zone.box[2] + pad, zone.box[3] + pad)
        x0, y0, x1, y1 = (round(value) for value in box)
        if self._pen is not None:
            self._pen.rectangle((x0, y0, x1 - 1, y1 - 1), outline=0, width=max(1, round(3 * self.scale)))
        self._add("stamp", box, 1, zone.font_size, text, "text")

    def rule(self, x0: float, x1: float, y: float) -> None:
        """A gray hairline between zones, itself no zone."""
        if self._pen is not None:
            x0, x1, y = (round(self.scale * value) for value in (x0, x1, y))
            self._pen.line((x0, y, x1, y), fill=110, width=max(1, round(1.5 * self.scale)))

    def page(self, document_class: str) -> LabelledPage:
        """What was set so far."""
        image = None if self._canvas is None else np.asarray(self._canvas)
        dpi = round(DPI * self.scale)
        return LabelledPage(image, *self._size, dpi, document_class, tuple(self.zones))

    def _add(
        self,
        label: str,
        box: tuple[float, float, float, float],
        lines: int,
        font_size: float,
        text: str,
        kind: Literal["text", "figure", "noise"],
    ) -> None:
        x0, y0 = max(0, int(np.floor(box[0]))), max(0, int(np.floor(box[1])))
        x1, y1 = min(self._size[0], int(np.ceil(box[2]))), min(self._size[1], int(np.ceil(box[3])))
        number = len(self.zones) + 1
        zone = LabelledZone(f"z{number}", (x0, y0, x1, y1), label, lines, round(font_size, 2), text, kind)
        self.zones.append(zone)

    def _draw_words(
        self,
        words: Sequence[str],
        widths: Sequence[float],
        start: float,
        baseline: float,
        space: float,
        em: int,
        *,
        bold: bool,
    ) -> None:
        if self._pen is None:
            return
        x, font = start, _typeface(em)
        for word, width in zip(words, widths, strict=True):
            at = (round(x), baseline)
            self._pen.text(at, word, fill=0, font=font, anchor="ls", stroke_width=_stroke(em) if bold else 0)
            x += width + space

    def _scribble(self, box: tuple[float, float, float, float]) -> None:
        if self._pen is None:
            return
        x0, y0, x1, y1 = box
        turns = np.linspace(0.0, 1.0, 120)
        u = x0 + 3 + (x1 - x0 - 6) * (turns + 0.04 * np.sin(60 * turns)).clip(0, 1)
        v = (y0 + y1) / 2 + 0.45 * (y1 - y0 - 4) * np.sin(40 * turns) * np.cos(7 * turns)
        width = max(1, round(2 * self.scale))
        self._pen.line([(float(a), float(b)) for a, b in zip(u, v, strict=True)], fill=0, width=width)


def broken(text: str, size: float, measure: float, indent: float = 0.0) -> list[str]:
    """Lines of a text that are at most `measure` wide (a longer word has a line of its own)."""
    space = _extents(" ")[0] * size
    lines: list[str] = []
    line: list[str] = []
    used = indent
    for word in text.split():
        width = _width(word) * size
        if line and used + width > measure:
            lines.append(" ".join(line))
            line, used = [], 0.0
        line.append(word)
        used += width + space
    return [*lines, " ".join(line)] if line else lines


def height(text: str, size: float, measure: float, *, leading: float = 1.25, indent: float = 0.0) -> float:
    """How high a paragraph will stand."""
    return len(broken(text, size, measure, indent)) * leading * size


@lru_cache(maxsize=512)
def _extents(letter: str) -> tuple[float, float, float, float, float]:
    """Advance, and left, top, right, bottom of the ink from the baseline's start, as shares of the em."""
    font = _typeface(MEASURED_AT_PX)
    x0, y0, x1, y1 = font.getbbox(letter, anchor="ls")
    if letter == " ":
        x0 = y0 = x1 = y1 = 0
    sides = (x0 / MEASURED_AT_PX, y0 / MEASURED_AT_PX, x1 / MEASURED_AT_PX, y1 / MEASURED_AT_PX)
    return font.getlength(letter) / MEASURED_AT_PX, *sides


@lru_cache(maxsize=8192)
def _width(word: str) -> float:
    """A word's length as a share of the em, the same at every scale: lines break alike."""
    return float(sum(_extents(letter)[0] for letter in word))


@lru_cache(maxsize=16384)
def _set_width(word: str, em: int) -> float:
    """A word's length in pixels as it is set: at small sizes letters are fitted to the pixels."""
    return float(_typeface(em).getlength(word))


def _stroke(em: int) -> int:
    return max(1, round(em / 40))


@lru_cache(maxsize=64)
def _typeface(size_px: int) -> ImageFont.FreeTypeFont:
    """Pillow's own typeface: no font of the system is needed."""
    font = ImageFont.load_default(size_px)
    if not isinstance(font, ImageFont.FreeTypeFont):
        raise RuntimeError("Pillow was built without FreeType, which sets the pages")
    return font

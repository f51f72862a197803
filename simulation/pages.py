"""Pages of our own setting, and pages read from files: flat, with the truth of every word."""

import functools
import json
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import cycle
from pathlib import Path

import cv2
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from simulation import texts
from simulation.flat_page import Page, PageWord


@dataclass(frozen=True, slots=True)
class Block:
    """A heading or a paragraph in the column, or a picture (text "" and a height in lines)."""

    kind: str
    text: str = ""
    height_lines: int = 0


@dataclass(frozen=True, slots=True)
class Setting:
    """How a page is set; lengths relative to the body size, which is in pixels (1 em)."""

    width: int = 1600
    height: int = 2500
    body_px: int = 42
    leading: float = 1.42
    margin: float = 3.0
    columns: int = 1
    gutter: float = 1.6
    justified: bool = True


def set_page(blocks: tuple[Block, ...], setting: Setting, name: str = "set") -> Page:
    """Set blocks into columns with Pillow's own typeface; what does not fit is left away.

    Pillow brings the typeface along: no font of the system is needed, and every machine sets the same page.
    """
    composer = _Composer(setting)
    for block in blocks:
        if not composer.place(block):
            break
    image = np.array(composer.canvas)
    image.flags.writeable = False  # pages are kept and shared
    return Page(image, tuple(composer.lines), name=name)


@functools.lru_cache(maxsize=6)
def own_pages(width: int = 1600, height: int = 2500) -> tuple[Page, ...]:
    """Five pages: two of plain prose, one with a picture, one ragged, one of two columns. Images are read-only."""
    scale = width / 1600
    body = max(8, round(42 * scale))

    def setting(*, body_share: float = 1.0, columns: int = 1, justified: bool = True) -> Setting:
        size = max(8, round(body * body_share))
        return Setting(width, height, size, columns=columns, justified=justified)

    def prose(*books: tuple[str, ...], pictures: bool = False) -> tuple[Block, ...]:
        blocks: list[Block] = []
        for number, book in zip(range(1, 40), cycle(books), strict=False):
            blocks.append(Block("heading", f"{number} {' '.join(book[0].split()[:4]).strip('.,')}"))
            blocks += [Block("paragraph", text) for text in book]
            if pictures and number % 2:
                blocks.append(Block("picture", height_lines=7))
        return tuple(blocks)

    return (
        set_page(prose(texts.MOBY_DICK, texts.WALDEN), setting(), "own-1"),
        set_page(prose(texts.TWO_CITIES, texts.ALICE), setting(body_share=1.1), "own-2"),
        set_page(prose(texts.ALICE, texts.PRIDE_AND_PREJUDICE, pictures=True), setting(), "own-3"),
        set_page(prose(texts.WALDEN, texts.TWO_CITIES), setting(justified=False), "own-4"),
        set_page(
            prose(texts.PRIDE_AND_PREJUDICE, texts.MOBY_DICK), setting(body_share=0.9, columns=2), "own-5"
        ),
    )


def load_page(picture: Path, width: int | None = None, height: int | None = None) -> Page:
    """Read NAME.png and the words of NAME.json beside it (`lines`: lists of [word, x0, y0, x1, y1]).

    With `width`, the page is scaled to it; with `height`, it is then cut (between two lines of text) or
    continued with paper.

    Raises
    ------
    OSError
        When one of the two files cannot be read.
    """
    gray = np.asarray(Image.open(picture).convert("L"))
    record = json.loads(picture.with_suffix(".json").read_text(encoding="utf-8"))
    scale = 1.0 if width is None else width / gray.shape[1]
    lines = [
        [PageWord(str(text), _scaled_box(box, scale)) for text, *box in line] for line in record["lines"]
    ]
    if scale != 1.0:
        size = (round(gray.shape[1] * scale), round(gray.shape[0] * scale))
        way = cv2.INTER_AREA if scale < 1 else cv2.INTER_CUBIC
        gray = np.asarray(cv2.resize(gray, size, interpolation=way), np.uint8)
    if height is not None:
        gray, lines = _fit_height(gray, lines, height)
    kept = tuple(tuple(line) for line in lines if line)
    dpi = float(record.get("dpi", 300.0)) * scale
    return Page(np.ascontiguousarray(gray), kept, dpi, name=picture.stem)


def _scaled_box(box: list[float], scale: float) -> tuple[float, float, float, float]:
    """Pixel centres at integers: x -> (x + 0.5) s - 0.5."""
    x0, y0, x1, y1 = ((value + 0.5) * scale - 0.5 for value in box)
    return x0, y0, x1, y1


def _fit_height(
    gray: np.ndarray, lines: list[list[PageWord]], height: int
) -> tuple[np.ndarray, list[list[PageWord]]]:
    fitted = np.full((height, gray.shape[1]), 255, np.uint8)
    if len(gray) <= height:
        fitted[: len(gray)] = gray
        return fitted, lines
    margin = 0.03 * height
    kept = [[word for word in line if word.box[3] < height - margin] for line in lines]
    lowest = max((word.box[3] for line in kept for word in line), default=height - margin)
    lost = [word.box[1] for line in lines for word in line if word.box[3] >= height - margin]
    cut = int(min(min(lost, default=height), height))
    # A little below the last kept line; never into the first line that is lost.
    end = max(int(lowest) + 2, min(cut, height))
    fitted[:end] = gray[:end]
    return fitted, kept


class _Composer:
    """Places lines of words from the top of the first column to the foot of the last."""

    def __init__(self, setting: Setting) -> None:
        self.setting = setting
        self.canvas = Image.new("L", (setting.width, setting.height), 255)
        self.lines: list[tuple[PageWord, ...]] = []
        self._draw = ImageDraw.Draw(self.canvas)
        self._em = setting.body_px
        self._margin = setting.margin * self._em
        gutter = setting.gutter * self._em
        room = setting.width - 2 * self._margin - (setting.columns - 1) * gutter
        self._measure = room / setting.columns
        self._starts = [self._margin + i * (self._measure + gutter) for i in range(setting.columns)]
        self._column, self._y = 0, self._margin

    def place(self, block: Block) -> bool:
        """Set one block; False when the page is full."""
        if block.kind == "picture":
            return self._place_picture(block.height_lines)
        heading = block.kind == "heading"
        size = round(self._em * (1.35 if heading else 1.0))
        font = _typeface(size)
        weight = max(1, round(size / 40)) if heading else 0
        if heading:
            # No heading at the foot of a column: two lines must find room below it.
            if not self._room_for((1.35 + 2.6) * self._em * self.setting.leading):
                return False
            self._y += 0.6 * self._em if self._y > self._margin else 0.0
        indent = 0.0 if heading else 1.2 * self._em
        for words, last in self._broken(block.text, font, indent):
            if not self._room_for(size * self.setting.leading):
                return False
            justified = self.setting.justified and not (last or heading)
            self._set_line(words, font, weight, indent, justified=justified)
            self._y += size * self.setting.leading
            indent = 0.0
        self._y += 0.35 * self._em if heading else 0.0
        return True

    def _room_for(self, height: float) -> bool:
        if self._y + height <= self.setting.height - self._margin:
            return True
        self._column, self._y = self._column + 1, self._margin
        return self._column < self.setting.columns

    def _broken(
        self, text: str, font: ImageFont.FreeTypeFont, indent: float
    ) -> Iterator[tuple[list[str], bool]]:
        words, line = text.split(), list[str]()
        room = self._measure - indent
        for word in words:
            if line and font.getlength(" ".join([*line, word])) > room:
                yield line, False
                line, room = [], self._measure
            line.append(word)
        if line:
            yield line, True

    def _set_line(
        self,
        words: list[str],
        font: ImageFont.FreeTypeFont,
        weight: int,
        indent: float,
        *,
        justified: bool,
    ) -> None:
        room = self._measure - indent
        lengths = [font.getlength(word) for word in words]
        space = font.getlength(" ")
        if justified and len(words) > 1:
            space = (room - sum(lengths)) / (len(words) - 1)
        x, placed = self._starts[self._column] + indent, []
        for word, length in zip(words, lengths, strict=True):
            at = (round(x), round(self._y))
            self._draw.text(at, word, fill=0, font=font, stroke_width=weight)
            box = self._draw.textbbox(at, word, font=font, stroke_width=weight)
            placed.append(PageWord(word, (box[0] - 0.5, box[1] - 0.5, box[2] - 0.5, box[3] - 0.5)))
            x += length + space
        self.lines.append(tuple(placed))

    def _place_picture(self, height_lines: int) -> bool:
        height = height_lines * self._em * self.setting.leading
        if not self._room_for(height + self._em):
            return False
        left, top = round(self._starts[self._column]), round(self._y + 0.4 * self._em)
        right, foot = round(left + self._measure), round(top + height - 0.8 * self._em)
        rng = np.random.default_rng(len(self.lines))
        coarse = rng.integers(30, 230, (5, 9), dtype=np.uint8)
        tones = cv2.resize(coarse, (right - left, foot - top), interpolation=cv2.INTER_CUBIC)
        self.canvas.paste(Image.fromarray(np.asarray(tones, np.uint8)), (left, top))
        self._draw.rectangle((left, top, right, foot), outline=0, width=max(1, self._em // 14))
        self._y += height
        return True


def _typeface(size_px: int) -> ImageFont.FreeTypeFont:
    font = ImageFont.load_default(size_px)
    if not isinstance(font, ImageFont.FreeTypeFont):
        raise RuntimeError("Pillow was built without FreeType, which sets the pages")
    return font

"""Pages in ten languages, set with typefaces of the machine: their lines and the truth of what they say."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont, features

from simulation.flat_page import Page, PageWord
from simulation.language_texts import LanguageText, Script

FONT_FOLDERS = (Path("/usr/share/fonts"), Path("/usr/local/share/fonts"), Path.home() / ".local/share/fonts")
TYPEFACES: dict[Script, tuple[str, ...]] = {
    "Latin": ("DejaVuSerif.ttf", "DejaVuSans.ttf"),
    "Cyrillic": ("DejaVuSerif.ttf", "DejaVuSans.ttf"),
    "Greek": ("DejaVuSerif.ttf", "DejaVuSans.ttf"),
    "Arabic": ("Amiri-Regular.ttf", "NotoNaskhArabic-Regular.ttf", "DejaVuSans.ttf"),
    "Devanagari": (
        "Lohit-Devanagari.ttf",
        "NotoSansDevanagari-Regular.ttf",
        "NotoSerifDevanagari-Regular.ttf",
    ),
    "Japanese": ("ipag.ttf", "NotoSansCJK-Regular.ttc"),
    "Chinese": ("wqy-zenhei.ttc", "NotoSansCJK-Regular.ttc"),
}
"""Files of typefaces that have the letters of a script, the best first; Debian packages all of them."""
PACKAGES: dict[Script, str] = {
    "Latin": "fonts-dejavu-core",
    "Cyrillic": "fonts-dejavu-core",
    "Greek": "fonts-dejavu-core",
    "Arabic": "fonts-hosny-amiri",
    "Devanagari": "fonts-lohit-deva",
    "Japanese": "fonts-ipafont-gothic",
    "Chinese": "fonts-wqy-zenhei",
}
"""Debian's packages of the first typefaces."""
_SHAPED: tuple[Script, ...] = ("Arabic", "Devanagari")
_RIGHT_TO_LEFT: tuple[Script, ...] = ("Arabic",)
_MARGIN = 2.5
_LEADING = 1.6
_HEADING = 1.35
_BEFORE_PARAGRAPH = 0.5
_NOT_AT_START = "、。，．；：！？」』）ー々ゃゅょっァィゥェォャュョッ"
"""Signs that begin no line in Japanese and Chinese."""


def find_typeface(script: Script, folders: Sequence[Path] = ()) -> Path | None:
    """The best typeface file for a script, in `folders` or where Debian puts it; None if there is none.

    Scripts whose letters join need Pillow's complex layout (Raqm).
    """
    if script in _SHAPED and not features.check("raqm"):
        return None
    for name in TYPEFACES[script]:
        for folder in (*folders, *FONT_FOLDERS):
            found = sorted(folder.rglob(name)) if folder.is_dir() else []
            if found:
                return found[0]
    return None


def set_language_page(
    text: LanguageText, typeface: Path, width: int = 1200, height: int = 1700, em_px: int = 36
) -> Page:
    """The text as one column of lines; it is repeated until the page is full.

    Every `PageWord` is a whole line, in logical order, with the box of its ink.
    """
    canvas = Image.new("L", (width, height), 255)
    draw = ImageDraw.Draw(canvas)
    backwards = text.script in _RIGHT_TO_LEFT
    margin = _MARGIN * em_px
    lines: list[tuple[PageWord, ...]] = []
    y = margin
    parts = [(text.heading, _HEADING)] + [(paragraph, 1.0) for paragraph in text.paragraphs * 4]
    for part, share in parts:
        font = ImageFont.truetype(str(typeface), round(em_px * share))
        for line in _broken(part, font, width - 2 * margin, spaced=text.spaced):
            if y + em_px * share * _LEADING > height - margin:
                return _page(canvas, lines, text)
            at = (width - margin if backwards else margin, y + em_px * share)
            anchor, way = ("rs", "rtl") if backwards else ("ls", None)
            draw.text(at, line, fill=0, font=font, anchor=anchor, direction=way)
            x0, y0, x1, y1 = draw.textbbox(at, line, font=font, anchor=anchor, direction=way)
            lines.append((PageWord(line, (x0 - 0.5, y0 - 0.5, x1 - 0.5, y1 - 0.5)),))
            y += em_px * share * _LEADING
        y += _BEFORE_PARAGRAPH * em_px
    return _page(canvas, lines, text)


def _page(canvas: Image.Image, lines: list[tuple[PageWord, ...]], text: LanguageText) -> Page:
    return Page(np.array(canvas), tuple(lines), name=text.name)


def _broken(text: str, font: ImageFont.FreeTypeFont, room: float, *, spaced: bool) -> list[str]:
    """The text in lines that are at most `room` pixels long."""
    lines: list[str] = []
    joint = " " if spaced else ""
    for piece in text.split() if spaced else text:
        longer = f"{lines[-1]}{joint}{piece}" if lines else piece
        if lines and (font.getlength(longer) <= room or piece in _NOT_AT_START):
            lines[-1] = longer
        else:
            lines.append(piece)
    return lines

"""The overlay: the page with its labelled zones, and the class above it."""

import math
import unicodedata
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

import cv2
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from services.arrays import RgbImage
from services.layout.recognition.results import ClassMatch, Recognition, RecognizedZone
from services.layout.rendering.chip_placing import Rect, place_chips

MAX_SIDE_PX = 2000
"""Of the picture: a page is still read at 170 dpi, and a browser shows it at once."""
MIN_SIDE_PX = 900
"""Of the page in it: smaller ones are enlarged, so that labels are small compared with zones."""
MIN_WIDTH_PX = 480
"""Of the picture: the header says something on the narrowest strip too."""
CERTAIN = 0.8
"""Labels that are less probable show how probable they are."""

Colour = tuple[int, int, int]

PALETTE: tuple[Colour, ...] = (
    (0, 114, 178),  # blue
    (213, 94, 0),  # vermilion
    (17, 119, 51),  # green
    (136, 34, 85),  # wine
    (51, 34, 136),  # indigo
    (204, 102, 119),  # rose
    (68, 170, 153),  # teal
    (170, 68, 153),  # purple
    (153, 153, 51),  # olive
    (230, 159, 0),  # orange
    (86, 180, 233),  # sky
    (139, 94, 60),  # brown
)
"""Colours that colour-blind people can distinguish: Okabe and Ito (2008) and Tol's "muted" scheme (SRON/EPS/TN/09-002),
ordered so that neighbours differ in lightness too."""
_USUAL = {
    **{
        "title": 0,
        "author": 1,
        "affiliation": 2,
        "abstract": 3,
        "keywords": 4,
        "date": 5,
        "section-title": 6,
    },
    **{
        "figure": 7,
        "caption": 7,
        "footnote": 8,
        "margin-note": 8,
        "header": 9,
        "footer": 9,
        "page-number": 9,
    },
    **{"body": 10, "logo": 11, "licence": 11, "doi": 4, "correspondence": 3, "other": 8},
    **{
        "receiver": 0,
        "sender": 1,
        "cc": 1,
        "subject": 2,
        "salutation": 3,
        "closing": 4,
        "enclosure": 6,
        "ps": 6,
    },
    **{"signature": 7, "handwriting": 7, "typist-initials": 8, "field": 8, "reference": 2, "letterhead": 11},
    "stamp": 11,
}
"""Fixed colours of frequent labels of title pages and letters, so that those of one page differ. The colour of any
other label follows from a hash of its name."""
_UNLABELLED: Colour = (110, 116, 122)
_INK: Colour = (24, 28, 33)
_DESK: Colour = (226, 229, 233)
"""Colour next to a page that is narrower than the picture."""
_HEADER: Colour = (32, 38, 46)
_HEADER_TEXT: Colour = (255, 255, 255)
_HEADER_ASIDE: Colour = (166, 176, 188)
_HEADER_ACCENT: Colour = (98, 202, 182)
_HEADER_BAR: Colour = (58, 67, 78)

# Shares and sizes by eye, on pages of 96-300 dpi.
_INK_SHARE = 0.8
"""Of the page's contrast that is left when it is dimmed."""
_TINT_SHARE = 0.16
"""Of a zone's colour over its ground: print under it stays dark on nearly white."""
_NUMBER_SHARE = 0.62
"""Of the colour's brightness behind the number."""
_TEXT_SHARE = 0.0105
"""Height of the labels' type against the page's long side: somewhat larger than print of 10 points."""
_SMALLEST_TEXT_PX = 13
_LARGEST_TEXT_PX = 20
_HEADER_TEXTS = 3
"""Height of the header, and the least of the page's ground, in heights of the type."""
_LEAST_HEIGHT_TEXTS = 8
_ROUNDING = 4
"""Masks of corners are drawn this many times larger, then averaged."""


@dataclass(frozen=True, slots=True)
class _Frame:
    """Position of the page in the picture, and sizes of drawn elements, in pixels of the picture."""

    scale_x: float
    scale_y: float
    width: int
    height: int
    left: int
    top: int
    page_width: int
    page_height: int
    text: int
    line: int


def label_colour(label: str | None) -> Colour:
    """The colour of a label, the same on every page."""
    if label is None:
        return _UNLABELLED
    return PALETTE[_USUAL.get(label, zlib.crc32(label.encode(errors="replace")) % len(PALETTE))]


def draw_overlay(image: RgbImage | None, recognition: Recognition) -> RgbImage:
    """The page with its zones, at most `MAX_SIDE_PX` on its long side.

    `image` is the page in any size, None where only zones were given. A zone has the colour of its label, which its
    chip names after the zone's place in reading order (from 1), with its probability where that is below `CERTAIN`;
    zones without a label are gray and dashed, noise without one has no chip. The header says the class.
    """
    frame = _frame(recognition)
    page = _ground(image, frame)
    zones = sorted(recognition.zones, key=lambda zone: zone.order)
    boxes = [_box(zone, frame) for zone in zones]
    for zone, box in zip(zones, boxes, strict=True):
        _draw_zone(page, box, label_colour(zone.label), zone.label is not None, frame.line)

    picture = np.full((frame.height, frame.width, 3), _DESK, np.uint8)
    picture[: frame.top] = _HEADER
    picture[frame.top : frame.top + frame.page_height, frame.left : frame.left + frame.page_width] = page
    canvas = Image.fromarray(picture)
    _draw_header(canvas, recognition, frame)

    named = [at for at, zone in enumerate(zones) if zone.label is not None or zone.zone.kind != "noise"]
    font = _font(frame.text)
    chips = [_chip(zones[at], font, frame) for at in named]
    rects = [_moved(boxes[at], frame) for at in named]
    bounds = (0, frame.top, frame.width, frame.height)
    for chip, place in zip(chips, place_chips([chip.size for chip in chips], rects, bounds), strict=True):
        canvas.paste(chip, place, chip)
    return np.array(canvas)


def place_of_page(recognition: Recognition) -> tuple[float, float, int, int]:
    """Horizontal and vertical scale of the page in its overlay, and the left and top edge of the page there, pixels."""
    frame = _frame(recognition)
    return frame.scale_x, frame.scale_y, frame.left, frame.top


def _frame(recognition: Recognition) -> _Frame:
    width, height = recognition.page.width, recognition.page.height
    header = _HEADER_TEXTS * _LARGEST_TEXT_PX
    scale = max(1.0, MIN_SIDE_PX / max(width, height))
    scale = min(scale, MAX_SIDE_PX / width, (MAX_SIDE_PX - header) / height)
    page_width, page_height = max(1, round(width * scale)), max(1, round(height * scale))
    text = min(max(round(_TEXT_SHARE * max(page_width, page_height)), _SMALLEST_TEXT_PX), _LARGEST_TEXT_PX)
    whole_width, top = max(page_width, MIN_WIDTH_PX), _HEADER_TEXTS * text
    return _Frame(
        scale_x=page_width / width,
        scale_y=page_height / height,
        width=whole_width,
        height=top + max(page_height, _LEAST_HEIGHT_TEXTS * text),
        left=(whole_width - page_width) // 2,
        top=top,
        page_width=page_width,
        page_height=page_height,
        text=text,
        line=max(2, round(text / 7)),
    )


def _ground(image: RgbImage | None, frame: _Frame) -> RgbImage:
    """The page at its size in the picture, its ink dimmed; white without an image."""
    if image is None:
        return np.full((frame.page_height, frame.page_width, 3), 255, np.uint8)
    shrinks = image.shape[0] > frame.page_height or image.shape[1] > frame.page_width
    method = cv2.INTER_AREA if shrinks else cv2.INTER_CUBIC
    page = cv2.resize(image, (frame.page_width, frame.page_height), interpolation=method)
    return np.asarray(cv2.convertScaleAbs(page, alpha=_INK_SHARE, beta=255 * (1 - _INK_SHARE)), np.uint8)


def _box(zone: RecognizedZone, frame: _Frame) -> Rect:
    """Outline of the zone in pixels of the page as it is drawn, around its print, within the page and never empty."""
    x0, y0, x1, y1 = zone.zone.box
    left = min(max(math.floor(x0 * frame.scale_x) - frame.line, 0), frame.page_width - 1)
    top = min(max(math.floor(y0 * frame.scale_y) - frame.line, 0), frame.page_height - 1)
    right = min(max(math.ceil(x1 * frame.scale_x) + frame.line, left + 1), frame.page_width)
    bottom = min(max(math.ceil(y1 * frame.scale_y) + frame.line, top + 1), frame.page_height)
    return (left, top, right, bottom)


def _moved(box: Rect, frame: _Frame) -> Rect:
    """`box` in pixels of the picture."""
    return (box[0] + frame.left, box[1] + frame.top, box[2] + frame.left, box[3] + frame.top)


def _draw_zone(page: RgbImage, box: Rect, colour: Colour, labelled: bool, line: int) -> None:
    """Tint and outline, on `page`; the outline of an unlabelled zone is dashed and nothing is tinted."""
    x0, y0, x1, y1 = box
    zone = page[y0:y1, x0:x1]
    across, down = np.arange(x1 - x0), np.arange(y1 - y0)
    if labelled:
        zone[:] = np.round(zone * (1 - _TINT_SHARE) + np.array(colour) * _TINT_SHARE)
    else:
        across, down = (steps[steps % (6 * line) < 4 * line] for steps in (across, down))
    zone[:line, across] = zone[-line:, across] = colour
    zone[down, :line] = zone[down, -line:] = colour


def _chip(zone: RecognizedZone, font: ImageFont.FreeTypeFont, frame: _Frame) -> Image.Image:
    """The zone's number and label on its colour, RGBA with round corners."""
    colour = label_colour(zone.label)
    label = "" if zone.label is None else _drawable(zone.label)
    if label and zone.confidence < CERTAIN:
        label = f"{label}  {_percent(zone.confidence)}"
    number = str(zone.order + 1)
    pad, height = round(0.4 * frame.text), round(1.45 * frame.text)
    number_width = max(height, round(font.getlength(number)) + 2 * pad)
    label = _fitted(label, font, frame.width - number_width - 2 * pad)
    width = number_width + (round(font.getlength(label)) + 2 * pad if label else 0)

    chip = Image.new("RGBA", (width, height), (*colour, 255))
    draw = ImageDraw.Draw(chip)
    darker = tuple(round(_NUMBER_SHARE * part) for part in colour)
    draw.rectangle((0, 0, number_width - 1, height), fill=darker)
    draw.text((number_width / 2, height / 2), number, font=font, fill=(255, 255, 255), anchor="mm")
    draw.text((number_width + pad, height / 2), label, font=font, fill=_text_on(colour), anchor="lm")
    chip.putalpha(_rounded(width, height, round(0.28 * height)))
    return chip


def _rounded(width: int, height: int, radius: int) -> Image.Image:
    """Mask of a rectangle with round, smooth corners."""
    large = Image.new("L", (width * _ROUNDING, height * _ROUNDING), 0)
    outline = (0, 0, width * _ROUNDING - 1, height * _ROUNDING - 1)
    ImageDraw.Draw(large).rounded_rectangle(outline, radius * _ROUNDING, fill=255)
    return large.resize((width, height), Image.Resampling.BOX)


def _draw_header(canvas: Image.Image, recognition: Recognition, frame: _Frame) -> None:
    """Class and probability above the page, then the other candidates; a bar as long as it is probable."""
    title, probability, aside = _headline(recognition)
    large, small = _font(round(1.35 * frame.text)), _font(frame.text)
    draw = ImageDraw.Draw(canvas)
    pad, bar = round(0.8 * frame.text), max(3, round(0.22 * frame.text))
    base = round(0.62 * frame.top)
    shown = "" if probability is None else _percent(probability)
    room = frame.width - 2 * pad
    title = _fitted(_drawable(title), large, room - round(large.getlength(shown)) - pad)
    x = float(pad)
    for text, font, fill in (
        (title, large, _HEADER_TEXT),
        (shown, large, _HEADER_ACCENT),
        (_drawable(aside), small, _HEADER_ASIDE),
    ):
        fitted = _fitted(text, font, frame.width - pad - round(x))
        draw.text((x, base), fitted, font=font, fill=fill, anchor="ls")
        x += font.getlength(fitted) + (pad if fitted else 0)
    if probability is not None:
        draw.rectangle((0, frame.top - bar, frame.width, frame.top - 1), fill=_HEADER_BAR)
        filled = round(frame.width * min(max(probability, 0.0), 1.0))
        if filled:
            draw.rectangle((0, frame.top - bar, filled - 1, frame.top - 1), fill=_HEADER_ACCENT)


def _headline(recognition: Recognition) -> tuple[str, float | None, str]:
    """The class, its probability, and a remark."""
    classes, chosen = recognition.classes, recognition.chosen
    if chosen is not None:
        others = [other for other in classes if other.name != chosen.name][:2]
        return chosen.name, chosen.probability, _listed("else", others)
    if classes:
        return "unknown class", recognition.unknown_probability, _listed("nearest", classes[:2])
    count = len(recognition.zones)
    return "no class", None, f"{count} {'zone' if count == 1 else 'zones'}, no model to compare with"


def _listed(word: str, classes: Sequence[ClassMatch]) -> str:
    if not classes:
        return ""
    return f"{word} " + ", ".join(f"{each.name} {_percent(each.probability)}" for each in classes)


def _percent(share: float) -> str:
    """Whole percent; only 0 and 1 become 0 % and 100 %."""
    if 0 < share < 0.005:
        return "<1%"
    if 0.995 <= share < 1:
        return ">99%"
    return f"{share:.0%}"


def _drawable(text: str) -> str:
    """`text` in the characters that Pillow's own typeface has: ASCII, accents and the like left away."""
    folded = unicodedata.normalize("NFKD", text.replace("\u00df", "ss"))
    return "".join(
        letter if " " <= letter <= "~" else "?" for letter in folded if not unicodedata.combining(letter)
    )


def _font(size_px: int) -> ImageFont.FreeTypeFont:
    """Pillow's own typeface: no font of the system is needed, and every machine draws the same."""
    return cast(ImageFont.FreeTypeFont, ImageFont.load_default(size_px))


def _fitted(text: str, font: ImageFont.FreeTypeFont, room: int) -> str:
    """`text`, or as much of it as is at most `room` pixels long."""
    if font.getlength(text) <= room:
        return text
    kept = next((n for n in range(len(text) - 1, 0, -1) if font.getlength(text[:n] + "...") <= room), 0)
    return text[:kept].rstrip() + "..." if kept else ""


def _text_on(colour: Colour) -> Colour:
    """White or ink, whichever contrasts more (WCAG 2's relative luminance)."""
    linear = (np.array(colour) / 255.0) ** 2.2
    luminance = float(linear @ (0.2126, 0.7152, 0.0722))
    return _INK if (luminance + 0.05) ** 2 > 1.05 * 0.06 else (255, 255, 255)

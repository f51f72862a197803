"""Pages with one thing each that makes the segmentation of real pages hard, and the same pages without it.

Words in a figure, a table, a letterhead in columns, handwriting across print, a round seal, notes in the margin, line
numbers, a page number in the running head, the dark border of a scan, the reverse side shining through, the boxes of a
form, footnotes, columns, the listing of a program. All that stands on them is invented (`simulation.invented`).
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Literal, get_args

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from simulation import invented
from simulation.correspondence_pages import letter_page
from simulation.labelled_zones import LabelledPage, LabelledZone, ZoneSetter, height
from simulation.title_pages import A4_PX, set_body, title_page

GrayImage = NDArray[np.uint8]
Difficulty = Literal[
    "figure-words", "table", "letterhead-columns", "handwriting", "seal", "margin-notes", "line-numbers",
    "page-number", "dark-border", "bleed-through", "form", "footnotes", "two-columns", "three-columns",
    "listing",
]  # fmt: skip
DIFFICULTIES: tuple[Difficulty, ...] = get_args(Difficulty)
_SIZE = 20.0
"""10 pt at 150 dpi, in which pages are set."""


def hard_page(rng: np.random.Generator, difficulty: Difficulty, *, plain: bool = False) -> LabelledPage:
    """A page (150 dpi) with the named difficulty; `plain`: the same page without it.

    The zones are the true ones: text, figures, and as `noise` what is no part of the document (seals, handwriting).
    Borders and what shines through are no zones. A page with notes in its margin has no plain form, and comes as it is.
    """
    return _PAGES[difficulty](rng, plain)


def _figure_words(rng: np.random.Generator, plain: bool) -> LabelledPage:
    """A diagram: boxes with names, arrows, an axis with numbers."""
    setter, left, measure = _paper()
    y = set_body(rng, setter, left, 140.0, measure, _SIZE, 620.0)
    top, bottom = y + 10.0, y + 420.0
    setter.figure("figure", (left, top, left + measure, bottom))
    y = setter.text("caption", ["Figure 1: Stages of the invented process."], left, bottom + 14, 0.9 * _SIZE)
    set_body(rng, setter, left, y + 24, measure, _SIZE, setter.height - 160.0)
    page = setter.page("plain")
    if plain:
        return page
    pen, image = _pen(page)
    pen.rectangle((left + 3, top + 3, left + measure - 4, bottom - 4), fill=255)
    names = [str(word) for word in rng.permutation(invented.KEYWORDS)[:6]]
    for number, name in enumerate(names):
        x = left + 60 + (number % 3) * (measure - 120) / 3
        row = top + 60 + (number // 3) * 190
        pen.rectangle((x, row, x + 220, row + 80), outline=0, width=2)
        pen.text((x + 110, row + 40), name, fill=0, font=_font(17), anchor="mm")
        if number % 3 < 2:
            pen.line((x + 220, row + 40, x + (measure - 120) / 3, row + 40), fill=0, width=2)
    for tick in range(8):
        x = left + 60 + tick * (measure - 120) / 8
        pen.text((x, bottom - 26), f"{0.5 * tick:.1f}", fill=0, font=_font(15), anchor="mm")
    return replace(page, image=np.asarray(image))


def _table(rng: np.random.Generator, plain: bool) -> LabelledPage:
    """A ruled table of numbers between paragraphs; plain: without rules."""
    setter, left, measure = _paper()
    y = set_body(rng, setter, left, 140.0, measure, _SIZE, 560.0) + 10
    caption = "Table 1: Invented figures of four years."
    y = setter.text("caption", [caption], left, y, 0.9 * _SIZE) + 12
    rows, columns = 7, 5
    cells = [[f"{rng.uniform(0, 100):.1f}" for _ in range(columns)] for _ in range(rows)]
    cells[0] = ["Region", "2019", "2020", "2021", "2022"]
    for row in cells[1:]:
        row[0] = invented.pick(rng, invented.LAST_NAMES)
    step, wide = 1.7 * _SIZE, measure / columns
    table_top, first = y, len(setter.zones)
    for number, row in enumerate(cells):
        for column, cell in enumerate(row):
            setter.text("table", [cell], left + column * wide + 8, y + number * step + 5, 0.9 * _SIZE)
    y += rows * step
    texts = [zone.text for zone in setter.zones[first:]]
    del setter.zones[first:]
    box = (round(left), round(table_top), round(left + measure), round(y))
    setter.zones.append(LabelledZone("table", box, "table", rows, 0.9 * _SIZE, "\n".join(texts)))
    set_body(rng, setter, left, y + 24, measure, _SIZE, setter.height - 160.0)
    page = setter.page("plain")
    if plain:
        return page
    pen, image = _pen(page)
    for number in range(rows + 1):
        pen.line(
            (left, table_top + number * step, left + measure, table_top + number * step), fill=0, width=2
        )
    for column in range(columns + 1):
        pen.line((left + column * wide, table_top, left + column * wide, y), fill=0, width=2)
    return replace(page, image=np.asarray(image))


def _letterhead_columns(rng: np.random.Generator, plain: bool) -> LabelledPage:
    """A logo, the name of a firm, and its addresses side by side; plain: without the logo."""
    setter, left, measure = _paper()
    house = invented.firm(rng)
    if not plain:
        setter.figure("logo", (left, 70, left + 110, 170))
    setter.text("letterhead", [house.upper(), "Established 1912"], left + 140, 80, 1.2 * _SIZE, bold=True)
    offices = [invented.street(rng), invented.town(rng), f"Telephone {invented.phone(rng)}"]
    setter.text("letterhead-address", offices, left + 0.68 * measure, 84, 0.75 * _SIZE)
    y = 260.0
    y = setter.text("date", [invented.date(rng)], left, y, _SIZE) + 2 * _SIZE
    address = [
        invented.person(rng, courtesy=True),
        invented.firm(rng),
        invented.street(rng),
        invented.town(rng),
    ]
    y = setter.text("receiver", address, left, y, _SIZE) + 2 * _SIZE
    for _ in range(4):
        text = invented.sentences(rng, invented.LETTER_SENTENCES, 3)
        y = setter.paragraph("body", text, left, y, _SIZE, measure) + _SIZE
    return setter.page("letter")


def _handwriting(rng: np.random.Generator, plain: bool) -> LabelledPage:
    """A letter with a pen's note at its head, a tick beside and a stroke through a paragraph."""
    page = letter_page(rng)
    if plain:
        return page
    pen, image = _pen(page)
    width = page.width
    box = (round(0.55 * width), 30, round(0.9 * width), 100)
    turns = np.linspace(0.0, 1.0, 160)
    x = box[0] + (box[2] - box[0]) * (turns + 0.012 * np.sin(70 * turns))
    y = (box[1] + box[3]) / 2 + 30 * np.sin(55 * turns) * np.cos(9 * turns)
    pen.line([(float(a), float(b)) for a, b in zip(x, y, strict=True)], fill=40, width=3)
    body = [zone for zone in page.zones if zone.label == "body"]
    if body:
        x0, y0, _, y1 = body[int(rng.integers(len(body)))].box
        pen.line((x0 - 50, y0 + 20, x0 - 35, y0 + 40, x0 - 12, y0 - 14), fill=40, width=3)
        pen.line((x0 - 6, y0 - 4, x0 - 6, y1 + 4), fill=40, width=3)
    note = LabelledZone("note", box, "handwriting", 0, 0.0, "", "noise")
    return replace(page, image=np.asarray(image), zones=(*page.zones, note))


def _seal(rng: np.random.Generator, plain: bool) -> LabelledPage:
    """A letter with a round gray seal over the end of its text."""
    page = letter_page(rng)
    if plain:
        return page
    last = max(
        (zone for zone in page.zones if zone.label == "body"), key=lambda zone: zone.box[3], default=None
    )
    base = 900 if last is None else last.box[3]
    radius = 105
    centre = (round(page.width * rng.uniform(0.6, 0.75)), min(base + 40, page.height - radius - 20))
    seal = Image.new("L", (page.width, page.height), 255)
    pen = ImageDraw.Draw(seal)
    for each, wide in ((radius, 5), (radius - 32, 3)):
        pen.ellipse(
            (centre[0] - each, centre[1] - each, centre[0] + each, centre[1] + each), outline=90, width=wide
        )
    pen.text(centre, "SEAL", fill=90, font=_font(34), anchor="mm")
    for number, letter in enumerate("INVENTED COUNTY OF RECORD  "):
        angle = 2 * np.pi * number / 27
        at = (centre[0] + (radius - 17) * np.sin(angle), centre[1] - (radius - 17) * np.cos(angle))
        pen.text(at, letter, fill=90, font=_font(17), anchor="mm")
    box = (centre[0] - radius, centre[1] - radius, centre[0] + radius, centre[1] + radius)
    zone = LabelledZone("seal", box, "stamp", 0, 0.0, "", "noise")
    turned = seal.rotate(float(rng.uniform(-20, 20)), center=centre, fillcolor=255)
    image = np.minimum(_image(page), np.asarray(turned))
    return replace(page, image=image, zones=(*page.zones, zone))


def _margin_notes(rng: np.random.Generator, plain: bool) -> LabelledPage:
    del plain
    return title_page(rng, "margin")


def _line_numbers(rng: np.random.Generator, plain: bool) -> LabelledPage:
    """A manuscript: wide spacing, every line numbered in the margin."""
    setter, left, measure = _paper()
    y = setter.paragraph("title", invented.title(rng), left, 140, 1.5 * _SIZE, measure, bold=True) + 30
    for _ in range(5):
        text = invented.sentences(rng, invented.PAPER_SENTENCES, 4)
        if y + height(text, _SIZE, measure, leading=1.7) > setter.height - 160:
            break
        y = setter.paragraph("body", text, left, y, _SIZE, measure, leading=1.7, justified=True) + 1.2 * _SIZE
    page = setter.page("manuscript")
    if plain:
        return page
    pen, image = _pen(page)
    number, boxes = 0, []
    for zone in page.zones:
        if zone.label != "body":
            continue
        for row in range(zone.lines):
            number += 1
            # The setter puts a line's baseline 0.8 em below its top; the zone's top is that of its highest letter.
            baseline = zone.box[1] + 0.72 * _SIZE + row * 1.7 * _SIZE
            at = (left - 40, baseline)
            pen.text(at, str(number), fill=60, font=_font(14), anchor="rs")
            boxes.append((left - 58, baseline - 11, left - 40, baseline))
    x0, y0 = (min(box[side] for box in boxes) for side in (0, 1))
    x1, y1 = (max(box[side] for box in boxes) for side in (2, 3))
    column = LabelledZone(
        "numbers", (round(x0), round(y0), round(x1), round(y1)), "line-numbers", number, 14.0, ""
    )
    return replace(page, image=np.asarray(image), zones=(*page.zones, column))


def _page_number(rng: np.random.Generator, plain: bool) -> LabelledPage:
    """A running head with the page's number at its end; plain: without the number."""
    setter, left, measure = _paper()
    head = f"{invented.pick(rng, invented.LAST_NAMES)} and {invented.pick(rng, invented.LAST_NAMES)}"
    setter.text("header", [head], left, 70, 0.85 * _SIZE)
    number = str(int(rng.integers(2, 900)))
    if not plain:
        setter.text("page-number", [number], left + measure, 70, 0.85 * _SIZE, align="right")
    set_body(rng, setter, left, 130.0, measure, _SIZE, setter.height - 160.0)
    return setter.page("plain")


def _dark_border(rng: np.random.Generator, plain: bool) -> LabelledPage:
    """A scan whose page was smaller than the glass: black at two or three sides, with a ragged edge."""
    page = letter_page(rng)
    if plain:
        return page
    image = _image(page).copy()
    for side in rng.permutation(4)[: int(rng.integers(2, 4))]:
        turned = np.rot90(image, int(side))
        depth = rng.uniform(12, 55)
        along = np.arange(turned.shape[1])
        edge = depth + rng.uniform(-0.012, 0.012) * along + 3 * np.sin(along / rng.uniform(30, 120))
        below = np.arange(turned.shape[0])[:, None] < edge[None, :]
        turned[below] = rng.integers(0, 45, size=int(np.count_nonzero(below)))
    return replace(page, image=image)


def _bleed_through(rng: np.random.Generator, plain: bool) -> LabelledPage:
    """The print of the reverse side, mirrored, blurred, a third as dark as print."""
    page = letter_page(rng)
    reverse = letter_page(rng)
    if plain:
        return page
    mirrored = cv2.resize(_image(reverse)[:, ::-1], (page.width, page.height), interpolation=cv2.INTER_AREA)
    back = cv2.GaussianBlur(mirrored, (0, 0), 1.6).astype(np.float64)
    strength = rng.uniform(0.35, 0.5)
    through = 255.0 - strength * (255.0 - back)
    return replace(page, image=np.minimum(_image(page), through).astype(np.uint8))


def _form(rng: np.random.Generator, plain: bool) -> LabelledPage:
    """Fields in boxes, each with a small caption and a value; plain: without the boxes."""
    setter, left, measure = _paper()
    y = setter.text("title", ["APPLICATION FOR A READER'S CARD"], left, 110, 1.4 * _SIZE, bold=True) + 24
    wide, tall = measure / 2, 84.0
    boxes = []
    fields = [
        ("Name", invented.person(rng)), ("Date", invented.date(rng)), ("Street", invented.street(rng)),
        ("Town", invented.town(rng)), ("Telephone", invented.phone(rng)), ("Employer", invented.firm(rng)),
        ("Branch", invented.pick(rng, invented.TOWNS)), ("Profession", invented.pick(rng, invented.POSITIONS)),
    ]  # fmt: skip
    for number, (caption, value) in enumerate(fields):
        x, top = left + (number % 2) * wide, y + (number // 2) * tall
        setter.text(f"{caption.lower()}-caption", [f"{number + 1}. {caption}"], x + 8, top + 8, 0.6 * _SIZE)
        setter.text(caption.lower(), [value], x + 16, top + 42, _SIZE)
        boxes.append((x, top, x + wide, top + tall))
    text = invented.sentences(rng, invented.LETTER_SENTENCES, 3)
    setter.paragraph("body", text, left, y + 4 * tall + 30, 0.8 * _SIZE, measure)
    page = setter.page("form")
    if plain:
        return page
    pen, image = _pen(page)
    for box in boxes:
        pen.rectangle(box, outline=0, width=2)
    return replace(page, image=np.asarray(image))


def _footnotes(rng: np.random.Generator, plain: bool) -> LabelledPage:
    """Body with notes at the foot, as near to it as its own paragraphs; plain: two lines and a rule between."""
    setter, left, measure = _paper()
    foot = setter.height - 230.0
    y = set_body(rng, setter, left, 130.0, measure, _SIZE, foot)
    small = 0.8 * _SIZE
    gap = 2.4 * _SIZE if plain else 0.9 * _SIZE
    if plain:
        setter.rule(left, left + 200, y + 1.2 * _SIZE)
    notes = " ".join(f"{number} {invented.sentences(rng, invented.PAPER_SENTENCES, 1)}" for number in (1, 2))
    setter.paragraph("footnote", notes, left, y + gap, small, measure)
    return setter.page("plain")


def _two_columns(rng: np.random.Generator, plain: bool) -> LabelledPage:
    return _columns(rng, 2, 0.9 * _SIZE, 60.0 if plain else 26.0)


def _three_columns(rng: np.random.Generator, plain: bool) -> LabelledPage:
    return _columns(rng, 3, 0.75 * _SIZE, 50.0 if plain else 20.0)


def _columns(rng: np.random.Generator, count: int, size: float, gutter: float) -> LabelledPage:
    """Columns side by side below a heading across them, whose lines are level with each other."""
    setter, left, measure = _paper()
    setter.text("title", [invented.title(rng)], left, 90, 1.5 * _SIZE, bold=True)
    column = (measure - (count - 1) * gutter) / count
    for number in range(count):
        set_body(rng, setter, left + number * (column + gutter), 170.0, column, size, setter.height - 140.0)
    return setter.page("columns")


def _listing(rng: np.random.Generator, plain: bool) -> LabelledPage:
    """A program between paragraphs, every character in a cell of its own; plain: with the widths of usual print."""
    setter, left, measure = _paper()
    y = set_body(rng, setter, left, 140.0, measure, _SIZE, 520.0) + 20
    row, part, whole = (str(name) for name in rng.permutation(["row", "cell", "term", "page", "n", "k"])[:3])
    lines = [
        f"{whole}, count = 0, {int(rng.integers(1, 90))}",
        f"# what is left of every {row}",
        f"for {row} in table({part}, {int(rng.integers(100, 900))}):",
        f"    {part} = weight({row}, count)",
        f"    {whole} = {whole} + {part} * {row}   # not less than 0",
        "    count = count + 1",
        f"mean = {whole} / count",
        f"print(mean, {whole}, count)  # as above",
    ][: int(rng.integers(5, 9))]
    size, step = 0.8 * _SIZE, 1.1 * _SIZE
    font, cell = _font(round(size)), 0.62 * size
    advance = cell if not plain else 0.5 * size
    bottom, right = y + len(lines) * step, left + advance * max(map(len, lines))
    zone = LabelledZone(
        "listing",
        (round(left), round(y), round(right), round(bottom)),
        "listing",
        len(lines),
        size,
        "\n".join(lines),
    )
    setter.zones.append(zone)
    set_body(rng, setter, left, bottom + 30, measure, _SIZE, setter.height - 160.0)
    page = setter.page("plain")
    pen, image = _pen(page)
    for number, line in enumerate(lines):
        level = y + (number + 0.8) * step
        if plain:
            indent = len(line) - len(line.lstrip())
            pen.text((left + indent * advance, level), line.lstrip(), fill=0, font=font, anchor="ls")
            continue
        for place, character in enumerate(line):
            pen.text((left + (place + 0.5) * cell, level), character, fill=0, font=font, anchor="ms")
    return replace(page, image=np.asarray(image))


def _paper() -> tuple[ZoneSetter, float, float]:
    """An empty A4 page, its left margin and its measure."""
    return ZoneSetter(*A4_PX), 150.0, A4_PX[0] - 300.0


def _image(page: LabelledPage) -> GrayImage:
    if page.image is None:
        raise ValueError("the page was not drawn")
    return page.image


def _pen(page: LabelledPage) -> tuple[ImageDraw.ImageDraw, Image.Image]:
    image = Image.fromarray(_image(page))
    return ImageDraw.Draw(image), image


def _font(size_px: int) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    return ImageFont.load_default(size_px)


_PAGES: dict[Difficulty, Callable[[np.random.Generator, bool], LabelledPage]] = {
    "figure-words": _figure_words,
    "table": _table,
    "letterhead-columns": _letterhead_columns,
    "handwriting": _handwriting,
    "seal": _seal,
    "margin-notes": _margin_notes,
    "line-numbers": _line_numbers,
    "page-number": _page_number,
    "dark-border": _dark_border,
    "bleed-through": _bleed_through,
    "form": _form,
    "footnotes": _footnotes,
    "two-columns": _two_columns,
    "three-columns": _three_columns,
    "listing": _listing,
}

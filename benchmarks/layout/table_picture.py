"""A picture of an invoice and of the table that is read from it, for the README."""

from collections.abc import Sequence

import cv2
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from benchmarks.common.memory import Memory
from benchmarks.layout.form_documents import Form, make_form, model_of, recognized
from services.arrays import RgbImage
from services.layout.tables.item_table import ItemTable
from simulation.invoice_pages import firm_of

_FIRM, _SEED, _ITEMS = "Tischlerei Ahrens GmbH", 7, 9
_COLOURS = ((220, 60, 40), (40, 130, 60), (50, 90, 210), (170, 90, 190))
_HEIGHT = 900
"""Of the part of the page that is shown, from its top, in pixels."""
_STEP = 42
_WIDTHS = (430, 110, 130, 150)


def invoice_and_table() -> RgbImage:
    """An invoice with the cells of its columns in four colours, and the values of these cells beside it."""
    firm, memory = firm_of(_FIRM), Memory(None)
    samples = [make_form(firm, seed, "words", None, memory) for seed in range(3)]
    form = make_form(firm, _SEED, "words", None, memory, items=_ITEMS)
    [table] = recognized(form, [model_of(samples)])[0].recognition.tables
    return np.hstack([_page(form, table), _values(table)])


def _page(form: Form, table: ItemTable) -> RgbImage:
    image = form.pages[0].truth.image
    assert image is not None, "it is drawn"
    shown = np.repeat(image[:_HEIGHT, :, None], 3, axis=2)
    for row in table.rows:
        for colour, cell in zip(_COLOURS, row, strict=True):
            if cell is not None:
                x0, y0, x1, y1 = (round(value) for value in cell.box)
                cv2.rectangle(shown, (x0 - 4, y0 - 4), (x1 + 4, y1 + 4), colour, 2)
    return np.asarray(shown, np.uint8)


def _values(table: ItemTable) -> RgbImage:
    canvas = Image.new("RGB", (sum(_WIDTHS) + 40, _HEIGHT), (250, 250, 250))
    pen, y = ImageDraw.Draw(canvas), 200
    _write(pen, y, table.columns, bold=True)
    for row in table.rows:
        y += _STEP
        _write(pen, y, [("" if cell is None else cell.value or cell.text) for cell in row], bold=False)
    return np.asarray(canvas, np.uint8)


def _write(pen: ImageDraw.ImageDraw, y: int, texts: Sequence[str], *, bold: bool) -> None:
    x, font = 20, ImageFont.truetype("DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf", 17)
    for text, width, colour in zip(texts, _WIDTHS, _COLOURS, strict=True):
        pen.text((x, y), text, fill=colour if bold else (20, 20, 20), font=font)
        x += width

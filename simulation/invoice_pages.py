"""Invoices of invented firms with the truth of their values and items: pages of a form, drawn by a seed.

Words are set one by one, so that the truth has the box of each: values and cells are unions of them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from decimal import ROUND_HALF_UP, Decimal
from functools import lru_cache
from typing import Literal

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from simulation.flat_page import PageWord
from simulation.invoice_firms import CUSTOMERS, DETAILS, FEET, FIRMS, GOODS, MONTHS, UNITS, Firm, Kind
from simulation.language_pages import find_typeface

VALUES = ("number", "date", "customer", "total")
ITEMS: tuple[Kind, ...] = ("description", "quantity", "price", "amount")
"""Columns that every firm has."""
MOST_ITEMS = 40
_WIDTH, _HEIGHT = 1240, 1754
"""A4 at 150 dpi."""
_LEFT, _RIGHT = 110.0, 1130.0
_FOOT = 1640.0
_PAD = 10.0
"""Between a column's edge and its text."""
_LEADING = 1.3

Box = tuple[float, float, float, float]
Align = Literal["left", "right", "centre"]


@dataclass(frozen=True, slots=True)
class FormText:
    """A value or a cell: its text with a line for each printed one, its box in pixels, and what it means.

    `value` is a date as YYYY-MM-DD, a number with a point before its decimals, and of a text its only line.
    """

    text: str
    box: Box
    value: str


@dataclass(frozen=True, slots=True, eq=False)
class InvoicePage:
    """One page of an invoice: `image` (H, W) uint8 or None, its `words`, values by label, items by kind of cell."""

    image: np.ndarray | None
    width: int
    height: int
    words: tuple[PageWord, ...]
    values: Mapping[str, FormText]
    rows: tuple[Mapping[Kind, FormText], ...]


def invoice(
    firm: Firm, rng: np.random.Generator, *, items: int | None = None, scale: float = 1.0, draw: bool = True
) -> list[InvoicePage]:
    """The pages, one or two, of an invoice of so many items (None: 1 to `MOST_ITEMS`, few are more frequent)."""
    number = int(np.clip(round(rng.exponential(9.0)) + 1, 1, MOST_ITEMS)) if items is None else items
    return _Invoice(firm, rng, scale, draw).pages(number)


def firm_of(name: str) -> Firm:
    """The firm of this name. Raises KeyError."""
    return {firm.name: firm for firm in FIRMS}[name]


class _Sheet:
    """One page that words are set on; lengths are pixels of 150 dpi."""

    def __init__(self, firm: Firm, scale: float, draw: bool) -> None:
        self.firm, self.scale = firm, scale
        self.words: list[PageWord] = []
        size = (round(_WIDTH * scale), round(_HEIGHT * scale))
        self.size = size
        self.canvas = Image.new("L", size, 255) if draw else None
        self.pen = None if self.canvas is None else ImageDraw.Draw(self.canvas)

    def text(
        self, text: str, x: float, y: float, align: Align = "left", *, size: float | None = None
    ) -> list[PageWord]:
        """The words of one line at `x` (its left, middle or right); `y` is the top of the line."""
        em = round((size or self.firm.size) * self.scale)
        font = _typeface(self.firm.serif, em)
        words = text.split()
        widths = [font.getlength(word) for word in words]
        space = 0.3 * em
        length = sum(widths) + space * (len(words) - 1)
        at = x * self.scale - {"left": 0.0, "centre": length / 2, "right": length}[align]
        base = round(y * self.scale + 0.8 * em)
        set_words = []
        for word, width in zip(words, widths, strict=True):
            place = (round(at), base)
            if self.pen is not None:
                self.pen.text(place, word, fill=0, font=font, anchor="ls")
            x0, y0, x1, y1 = font.getbbox(word, anchor="ls")
            box = (place[0] + x0, base + y0, place[0] + x1, base + y1)
            set_words.append(PageWord(word, tuple(map(float, box))))  # type: ignore[arg-type]
            at += width + space
        self.words += set_words
        return set_words

    def rule(self, x0: float, y0: float, x1: float, y1: float) -> None:
        if self.pen is not None:
            ends = tuple(round(value * self.scale) for value in (x0, y0, x1, y1))
            self.pen.line(ends, fill=90, width=max(1, round(1.5 * self.scale)))

    def length(self, text: str) -> float:
        """Of a line, in pixels of 150 dpi."""
        em = round(self.firm.size * self.scale)
        font = _typeface(self.firm.serif, em)
        words = text.split()
        return (sum(map(font.getlength, words)) + 0.3 * em * (len(words) - 1)) / self.scale


class _Invoice:
    def __init__(self, firm: Firm, rng: np.random.Generator, scale: float, draw: bool) -> None:
        self.firm, self.rng, self.scale, self.draw = firm, rng, scale, draw
        self.line = firm.size * _LEADING
        # Print is not put in quite the same place on every page: a printer, a scanner.
        self.shift = float(rng.uniform(-6.0, 6.0))
        self.edges = [_LEFT]
        for column in firm.columns:
            self.edges.append(self.edges[-1] + column.share * (_RIGHT - _LEFT))

    def pages(self, number: int) -> list[InvoicePage]:
        values: dict[str, FormText] = {}
        sheet = _Sheet(self.firm, self.scale, self.draw)
        y = self._head(sheet, values)
        y = self._header(sheet, y)
        pages: list[InvoicePage] = []
        rows: list[Mapping[Kind, FormText]] = []
        total = Decimal(0)
        top = y - self.line
        for position in range(1, number + 1):
            lines = 2 if self.rng.random() < self.firm.wrapped else 1
            room = _FOOT - (7 * self.line if position == number else 2.2 * self.line)
            if y + lines * self.line > room and rows:
                if self.firm.carried:
                    self._sum(sheet, self.firm.carried, total, y + 0.3 * self.line)
                self._end_table(sheet, top, y)
                pages.append(self._page(sheet, values, rows))
                sheet, values, rows = _Sheet(self.firm, self.scale, self.draw), {}, []
                y = 110.0 + self.shift
                sheet.text(f"{self.firm.name}   {self.firm.title}   2", _LEFT, y)
                y += 3 * self.line
                top = y
                if self.firm.header_again:
                    y = self._header(sheet, y)
            cells, amount, y = self._item(sheet, position, lines, y)
            rows.append(cells)
            total += amount
        self._end_table(sheet, top, y)
        y += 0.9 * self.line
        tax = _cents(total * self.firm.tax_percent / 100)
        for key, amount in ((2, total), (3, tax)):
            self._sum(sheet, self.firm.keys[key], amount, y)
            y += 1.25 * self.line
        values["total"] = self._sum(sheet, self.firm.keys[4], total + tax, y)
        sheet.text(FEET[self.firm.language], _LEFT, 1680.0, size=15.0)
        return [*pages, self._page(sheet, values, rows)]

    def _head(self, sheet: _Sheet, values: dict[str, FormText]) -> float:
        firm, rng, line = self.firm, self.rng, self.line
        y = 90.0 + self.shift
        x, align = ((_LEFT + _RIGHT) / 2, "centre") if firm.centred else (_LEFT, "left")
        sheet.text(firm.name, x, y, align, size=1.5 * firm.size)  # type: ignore[arg-type]
        sheet.text(firm.address, x, y + 2.1 * line, align, size=0.8 * firm.size)  # type: ignore[arg-type]
        y += 5 * line
        customer = CUSTOMERS[firm.language][int(rng.integers(len(CUSTOMERS[firm.language])))]
        at = 700.0 if firm.customer_right else _LEFT
        lines = [sheet.text(text, at, y + k * line) for k, text in enumerate(customer)]
        values["customer"] = _form_text(lines, " ".join(customer))
        year, month, day = 2020 + int(rng.integers(7)), int(rng.integers(12)), int(rng.integers(1, 29))
        name = MONTHS[firm.language][month]
        date = firm.day.format(
            day=f"{day:02d}" if "{month}" in firm.day else day,
            month=f"{month + 1:02d}",
            name=name,
            short=name[:3],
            year=year,
        )
        number = firm.number.format(n=int(rng.integers(1000, 99999)), year=year)
        meant = {"number": number, "date": f"{year}-{month + 1:02d}-{day:02d}"}
        meta_x = _LEFT if firm.customer_right else 720.0
        if firm.meta == "boxes":
            y += 5 * line
            for k, (label, text) in enumerate((("number", number), ("date", date))):
                sheet.text(firm.keys[k], _LEFT + 330 * k, y, size=0.8 * firm.size)
                values[label] = _form_text([sheet.text(text, _LEFT + 330 * k, y + 1.2 * line)], meant[label])
            y += 3.5 * line
        else:
            for k, (label, text) in enumerate((("number", number), ("date", date))):
                own = y + k * 1.2 * line
                key = sheet.text(firm.keys[k], meta_x, own)
                if firm.meta == "lines":
                    after = key[-1].box[2] / self.scale + 0.35 * firm.size
                    words = sheet.text(text, after, own)
                else:
                    words = sheet.text(text, _RIGHT, own, "right")
                values[label] = _form_text([words], meant[label])
            y += 5 * line
        sheet.text(firm.title, _LEFT, y, size=1.4 * firm.size)
        return y + 3 * line

    def _header(self, sheet: _Sheet, y: float) -> float:
        for column, (x0, x1) in zip(self.firm.columns, self._zones(), strict=True):
            self._cell(sheet, column.header, x0, x1, column.align, y)
        if self.firm.rules != "none":
            sheet.rule(_LEFT, y + 1.15 * self.line, _RIGHT, y + 1.15 * self.line)
        if self.firm.rules == "grid":
            sheet.rule(_LEFT, y - 0.25 * self.line, _RIGHT, y - 0.25 * self.line)
        return y + 1.5 * self.line

    def _zones(self) -> list[tuple[float, float]]:
        return list(zip(self.edges[:-1], self.edges[1:], strict=True))

    def _cell(self, sheet: _Sheet, text: str, x0: float, x1: float, align: Align, y: float) -> list[PageWord]:
        x = {"left": x0 + _PAD, "right": x1 - _PAD, "centre": (x0 + x1) / 2}[align]
        return sheet.text(text, x, y, align)

    def _item(
        self, sheet: _Sheet, position: int, lines: int, y: float
    ) -> tuple[dict[Kind, FormText], Decimal, float]:
        firm, rng = self.firm, self.rng
        decimals = any(
            word in firm.columns[k].header for k in range(len(firm.columns)) for word in ("Hours", "Horas")
        )
        quantity = Decimal(int(rng.integers(1, 25)))
        if decimals:
            quantity = Decimal(int(rng.integers(1, 40))) / 4
        price = Decimal(int(rng.integers(150, 30000 if rng.random() < 0.8 else 300000))) / 100
        discount = Decimal(int(rng.choice([0, 0, 5, 10])))
        has_discount = any(column.kind == "discount" for column in firm.columns)
        amount = _cents(quantity * price * (100 - discount if has_discount else 100) / 100)
        goods, details = GOODS[firm.language], DETAILS[firm.language]
        first = goods[int(rng.integers(len(goods)))]
        second = details[int(rng.integers(len(details)))]
        described = [first, second] if lines == 2 else [first]
        sign = self._signed if firm.sign_in_cells else (lambda text: text)
        shown: dict[Kind, tuple[str, str]] = {
            "position": (str(position), str(position)),
            "article": (number := f"{int(rng.integers(100, 999))}-{int(rng.integers(10, 99))}", number),
            "quantity": (self._number(quantity, 2 if decimals else 0), f"{quantity:f}"),
            "unit": (unit := UNITS[firm.language][int(rng.integers(3))], unit),
            "price": (sign(self._number(price)), f"{price:.2f}"),
            "discount": (f"{discount} %", f"{discount}"),
            "tax": (f"{firm.tax_percent} %", f"{firm.tax_percent}"),
            "amount": (sign(self._number(amount)), f"{amount:.2f}"),
        }
        cells: dict[Kind, FormText] = {}
        with_amount = y + (lines - 1) * self.line if firm.below else y
        for column, (x0, x1) in zip(firm.columns, self._zones(), strict=True):
            if column.kind == "description":
                set_lines = [
                    self._cell(sheet, text, x0, x1, column.align, y + k * self.line)
                    for k, text in enumerate(described)
                ]
                cells["description"] = _form_text(set_lines, " ".join(described))
            else:
                text, value = shown[column.kind]
                words = self._cell(sheet, text, x0, x1, column.align, with_amount)
                cells[column.kind] = _form_text([words], value)
        below = y + lines * self.line
        if firm.rules in ("rows", "grid"):
            sheet.rule(_LEFT, below + 0.08 * self.line, _RIGHT, below + 0.08 * self.line)
        return cells, amount, below + (0.35 if firm.rules in ("rows", "grid") else 0.25) * self.line

    def _end_table(self, sheet: _Sheet, top: float, bottom: float) -> None:
        if self.firm.rules == "grid":
            for x in self.edges:
                sheet.rule(x, top - 0.75 * self.line, x, bottom - 0.27 * self.line)
        elif self.firm.rules == "header":
            sheet.rule(_LEFT, bottom, _RIGHT, bottom)

    def _sum(self, sheet: _Sheet, key: str, amount: Decimal, y: float) -> FormText:
        if self.firm.keys_at_left:
            sheet.text(key, self.edges[1] + _PAD, y)
        else:
            sheet.text(key, self.edges[-2] - 2 * _PAD, y, "right")
        words = sheet.text(self._signed(self._number(amount)), _RIGHT - _PAD, y, "right")
        return _form_text([words], f"{amount:.2f}")

    def _signed(self, text: str) -> str:
        return f"{self.firm.sign}{text}" if self.firm.language == "en" else f"{text} {self.firm.sign}"

    def _number(self, value: Decimal, decimals: int = 2) -> str:
        text = f"{value:,.{decimals}f}"
        thousands, point = {"en": (",", "."), "de": (".", ","), "fr": (" ", ","), "es": (".", ",")}[
            self.firm.language
        ]
        return text.replace(",", "\0").replace(".", point).replace("\0", thousands)

    def _page(
        self, sheet: _Sheet, values: Mapping[str, FormText], rows: Sequence[Mapping[Kind, FormText]]
    ) -> InvoicePage:
        image = None if sheet.canvas is None else np.asarray(sheet.canvas)
        return InvoicePage(image, *sheet.size, tuple(sheet.words), dict(values), tuple(rows))


def _cents(value: Decimal) -> Decimal:
    return value.quantize(Decimal("0.01"), ROUND_HALF_UP)


def _form_text(lines: Sequence[Sequence[PageWord]], value: str) -> FormText:
    boxes = np.array([word.box for line in lines for word in line])
    box = (*boxes[:, :2].min(axis=0).tolist(), *boxes[:, 2:].max(axis=0).tolist())
    text = "\n".join(" ".join(word.text for word in line) for line in lines)
    return FormText(text, box, value)


@lru_cache(maxsize=32)
def _typeface(serif: bool, em: int) -> ImageFont.FreeTypeFont:
    """DejaVu, or Pillow's own typeface, which has no accents, where the machine lacks it."""
    sans = find_typeface("Latin")
    if sans is None:
        font = ImageFont.load_default(em)
        assert isinstance(font, ImageFont.FreeTypeFont), "Pillow was built without FreeType"
        return font
    file = sans.with_name("DejaVuSerif.ttf" if serif else "DejaVuSans.ttf")
    return ImageFont.truetype(str(file if file.is_file() else sans), em)

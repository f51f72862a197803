"""The words of a page of a PDF, as its fonts name their characters; runs in the process that draws the PDF."""

import ctypes
import math
import unicodedata
from collections.abc import Sequence
from itertools import islice, product
from typing import NamedTuple

import pypdfium2
import pypdfium2.raw as pdfium

MOST_LOOKED_AT = 20_000
"""Objects of a page, and characters: a page of print has some hundred and some thousand."""
FORMS = 4
"""Depth of forms within forms that are looked into."""
NOT_SHOWN = (pdfium.FPDF_TEXTRENDERMODE_INVISIBLE, pdfium.FPDF_TEXTRENDERMODE_CLIP)
_NO_TEXT = 0.02
"""Share of characters that are no text, from which on a font lacks its map to Unicode. A few bullets have none."""
_NO_CHARACTERS = ("Cc", "Cn", "Co")
_HYPHENS = "\x02\xad\ufffe"
"""A hyphen at the end of a line, which the renderer does not end behind it."""
_PRESENTATION = ("\ufb00", "\ufeff")
"""The first and the last of ligatures and forms of letters that stand for plain ones."""
_SAME_PLACE = 0.15
"""Ems between the two drawings of a character that is made bold so. Two letters of a word are 0.2 apart and more."""
_ASLANT = 0.1
"""Quarter turns: the box of a word that is more aslant, as a stamp across the page, reaches over lines."""
_FRACTIONS = 1 << 24
"""Pixels of a page's width and height where places are asked for: the renderer answers in whole pixels."""
_NO_PRINT = (pdfium.FPDF_ANNOT_LINK, pdfium.FPDF_ANNOT_POPUP)
"""Annotations that show no print."""

Box = tuple[float, float, float, float]
WordJson = tuple[str, Box, int]
"""A word, its box (x0, y0, x1, y1) in fractions of the width and height of the page as it is drawn, and its line."""


class _Character(NamedTuple):
    """A character that is shown, empty where it is no text, and its box (left, bottom, right, top) on the page."""

    text: str
    box: Box


class _Word(NamedTuple):
    characters: list[_Character]
    line: int


def words_of(page: pypdfium2.PdfPage, text: pypdfium2.PdfTextPage) -> list[WordJson]:
    """The words of a page that are shown, in its own order; none where its fonts do not say what its characters are."""
    if text.count_chars() > MOST_LOOKED_AT:
        return []
    words = _words(text)
    characters = [each.text for word in words for each in word.characters]
    if characters.count("") > _NO_TEXT * len(characters):
        return []
    placed = ((_text(word.characters), _place(page, word.characters), word.line) for word in words)
    return [(shown, box, line) for shown, box, line in placed if shown and box is not None]


def has_other_print(page: pypdfium2.PdfPage) -> bool:
    """Whether a page without images may show print that is no text: annotations, or letters as filled outlines."""
    for k in range(pdfium.FPDFPage_GetAnnotCount(page.raw)):
        annotation = pdfium.FPDFPage_GetAnnot(page.raw, k)
        kind = pdfium.FPDFAnnot_GetSubtype(annotation)
        pdfium.FPDFPage_CloseAnnot(annotation)
        if kind not in _NO_PRINT:
            return True
    return any(
        _is_bent(path.raw)
        for path in islice(
            page.get_objects(filter=[pdfium.FPDF_PAGEOBJ_PATH], max_depth=FORMS), MOST_LOOKED_AT
        )
    )


def _is_bent(path: pdfium.FPDF_PAGEOBJECT) -> bool:
    """Whether a path is filled and has curves."""
    fill, stroke = ctypes.c_int(), ctypes.c_int()
    pdfium.FPDFPath_GetDrawMode(path, fill, stroke)
    return fill.value != pdfium.FPDF_FILLMODE_NONE and any(
        pdfium.FPDFPathSegment_GetType(pdfium.FPDFPath_GetPathSegment(path, k))
        == pdfium.FPDF_SEGMENT_BEZIERTO
        for k in range(min(pdfium.FPDFPath_CountSegments(path), MOST_LOOKED_AT))
    )


def _words(text: pypdfium2.PdfTextPage) -> list[_Word]:
    """Words of the characters that are shown; those whose `text` is empty are no text."""
    words: list[_Word] = []
    line, goes_on = 0, False
    reader = _Reader(text)
    for k in range(text.count_chars()):
        code = pdfium.FPDFText_GetUnicode(text.raw, k)
        character = chr(code)
        if character.isspace():
            line += character in "\r\n"
            goes_on = False
            continue
        read = reader.read(k, character)
        if read is None:
            continue
        if goes_on:
            words[-1].characters.append(read)
        else:
            words.append(_Word([read], line))
        goes_on = True
        if character in _HYPHENS:
            line, goes_on = line + 1, False
    return words


class _Reader:
    """Reads the characters of a page that are shown, each drawing of a character once."""

    def __init__(self, text: pypdfium2.PdfTextPage) -> None:
        self._text = text.raw
        self._sides = [ctypes.c_double() for _ in range(4)]
        self._rectangle = pdfium.FS_RECTF()
        self._is_shown: dict[int, bool] = {}
        self._seen: dict[tuple[str, float, int, int], list[tuple[float, float, int]]] = {}

    def read(self, k: int, character: str) -> _Character | None:
        """The character with index `k`; None where it is not shown, or was drawn before."""
        shown_by = pdfium.FPDFText_GetTextObject(self._text, k)
        address = ctypes.cast(shown_by, ctypes.c_void_p).value
        if address is None:
            return None
        if address not in self._is_shown:
            self._is_shown[address] = pdfium.FPDFTextObj_GetTextRenderMode(shown_by) not in NOT_SHOWN
        quarters = pdfium.FPDFText_GetCharAngle(self._text, k) / (math.pi / 2)
        if not self._is_shown[address] or abs(quarters - round(quarters)) > _ASLANT:
            return None
        box, em = self._box(k, axis=round(quarters) % 2)
        if not (box[2] > box[0] and box[3] > box[1] and em > 0) or self._is_double(
            character, box, em, address
        ):
            return None
        return _Character(self._as_text(k, character), box)

    def _box(self, k: int, axis: int) -> tuple[Box, float]:
        """The box of the ink of a character, else that of its place; and its em, across the `axis` of its line."""
        left, right, bottom, top = self._sides
        pdfium.FPDFText_GetLooseCharBox(self._text, k, self._rectangle)
        place = self._rectangle
        box = (place.left, place.bottom, place.right, place.top)
        em = box[3 - axis] - box[1 - axis]
        pdfium.FPDFText_GetCharBox(self._text, k, left, right, bottom, top)
        if right.value > left.value and top.value > bottom.value:
            box = (left.value, bottom.value, right.value, top.value)
        return box, em

    def _as_text(self, k: int, character: str) -> str:
        if character in _HYPHENS:
            return "-"
        if (
            character == "\ufffd"
            or unicodedata.category(character) in _NO_CHARACTERS
            or pdfium.FPDFText_HasUnicodeMapError(self._text, k) == 1
        ):
            return ""
        if _PRESENTATION[0] <= character <= _PRESENTATION[1]:
            return unicodedata.normalize("NFKC", character)
        return character

    def _is_double(self, character: str, box: Box, em: float, address: int) -> bool:
        """Whether another object shows the character there too."""
        near = _SAME_PLACE * em
        x, y, size = box[0], box[1], 2.0 ** math.ceil(math.log2(near))
        column, row = int(x // size), int(y // size)
        for across, down in product((-1, 0, 1), repeat=2):
            for other_x, other_y, other in self._seen.get((character, size, column + across, row + down), ()):
                if other != address and abs(other_x - x) <= near and abs(other_y - y) <= near:
                    return True
        self._seen.setdefault((character, size, column, row), []).append((x, y, address))
        return False


def _text(characters: Sequence[_Character]) -> str:
    shown = "".join(each.text for each in characters)
    # Characters outside of the first plane may come as two.
    return shown.encode("utf-16-le", "surrogatepass").decode("utf-16-le", "ignore")


def _place(page: pypdfium2.PdfPage, characters: Sequence[_Character]) -> Box | None:
    """The box round characters in fractions of the page as it is drawn; None where its middle lies outside."""
    left, bottom, right, top = zip(*(each.box for each in characters), strict=True)
    x, y = ctypes.c_int(), ctypes.c_int()
    corners = []
    for corner in ((min(left), min(bottom)), (max(right), max(top))):
        pdfium.FPDF_PageToDevice(page.raw, 0, 0, _FRACTIONS, _FRACTIONS, 0, *corner, x, y)
        corners.append((x.value / _FRACTIONS, y.value / _FRACTIONS))
    (x0, x1), (y0, y1) = (sorted(side) for side in zip(*corners, strict=True))
    if not (0 <= x0 + x1 <= 2 and 0 <= y0 + y1 <= 2 and x1 > x0 and y1 > y0):
        return None
    return max(0.0, x0), max(0.0, y0), min(1.0, x1), min(1.0, y1)

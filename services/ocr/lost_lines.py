"""Lines of print that the engine's page layout lost, read one by one.

Tesseract's layout analysis builds rows from the sizes of letters. Where dots, tails and joined letters make these sizes
uneven (Arabic), it takes two lines for one row, or drops lines, and small changes of the picture decide which. The
lines that `text_lines` finds by the density of ink are whole there, so that every line which the words of the page do
not cover is read again as a line, without any layout analysis.
"""

import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from services.arrays import GrayImage
from services.deadline import time_left_s
from services.ocr.engine import LineReader, OcrEngine, Word, mean_confidence
from services.ocr.text_lines import TextLine, crop_place, cut_line, detect_text_lines

_LEAST_COVER = 0.6
"""Lines are read again when words that were surely read cover less of their width. On photos, lines that were
covered by 0.6 to 0.8 took 55 % of the time of second readings for 3 % of the gain: spaces may be wide."""
_SURE = 0.7
"""Least confidence of a word that was surely read."""
_FUSED_SHARE = 0.35
"""A word that has so much of the height of two lines is of a row that the engine made of both. Tails and ascenders
reach into the next line less far."""
_LEAST_CONFIDENCE = 0.6
"""Least mean confidence of a second reading: pictures and specks are read as unsure letters."""
_SHORT_LINE = 12.0
"""Width over height up to which an unsure line is read in another mode too; longer ones that are right are sure."""
_GAIN = 1.05
"""A second reading must have so many times the sure letters of the first one."""
_MOST_AGAIN = 0.3
"""Lines of which something was surely read are read again up to so much of the length of all lines, each in its
height: reading then takes about as many times longer. Lines of which nothing was read cost no time before."""
MOST_VAIN = 16
"""After so many second readings that were not better, the longest lines first, ..."""
_VAIN_FOR_EACH = 3
"""... and so many more for each better one, no more lines are read: a page of handwriting has 200."""
_CROP_HEIGHT_PX = 64
"""Of a line that is read again: on 12 Arabic pages its error is 3.1 %, at 48 px 3.3 and at 36 px 4.3."""


def with_lost_lines(
    gray: GrayImage, words: Sequence[Word], engine: OcrEngine, ends_s: float = float("inf")
) -> list[Word]:
    """`words` of the page `gray` (H, W), those of badly read lines replaced by words of a second reading.

    A line is read again as a whole, with all that the engine read as parts of it, so that no word is there twice. The
    new words take the number of the first of these parts. An engine that cannot read single lines as words leaves them
    as they are. None is read after `ends_s` (of `time.process_time`), or after the deadline.
    """

    found = detect_text_lines(gray).rows
    if not isinstance(engine, LineReader) or not found.lines or found.inverted:
        return list(words)
    table = _WordTable(words, found.lines)
    added: list[Word] = []
    dropped = np.zeros(len(words), dtype=bool)
    free = 1 + max((word.line for word in words if word.line is not None), default=-1)
    vain = better = 0
    # Time of reading grows with the length of lines in their heights.
    left = _MOST_AGAIN * sum(line.width_px / line.height_px for line in found.lines)
    for index in np.argsort([-line.width_px for line in found.lines], kind="stable").tolist():
        line, own = found.lines[index], table.own(index) & ~dropped
        sure = [words[k].box for k in np.flatnonzero(own & table.sure).tolist()]
        if _covered(sure, line) >= _LEAST_COVER:
            continue
        is_over = time.process_time() >= ends_s or time_left_s() <= 0.0
        if is_over or vain >= MOST_VAIN + _VAIN_FOR_EACH * better:
            break
        if sure and left <= 0.0:
            continue
        own = (own | table.parts(index, own)) & ~dropped
        mine = [words[k] for k in np.flatnonzero(own).tolist()]
        second = _read_line(gray, _extended(line, mine), engine)
        left -= line.width_px / line.height_px if sure else 0.0
        if mean_confidence(second) < _LEAST_CONFIDENCE or _sure_letters(second) < _GAIN * _sure_letters(mine):
            vain += 1
            continue
        better += 1
        dropped |= own | table.fused_with(index)
        number = min((word.line for word in mine if word.line is not None), default=free)
        free += number == free
        added += [replace(word, line=number) for word in second]
    kept = [word for word, out in zip(words, dropped, strict=True) if not out]
    return sorted(kept + added, key=lambda word: -1 if word.line is None else word.line)


class _WordTable:
    """Which words (N,) of the page lie in which detected lines (M,), by the lines' own slopes."""

    def __init__(self, words: Sequence[Word], lines: Sequence[TextLine]) -> None:
        boxes = np.array([word.box for word in words]).reshape(-1, 4)
        rows = np.array([line.box for line in lines])
        middle = (boxes[:, 0] + boxes[:, 2])[:, None] / 2
        self._shares = _height_shares(boxes, rows, np.array([line.slope for line in lines]))
        within = np.where((middle < rows[:, 0]) | (middle > rows[:, 2]), 0.0, self._shares)
        self._fused = (within >= _FUSED_SHARE) & ((within >= _FUSED_SHARE).sum(axis=1) > 1)[:, None]
        self._line_of = np.where(within.max(axis=1, initial=0.0) > 0.5, within.argmax(axis=1), -1)
        self._numbers = np.array([-1 if word.line is None else word.line for word in words], dtype=int)
        self._letters = np.array([len(word.text) for word in words], dtype=float)
        self._settle_fused()
        self.sure = np.array([word.confidence >= _SURE for word in words], dtype=bool)

    def _settle_fused(self) -> None:
        """A high word is of the line that the other words of its engine's line are of, and not fused."""
        fused = self._fused.any(axis=1)
        for word in np.flatnonzero(fused & (self._numbers >= 0)).tolist():
            others = self._line_of[(self._numbers == self._numbers[word]) & ~fused]
            others = others[others >= 0]
            if len(others) and self._fused[word, line := int(np.bincount(others).argmax())]:
                self._line_of[word] = line
                self._fused[word] = False

    def own(self, index: int) -> NDArray[np.bool_]:
        """Words in the line, and in no other one too."""
        return np.asarray((self._line_of == index) & ~self._fused.any(axis=1))

    def fused_with(self, index: int) -> NDArray[np.bool_]:
        """Words that the engine made of this line and another one."""
        return np.asarray(self._fused[:, index])

    def parts(self, index: int, own: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Words of the engine's lines that have words of `own` and go on level with the line."""
        level = self._shares[:, index] > 0.5
        found = np.zeros(len(own), dtype=bool)
        for number in np.unique(self._numbers[own & (self._numbers >= 0)]).tolist():
            line = self._numbers == number
            if self._letters[line & level].sum() > 0.8 * self._letters[line].sum():
                found |= line
        return found


def _extended(line: TextLine, words: Sequence[Word]) -> TextLine:
    """The line, as far as its words go to both sides."""
    x0 = min([line.box[0], *(word.box[0] for word in words)])
    x1 = max([line.box[2], *(word.box[2] for word in words)])
    shift = line.slope * ((x0 + x1) - (line.box[0] + line.box[2])) / 2
    return replace(line, box=(x0, line.box[1] + shift, x1, line.box[3] + shift))


def _height_shares(
    words: NDArray[np.float64], lines: NDArray[np.float64], slopes: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Share (words, lines) of the lower one's height that words have in common with the lines, went these on."""
    along = (words[:, 0] + words[:, 2])[:, None] / 2 - (lines[:, 0] + lines[:, 2]) / 2
    tops, feet = lines[:, 1] + slopes * along, lines[:, 3] + slopes * along
    common = np.minimum(words[:, 3, None], feet) - np.maximum(words[:, 1, None], tops)
    lower = np.minimum((words[:, 3] - words[:, 1])[:, None], lines[:, 3] - lines[:, 1])
    return np.asarray(np.maximum(common, 0.0) / np.maximum(lower, 1.0))


def _covered(boxes: Sequence[tuple[float, float, float, float]], line: TextLine) -> float:
    """Share of the line's width that the boxes cover."""
    width, end = 0.0, line.box[0]
    for x0, _, x1, _ in sorted(boxes):
        width += max(0.0, min(x1, line.box[2]) - max(x0, end))
        end = max(end, x1)
    return width / max(line.width_px, 1.0)


def _read_line(gray: GrayImage, line: TextLine, engine: LineReader) -> list[Word]:
    """Words of one line, boxes on the page; each has the rows of its line."""
    crop = cut_line(
        gray, line, inverted=False, height_px=_CROP_HEIGHT_PX, longest=float("inf"), stretched=False
    )
    start_px, zoom = crop_place(line, _CROP_HEIGHT_PX)
    middle = (line.box[0] + line.box[2]) / 2
    words = engine.read_line_words(crop)
    confidences = [word.confidence for word in words]
    is_short = line.width_px <= _SHORT_LINE * line.height_px
    if is_short and mean_confidence(words) < _LEAST_CONFIDENCE:
        # A heading is often read right and unsurely; a reading in another mode then says the same, and surely.
        text, sure = engine.read_line(crop)
        if text.split() == [word.text for word in words]:
            confidences = [max(confidence, sure) for confidence in confidences]
    read = []
    for word, confidence in zip(words, confidences, strict=True):
        x0, x1 = (start_px + edge / zoom for edge in (word.box[0], word.box[2]))
        shift = line.slope * ((x0 + x1) / 2 - middle)
        read.append(Word(word.text, (x0, line.box[1] + shift, x1, line.box[3] + shift), confidence))
    return read


def _sure_letters(words: Sequence[Word]) -> float:
    """Letters, each with the confidence of its word."""
    return sum(len(word.text) * word.confidence for word in words)

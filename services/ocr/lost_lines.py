"""Lines of print that the engine's page layout lost, read one by one.

Tesseract's layout analysis builds rows from the sizes of letters. Where dots, tails and joined letters make these sizes
uneven (Arabic), it takes two lines for one row, or drops lines, and small changes of the picture decide which. The
lines that `text_lines` finds by the density of ink are whole there, so that every line which the words of the page do
not cover is read again as a line, without any layout analysis.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from services.arrays import GrayImage
from services.ocr.engine import LineReader, OcrEngine, Word, mean_confidence
from services.ocr.text_lines import TextLine, crop_place, cut_line, detect_text_lines


@dataclass(frozen=True, slots=True)
class LostLineParameters:
    """When a line counts as lost, and when its second reading is better."""

    least_cover: float = 0.8
    """Lines are read again when words that were surely read cover less of their width."""
    sure: float = 0.7
    """Least confidence of a word that was surely read."""
    fused_share: float = 0.35
    """A word that has so much of the height of two lines is of a row that the engine made of both. Tails and ascenders
    reach into the next line less far."""
    least_confidence: float = 0.6
    """Least mean confidence of a second reading: pictures and specks are read as unsure letters."""
    short_line: float = 12.0
    """Width over height up to which an unsure line is read in another mode too; longer ones that are right are sure."""
    gain: float = 1.05
    """A second reading must have so many times the sure letters of the first one."""
    most_vain: int = 16
    """After so many second readings that were not better, the longest lines first, ..."""
    vain_for_each: int = 3
    """... and so many more for each better one, no more lines are read: a page of handwriting has 200."""
    crop_height_px: int = 64
    """Of a line that is read again: on 12 Arabic pages its error is 3.1 %, at 48 px 3.3 and at 36 px 4.3."""


def with_lost_lines(gray: GrayImage, words: Sequence[Word], engine: OcrEngine) -> list[Word]:
    """`words` of the page `gray` (H, W), those of badly read lines replaced by words of a second reading.

    An engine that cannot read single lines as words leaves them as they are.
    """
    p = LostLineParameters()
    found = detect_text_lines(gray).rows
    if not isinstance(engine, LineReader) or not found.lines or found.inverted:
        return list(words)
    boxes = np.array([line.box for line in found.lines])
    shares = _height_shares(np.array([word.box for word in words]).reshape(-1, 4), boxes)
    fused = (shares >= p.fused_share).sum(axis=1) > 1
    line_of = np.where(shares.max(axis=1, initial=0.0) > 0.5, shares.argmax(axis=1), -1)
    sure = np.array([word.confidence >= p.sure for word in words], dtype=bool)
    added: dict[int, list[Word]] = {}
    dropped = np.zeros(len(words), dtype=bool)
    vain = 0
    for index in np.argsort([-line.width_px for line in found.lines], kind="stable").tolist():
        line, own = found.lines[index], (line_of == index) & ~fused
        if _covered([words[k].box for k in np.flatnonzero(own & sure).tolist()], line) >= p.least_cover:
            continue
        if vain >= p.most_vain + p.vain_for_each * len(added):
            break
        second = _read_line(gray, line, engine, p)
        first = [words[k] for k in np.flatnonzero(own).tolist()]
        letters = _sure_letters(second)
        if mean_confidence(second) >= p.least_confidence and letters >= p.gain * _sure_letters(first):
            added[index] = second
            dropped |= own | (fused & (shares[:, index] >= p.fused_share))
        else:
            vain += 1
    kept = [word for word, out in zip(words, dropped, strict=True) if not out]
    return kept + [word for index in sorted(added) for word in added[index]]


def _height_shares(words: NDArray[np.float64], lines: NDArray[np.float64]) -> NDArray[np.float64]:
    """Share (words, lines) of the lower one's height that words have in common with the lines above or below them."""
    middle = (words[:, 0] + words[:, 2])[:, None] / 2
    beside = (middle < lines[None, :, 0]) | (middle > lines[None, :, 2])
    common = np.minimum(words[:, None, 3], lines[None, :, 3]) - np.maximum(
        words[:, None, 1], lines[None, :, 1]
    )
    lower = np.minimum((words[:, 3] - words[:, 1])[:, None], (lines[:, 3] - lines[:, 1])[None, :])
    return np.where(beside, 0.0, np.maximum(common, 0.0) / np.maximum(lower, 1.0))


def _covered(boxes: Sequence[tuple[float, float, float, float]], line: TextLine) -> float:
    """Share of the line's width that the boxes cover."""
    width, end = 0.0, line.box[0]
    for x0, _, x1, _ in sorted(boxes):
        width += max(0.0, min(x1, line.box[2]) - max(x0, end))
        end = max(end, x1)
    return width / max(line.width_px, 1.0)


def _read_line(gray: GrayImage, line: TextLine, engine: LineReader, p: LostLineParameters) -> list[Word]:
    """Words of one line, boxes on the page; each has the rows of its line."""
    crop = cut_line(
        gray, line, inverted=False, height_px=p.crop_height_px, longest=float("inf"), stretched=False
    )
    start_px, zoom = crop_place(line, p.crop_height_px)
    middle = (line.box[0] + line.box[2]) / 2
    words = engine.read_line_words(crop)
    confidences = [word.confidence for word in words]
    is_short = line.width_px <= p.short_line * line.height_px
    if is_short and mean_confidence(words) < p.least_confidence:
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

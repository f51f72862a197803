"""The segmentation of a page, from its image to zones in reading order."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from services.arrays import GrayImage
from services.layout.page import Box, Page, Zone
from services.layout.read_words import read_words
from services.layout.segmentation.appearance import mark_ink
from services.layout.segmentation.components import Indices
from services.layout.segmentation.entries import find_entries
from services.layout.segmentation.enumerations import item_starts
from services.layout.segmentation.fine_page import FinePage, compose_page, hull
from services.layout.segmentation.frame import LevelledFrame, PrintedPage, analyse_print
from services.layout.segmentation.gathering import gather_scraps
from services.layout.segmentation.ink import InkComponents
from services.layout.segmentation.inner_print import block_boxes, give_to_figures, lie_within
from services.layout.segmentation.line_numbers import split_line_numbers
from services.layout.segmentation.lost_words import believes_words, with_loose_words, with_lost_words
from services.layout.segmentation.non_text import find_parts, without_dirt
from services.layout.segmentation.page_numbers import split_page_numbers
from services.layout.segmentation.stacked_lines import ReadWord, split_stacked
from services.layout.segmentation.text_line_choice import ReadLines, choose_text_lines
from services.layout.segmentation.text_lines import Line, find_lines, measure_line
from services.layout.segmentation.word_lines import lines_of_words
from services.layout.segmentation.words import (
    assign_words,
    between_words,
    is_sign,
    is_word,
    line_confidences,
    words_of_lines,
)
from services.layout.segmentation.zone_grouping import group_lines
from services.ocr.engine import MADE_UP, UNSURE, Word


def segment_page(gray: GrayImage, words: Sequence[Word] | None) -> Page:
    """Zones of a flat, upright page: text at paragraph level, figures, rules and noise, in reading order.

    Lines and zones are found from connected components alone; words show which of them are text, and what it says.

    Parameters
    ----------
    gray : (H, W) uint8, print dark or light on its ground, skewed by at most `ink.LARGEST_SKEW_DEG`.
    words : OCR words of the page, boxes in its pixels; None or empty without an engine.

    Returns
    -------
    Page of W x H px; boxes in its pixels, ids "z1", "z2" ... in reading order. A blank page has no zones.
    """
    return compose_page(segment_finely(gray, words))


def segment_finely(gray: GrayImage, words: Sequence[Word] | None) -> FinePage:
    """The lines of a page with the grouping that `segment_page` makes zones of; other groupings may be tried on it.

    Parameters are those of `segment_page`; a blank page has no lines.
    """

    height, width = gray.shape
    printed = analyse_print(gray)
    if printed is None:
        return FinePage(float(width), float(height), 1.0, (), np.empty((0, 4)), (), (), frozenset(), (), ())
    fine = _grouped(_rows_of_ink(printed, words), printed, gray.shape)
    if believes_words(fine, words):
        fine = _grouped(_rows_of_words(printed, words or ()), printed, gray.shape)
    return with_loose_words(with_lost_words(fine, words, printed.frame), words)


@dataclass(frozen=True, slots=True)
class _Rows:
    """Lines of text with their texts and words; those that begin a zone, and how many of the last are line numbers."""

    lines: list[Line]
    texts: list[str]
    words: list[list[Word]]
    begins: frozenset[int] = frozenset()
    numbers: int = 0
    are_of_words: bool = False


def _rows_of_ink(printed: PrintedPage, words: Sequence[Word] | None) -> _Rows:
    """Lines of the components, those that are text."""
    levelled, size = printed.levelled, printed.frame.size
    lines = find_lines(levelled, np.flatnonzero(printed.kinds.glyphs))
    lines = split_page_numbers(lines, levelled, size[1])
    lines, numbers = split_line_numbers(lines, levelled)
    lines = split_stacked(lines, _sure_words(lines, words, printed.frame), levelled)
    read, own_words = _read([*lines, *numbers], words, printed.frame)
    is_text = choose_text_lines(lines, read.of_first(len(lines)), levelled, size)
    kept = np.flatnonzero(is_text).tolist()
    rows = _Rows([lines[i] for i in kept], [read.texts[i] for i in kept], [own_words[i] for i in kept])
    rows, begins = _join_entries(rows, levelled)
    return _Rows(
        rows.lines + numbers,
        rows.texts + read.texts[len(lines) :],
        rows.words + own_words[len(lines) :],
        frozenset(begins | item_starts(rows.lines, rows.texts)),
        len(numbers),
    )


def _rows_of_words(printed: PrintedPage, words: Sequence[Word]) -> _Rows:
    """Lines of the words, those that have ink."""
    lines = [line for line in lines_of_words(words, printed) if len(line.members)]
    read, own_words = _read(lines, words, printed.frame)
    has = [place for place, own in enumerate(own_words) if own]
    lines = [lines[place] for place in has]
    texts, words_of = [read.texts[place] for place in has], [own_words[place] for place in has]
    return _Rows(lines, texts, words_of, frozenset(item_starts(lines, texts)), are_of_words=True)


def _grouped(rows: _Rows, printed: PrintedPage, shape: tuple[int, ...]) -> FinePage:
    """The page of these lines, and what else is on it."""
    levelled, frame = printed.levelled, printed.frame
    lines, texts = rows.lines, rows.texts
    count = len(lines) - rows.numbers
    blocks = group_lines(lines[:count], set(rows.begins), levelled, frame.size[1])
    if rows.numbers:
        blocks.append(list(range(count, len(lines))))
    line_boxes = _line_boxes(lines)
    unused = ~lie_within(levelled.boxes, block_boxes(blocks, lines))
    for line in lines:
        unused[line.members] = False
    parts = find_parts(levelled, printed.kinds, unused, line_boxes, printed.unit, frame.size)
    is_read = np.array([bool(text) for text in texts], dtype=bool)
    blocks, parts = give_to_figures(blocks, lines, is_read, parts, levelled, frame.size)
    is_sure = np.array([sum(map(str.isalnum, text)) > 1 for text in texts], dtype=bool)
    blocks, parts = gather_scraps(blocks, lines, is_sure, parts, levelled, printed.unit)
    # Pictures are put together of pieces only there.
    blocks, parts = give_to_figures(blocks, lines, is_read, parts, levelled, frame.size)
    parts = without_dirt(parts, levelled, printed.unit)
    others = tuple(
        Zone(
            "",
            _union(printed.components, part.members, frame),
            kind=part.kind,
            words=read_words([rows.words[index] for index in part.lines]),
        )
        for part in parts
    )
    height, width = shape
    return FinePage(
        width=float(width),
        height=float(height),
        scale=frame.mean_scale,
        lines=tuple(lines),
        boxes=_boxes(rows, printed),
        texts=tuple(texts),
        words=tuple(map(tuple, rows.words)),
        begins=rows.begins,
        blocks=tuple(map(tuple, blocks)),
        others=others,
        ink=mark_ink(printed),
    )


def _join_entries(rows: _Rows, levelled: InkComponents) -> tuple[_Rows, set[int]]:
    """Lines with entries of lists joined, and the indices of those, which begin zones."""
    pairs, entries = find_entries(rows.lines, rows.texts)
    value_of = dict(pairs)
    values = set(value_of.values())
    joined = _Rows([], [], [])
    begins: set[int] = set()
    for index, line in enumerate(rows.lines):
        if index in values:
            continue
        text, value, words = rows.texts[index], value_of.get(index), rows.words[index]
        members = line.members
        if value is not None or index in entries:
            begins.add(len(joined.lines))
        if value is not None:
            members = np.concatenate([members, rows.lines[value].members])
            text, words = f"{text} {rows.texts[value]}".strip(), words + rows.words[value]
        joined.lines.append(line if value is None else measure_line(levelled, members))
        joined.texts.append(text)
        joined.words.append(words)
    return joined, begins


def _read(
    lines: Sequence[Line],
    words: Sequence[Word] | None,
    frame: LevelledFrame,
) -> tuple[ReadLines, list[list[Word]]]:
    """Text and confidence of every line, and its words from left to right."""
    seen = [word for word in words or () if is_word(word) or is_sign(word)]
    if not seen or not lines:
        return ReadLines([""] * len(lines), np.zeros(len(lines))), [[] for _ in lines]
    word_boxes = _levelled_boxes(seen, frame)
    says = np.array([is_word(word) for word in seen])
    is_sure = np.array([word.confidence >= MADE_UP for word in seen]) & says
    line_of_word = assign_words(seen, word_boxes, _line_boxes(lines))
    confidence = line_confidences(seen, np.where(is_sure, line_of_word, -1), len(lines))
    # In a line that is text, a word that was read badly is a word all the same.
    is_text = confidence >= UNSURE
    line_of_word = np.where(is_sure | is_text[line_of_word], line_of_word, -1)
    line_of_word = np.where(says | between_words(line_of_word, says, word_boxes), line_of_word, -1)
    own = words_of_lines(seen, word_boxes, line_of_word, len(lines))
    texts = [" ".join(word.text for word in each) for each in own]
    return ReadLines(texts, confidence), own


def _sure_words(
    lines: Sequence[Line], words: Sequence[Word] | None, frame: LevelledFrame
) -> list[list[ReadWord]]:
    """The words of every line that were read for sure."""
    sure = [word for word in words or () if word.confidence >= UNSURE and is_word(word)]
    found: list[list[ReadWord]] = [[] for _ in lines]
    boxes = _levelled_boxes(sure, frame)
    for word, box, line in zip(sure, boxes, assign_words(sure, boxes, _line_boxes(lines)), strict=True):
        if line >= 0:
            x0, y0, x1, y1 = box.tolist()
            found[line].append(ReadWord((x0, y0, x1, y1), sum(map(str.isalnum, word.text))))
    return found


def _levelled_boxes(words: Sequence[Word], frame: LevelledFrame) -> NDArray[np.float64]:
    """Boxes (N, 4) of words on the levelled working copy."""
    boxes = np.array([word.box for word in words], dtype=np.float64).reshape(-1, 4)
    return frame.level(boxes / np.array([*frame.scale, *frame.scale]))


def _line_boxes(lines: Sequence[Line]) -> NDArray[np.float64]:
    return np.array([line.box for line in lines], dtype=np.float64).reshape(-1, 4)


def _boxes(rows: _Rows, printed: PrintedPage) -> NDArray[np.float64]:
    """Boxes (L, 4) of the lines in pixels of the page: of their words where these made them, else of their ink."""
    boxes = [
        hull([word.box for word in words])
        if rows.are_of_words
        else _union(printed.components, line.members, printed.frame)
        for line, words in zip(rows.lines, rows.words, strict=True)
    ]
    return np.array(boxes, dtype=np.float64).reshape(-1, 4)


def _union(components: InkComponents, members: Indices, frame: LevelledFrame) -> Box:
    """Box of components in pixels of the page."""
    boxes = components.boxes[members]
    sx, sy = frame.scale
    x0, y0 = boxes[:, :2].min(axis=0)
    x1, y1 = boxes[:, 2:].max(axis=0)
    return float(x0 * sx), float(y0 * sy), float(x1 * sx), float(y1 * sy)

"""Lines of a page in the blocks and the reading order that page segmentation found.

The engine's lines are the lines of the text: a line goes into a zone as a whole, and zones order lines and never words.
Zones are boxes, which cut through a line that is a little bent or aslant; the engine follows it.
"""

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from services.contract.boxes import SAME_ROW
from services.ocr.engine import CERTAIN, MADE_UP, Word, mean_confidence
from services.text.page_text import BlockKind, Box, ReadLine, TextBlock, is_right_to_left
from services.text.word_boxes import settle_boxes, with_common_rows

_SIGN = 0.1
"""What a digit or a sign counts beside a letter, where the region of a line is chosen."""
_LONGEST_ENTRY = 6
"""Words of the lines of a region, in the median, beside which values are theirs; prose has more."""
_PROSE_LINES = 3
"""Fewer lines are no prose, however long."""
_LEAST_ROWS = 2
"""Values of one region that are level with entries, unless it has no more lines."""
_HEAD_GAP = 3.0
"""Heights of a head of columns down to its first value: a row with the name of a section may lie between."""
_OVERLAP = 0.5
"""Two lines of the engine that have more than this of the narrower one's width in common are not one row."""
_HEADING = 1.2
"""A block whose print is larger than that of most words by this factor is a heading."""
_LARGE_HEADING = 1.6
"""And by this factor, one of the first level."""
_HEADING_WORDS = 25
"""Longer blocks are paragraphs in large print."""
_CURRENCY = re.compile(r"[A-Z]{3}|Rs\.?|Fr\.?|[Kk]r\.?|zł")
_SURE = 0.8
"""In a row whose letters have less than `MADE_UP` in the mean, as in the grain of a desk, words need this."""


@dataclass(frozen=True, slots=True)
class Region:
    """A text zone of segmentation: its box, the em of its print in pixels (None: unknown), and its words' boxes."""

    box: Box
    font_size: float | None
    words: tuple[Box, ...]


Part = list[Word]
"""One of the engine's lines: a line of print, or a part of one."""


def arrange_words(words: Sequence[Word], regions: Sequence[Region]) -> tuple[TextBlock, ...]:
    """Blocks of all `words` (in the engine's order), in the order of `regions`.

    A word belongs to the region that segmentation put it in, else to the smallest region that contains its centre; a
    line to the region of most of its letters, signs and digits counting little: a row with an amount is where its
    words are. Lines in no region make blocks of their own, each after the last block that lies above it, a printed
    head of the page before all; but for words and rows that the engine probably made up. Without regions nothing is
    left out: then there is no place where print is expected.
    """

    region_of = {box: index for index, region in enumerate(regions) for box in region.words}
    boxes = np.array([region.box for region in regions], dtype=np.float64).reshape(-1, 4)

    held: list[list[Part]] = [[] for _ in regions]
    others: list[Part] = []
    for line in lines_of(words):
        letters: dict[int | None, float] = {}
        for word in line:
            index = region_of.get(word.box)
            index = _smallest_around(boxes, word.box) if index is None else index
            letters[index] = letters.get(index, 0.0) + sum(1.0 if c.isalpha() else _SIGN for c in word.text)
        index = max(letters, key=lambda region: letters[region])
        if index is not None:
            held[index].append(line)
        elif any(character.isalnum() for word in line for character in word.text):
            others.append(line)
    _level_values(held)
    _place_heads(held)
    usual = _usual_size(regions, held)
    blocks = [
        _block(mine, region.font_size, usual) for region, mine in zip(regions, held, strict=True) if mine
    ]
    for row in rows_of(others):
        if kept := _believed(row.words) if regions else row.words:
            block = TextBlock((ReadLine(tuple(kept)),))
            is_first = row.words[0].confidence >= CERTAIN and all(_is_below(each, block) for each in blocks)
            blocks.insert(0 if is_first else _after_above(blocks, block.box), block)
    return tuple(blocks)


def with_blocks(blocks: Sequence[TextBlock], others: Sequence[TextBlock]) -> tuple[TextBlock, ...]:
    """The blocks, and each of the `others` after the last one above in its columns, or before the first below."""
    every = list(blocks)
    for block in others:
        above = _in_columns(every, block.box)
        after = [index + 1 for index, is_above in above.items() if is_above]
        every.insert(after[-1] if after else next(iter(above), len(every)), block)
    return tuple(every)


def _level_values(held: list[list[Part]]) -> None:
    """Move values, in place, to the regions of what they are values of: the line left of them in their row.

    Amounts of a table stand in a column of their own, and are read by rows. A value beside prose is of another column
    of the page, and a lone one beside others' lines may be.
    """
    entries = [
        (index, part[-1].box)
        for index, parts in enumerate(held)
        if len(parts) < _PROSE_LINES or np.median([len(part) for part in parts]) <= _LONGEST_ENTRY
        for part in parts
        if not is_value(part)
    ]
    if not entries:
        return
    places, ends = np.array([index for index, _ in entries]), np.array([box for _, box in entries])
    moves = []
    for index, parts in enumerate(held):
        found = [(part, _entry_of(part, places, ends)) for part in parts if is_value(part)]
        moved = [(part, target) for part, target in found if target is not None and target != index]
        if len(moved) >= min(_LEAST_ROWS, len(parts)):
            moves += [(index, part, target) for part, target in moved]
    for index, part, target in moves:
        held[index] = [other for other in held[index] if other is not part]
        held[target].append(part)


def _place_heads(held: list[list[Part]]) -> None:
    """Move heads of columns, in place, to the region of the table below: a region of one row of words above values.

    These are right of what they are values of, in the same region.
    """
    placed = [(index, word) for index, parts in enumerate(held) for part in parts for word in part]
    if not placed:
        return
    places = np.array([index for index, _ in placed])
    x0, y0, x1, y1 = np.array([word.box for _, word in placed], dtype=np.float64).T
    for index, parts in enumerate(held):
        words = [word for part in parts for word in part]
        if not words or any(c.isdigit() for word in words for c in word.text) or len(rows_of(parts)) > 1:
            continue
        boxes = np.array([word.box for word in words], dtype=np.float64)
        left, right, bottom = boxes[:, 0].min(), boxes[:, 2].max(), boxes[:, 3].max()
        height = float(np.median(boxes[:, 3] - boxes[:, 1]))
        below = (places != index) & (x1 > left) & (x0 < right) & (y0 + y1 > 2 * bottom)
        if not below.any():
            continue
        first = np.flatnonzero(below)[np.argmin(y0[below])]
        of_table = places == places[first]
        row = np.flatnonzero(below & of_table & (np.abs(y0 - y0[first]) < height))
        is_near = y0[first] - bottom <= _HEAD_GAP * height
        if is_near and is_value([placed[k][1] for k in row]) and (of_table & (x1 <= left)).any():
            held[int(places[first])] += parts
            held[index], places[places == index] = [], places[first]


def is_value(part: Sequence[Word]) -> bool:
    """Whether a line is numbers rather than words."""
    letters = sum(c.isalpha() for word in part for c in word.text if not _CURRENCY.fullmatch(word.text))
    digits = sum(c.isdigit() for word in part for c in word.text)
    return digits > 2 * letters


def _entry_of(value: Part, places: NDArray[np.intp], ends: NDArray[np.float64]) -> int | None:
    """Region of the nearest entry left of a value and level with it; of entries `places` (E,) and last words `ends`."""
    x0, y0, _, y1 = value[0].box
    common = np.minimum(ends[:, 3], y1) - np.maximum(ends[:, 1], y0)
    lower = np.minimum(ends[:, 3] - ends[:, 1], y1 - y0)
    level = np.flatnonzero((ends[:, 2] <= x0) & (common >= SAME_ROW * lower))
    return int(places[level[np.argmax(ends[level, 2])]]) if len(level) else None


def lines_of(words: Sequence[Word]) -> list[Part]:
    """The engine's lines in its order, their words from left to right; each word without a line is one of its own."""
    lines: dict[int, Part] = {}
    for number, word in enumerate(words):
        lines.setdefault(-1 - number if word.line is None else word.line, []).append(word)
    return [sorted(line, key=lambda word: word.box[0] + word.box[2]) for line in lines.values()]


def _is_below(block: TextBlock, other: TextBlock) -> bool:
    return block.box[1] >= other.box[3]


def _after_above(blocks: Sequence[TextBlock], box: Box) -> int:
    """Index behind the last block that lies above `box` in its columns; the end if all or none of the blocks do."""
    mine = [index for index, is_above in _in_columns(blocks, box).items() if is_above]
    return len(blocks) if not mine or all(_is_above(block, box) for block in blocks) else mine[-1] + 1


def _in_columns(blocks: Sequence[TextBlock], box: Box) -> dict[int, bool]:
    """Numbers of the blocks in the columns of `box`, and whether each lies above it."""
    return {
        index: _is_above(block, box)
        for index, block in enumerate(blocks)
        if min(block.box[2], box[2]) > max(block.box[0], box[0])
    }


def _is_above(block: TextBlock, box: Box) -> bool:
    return block.box[1] + block.box[3] < box[1] + box[3]


def _believed(row: Sequence[Word]) -> list[Word]:
    """Words of a row that were probably not made up; in a row that mostly was, the sure ones."""
    least = MADE_UP if mean_confidence(row) >= MADE_UP else _SURE
    return [word for word in row if word.confidence >= least]


def rows_of(parts: Sequence[Part]) -> tuple[ReadLine, ...]:
    """Rows of one column, from the top down; the words of each in the direction of its script.

    Parts of lines beside each other are one row where their facing ends are level, so that a bent line is one.
    """

    rows: list[list[Word]] = []
    for part in sorted(parts, key=_middle):
        shared = [_shared_height(part, row) for row in rows[-3:]]
        if shared and max(shared) >= SAME_ROW:
            rows[-len(shared) :][int(np.argmax(shared))] += part
        else:
            rows.append(list(part))
    return tuple(line_of(row) for row in rows)


def _middle(part: Sequence[Word]) -> float:
    return float(np.mean([word.box[1] + word.box[3] for word in part]))


def line_of(words: Sequence[Word]) -> ReadLine:
    """Words of one row in the direction of their script."""
    words = settle_boxes(words)
    backwards = is_right_to_left("".join(word.text for word in words))
    if backwards:
        words = with_common_rows(words)
    order = sorted(words, key=lambda word: -word.box[2] if backwards else word.box[0])
    return ReadLine(tuple(order))


def _shared_height(part: Sequence[Word], row: Sequence[Word]) -> float:
    """Share of the lower one's height that the nearest words of a part and of a row have in common; 0 if they overlap.

    Words whose line is not known may overlap: the engine's boxes reach over neighbours.
    """
    known = part[0].line is not None and row[0].line is not None
    if known and _share_columns(part, row):
        return 0.0
    one, other = min(
        ((mine, word) for mine in part for word in row),
        key=lambda pair: max(pair[0].box[0], pair[1].box[0]) - min(pair[0].box[2], pair[1].box[2]),
    )
    common = min(one.box[3], other.box[3]) - max(one.box[1], other.box[1])
    return common / max(1e-9, min(one.box[3] - one.box[1], other.box[3] - other.box[1]))


def _share_columns(part: Sequence[Word], row: Sequence[Word]) -> bool:
    """Whether words of a row stand above or below a part of a line rather than in its gaps and beside it."""
    left, right = min(word.box[0] for word in part), max(word.box[2] for word in part)
    common = sum(max(0.0, min(right, word.box[2]) - max(left, word.box[0])) for word in row)
    return common > _OVERLAP * min(right - left, sum(word.box[2] - word.box[0] for word in row))


def _smallest_around(boxes: NDArray[np.float64], box: Box) -> int | None:
    x, y = (box[0] + box[2]) / 2, (box[1] + box[3]) / 2
    around = np.flatnonzero((boxes[:, 0] <= x) & (x <= boxes[:, 2]) & (boxes[:, 1] <= y) & (y <= boxes[:, 3]))
    if len(around) == 0:
        return None
    areas = np.prod(boxes[around, 2:] - boxes[around, :2], axis=1)
    return int(around[np.argmin(areas)])


def _usual_size(regions: Sequence[Region], held: Sequence[Sequence[Part]]) -> float | None:
    """The em of most words."""
    sizes: Counter[float] = Counter()
    for region, parts in zip(regions, held, strict=True):
        if region.font_size is not None:
            sizes[region.font_size] += sum(map(len, parts))
    if not sizes:
        return None
    return float(np.median(list(sizes.elements()))) if sizes.total() else None


def _block(parts: Sequence[Part], font_size: float | None, usual: float | None) -> TextBlock:
    words = [word for part in parts for word in part]
    kind: BlockKind = "text"
    level = 0
    larger = 1.0 if font_size is None or usual is None else font_size / usual
    has_letters = any(any(map(str.isalpha, word.text)) for word in words)
    if larger >= _HEADING and len(words) <= _HEADING_WORDS and has_letters:
        kind, level = "heading", 1 if larger >= _LARGE_HEADING else 2
    return TextBlock(rows_of(parts), kind, level)

"""Words of a page, arranged in the blocks and the reading order that page segmentation found."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from services.ocr.engine import Word, mean_confidence
from services.text.page_text import BlockKind, Box, TextBlock, TextLine, is_right_to_left
from services.text.word_boxes import settle_boxes, with_common_rows


@dataclass(frozen=True, slots=True)
class ArrangementParameters:
    """Which words are one line, and which blocks are headings."""

    row_share: float = 0.5
    """Two words are in one row if they share this much of the lower one's height."""
    heading: float = 1.2
    """A block whose print is larger than that of most words by this factor is a heading."""
    large_heading: float = 1.6
    """And by this factor, one of the first level."""
    heading_words: int = 25
    """Longer blocks are paragraphs in large print."""
    made_up: float = 0.3
    """A word outside of all blocks is left out below this confidence: the engine reads specks and pictures as such."""
    sure: float = 0.8
    """In a row whose letters have less than `made_up` in the mean, as in the grain of a desk, words need this."""


@dataclass(frozen=True, slots=True)
class Region:
    """A text zone of segmentation: its box, the em of its print in pixels (None: unknown), and its words by rows."""

    box: Box
    font_size: float | None
    rows: tuple[tuple[Box, ...], ...]


def arrange_words(words: Sequence[Word], regions: Sequence[Region]) -> tuple[TextBlock, ...]:
    """Blocks of all `words` (in the engine's order), in the order of `regions`.

    A word belongs to the region that segmentation put it in, else to the smallest region that contains its centre.
    Words in no region make blocks of their own at the end, but for words and rows that the engine probably made up.
    """
    p = ArrangementParameters()
    region_of = {box: index for index, region in enumerate(regions) for row in region.rows for box in row}
    held: list[list[Word]] = [[] for _ in regions]
    others: list[Word] = []
    boxes = np.array([region.box for region in regions], dtype=np.float64).reshape(-1, 4)
    for word in words:
        index = region_of.get(word.box)
        if index is None:
            index = _smallest_around(boxes, word.box)
        if index is not None:
            held[index].append(word)
        elif any(map(str.isalnum, word.text)):
            others.append(word)
    usual = _usual_size(regions, held)
    blocks = [
        _block(mine, region.font_size, usual, p) for region, mine in zip(regions, held, strict=True) if mine
    ]
    rows = [kept for row in rows_of(others, p) if (kept := _believed(row.words, p))]
    return (*blocks, *(TextBlock((TextLine(tuple(kept)),)) for kept in rows))


def _believed(row: Sequence[Word], parameters: ArrangementParameters) -> list[Word]:
    """Words of a row that were probably not made up; in a row that mostly was, the sure ones."""
    least = parameters.made_up if mean_confidence(row) >= parameters.made_up else parameters.sure
    return [word for word in row if word.confidence >= least]


def rows_of(words: Sequence[Word], parameters: ArrangementParameters | None = None) -> tuple[TextLine, ...]:
    """Rows of one column of words, from the top down; the words of each in the direction of its script."""
    p = parameters or ArrangementParameters()
    rows: list[list[Word]] = []
    for word in sorted(words, key=lambda word: word.box[1] + word.box[3]):
        shared = [_shared_height(word.box, row) for row in rows[-3:]]
        if shared and max(shared) >= p.row_share:
            rows[-len(shared) :][int(np.argmax(shared))].append(word)
        else:
            rows.append([word])
    return tuple(_line(row) for row in rows)


def _line(words: Sequence[Word]) -> TextLine:
    words = settle_boxes(words)
    backwards = is_right_to_left("".join(word.text for word in words))
    if backwards:
        words = with_common_rows(words)
    order = sorted(words, key=lambda word: -word.box[2] if backwards else word.box[0])
    return TextLine(tuple(order))


def _shared_height(box: Box, row: Sequence[Word]) -> float:
    """Share of the lower one's height that `box` has in common with the last words of a row."""
    shares = []
    for word in row[-4:]:
        common = min(box[3], word.box[3]) - max(box[1], word.box[1])
        shares.append(common / max(1e-9, min(box[3] - box[1], word.box[3] - word.box[1])))
    return max(shares)


def _smallest_around(boxes: NDArray[np.float64], box: Box) -> int | None:
    x, y = (box[0] + box[2]) / 2, (box[1] + box[3]) / 2
    around = np.flatnonzero((boxes[:, 0] <= x) & (x <= boxes[:, 2]) & (boxes[:, 1] <= y) & (y <= boxes[:, 3]))
    if len(around) == 0:
        return None
    areas = np.prod(boxes[around, 2:] - boxes[around, :2], axis=1)
    return int(around[np.argmin(areas)])


def _usual_size(regions: Sequence[Region], held: Sequence[Sequence[Word]]) -> float | None:
    """The em of most words."""
    sizes: Counter[float] = Counter()
    for region, words in zip(regions, held, strict=True):
        if region.font_size is not None:
            sizes[region.font_size] += len(words)
    if not sizes:
        return None
    return float(np.median(list(sizes.elements()))) if sizes.total() else None


def _block(
    words: Sequence[Word], font_size: float | None, usual: float | None, p: ArrangementParameters
) -> TextBlock:
    kind: BlockKind = "text"
    level = 0
    larger = 1.0 if font_size is None or usual is None else font_size / usual
    has_letters = any(any(map(str.isalpha, word.text)) for word in words)
    if larger >= p.heading and len(words) <= p.heading_words and has_letters:
        kind, level = "heading", 1 if larger >= p.large_heading else 2
    return TextBlock(rows_of(words, p), kind, level)

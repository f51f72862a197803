"""Numbers of columns that the engine's page layout lost, read one by one.

Tesseract takes a lone digit between wide spaces for a speck: of made invoices it loses quantities of 1 to 9 that are
printed as clearly as the others, sometimes a whole column of them. So print that no word covers is read as a line of
its own where it is level with a row, stands alone there, and is below or above other numbers or print of this kind.
"""

import re
import time
from collections.abc import Sequence
from statistics import median
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import GrayImage
from services.deadline import time_left_s
from services.imaging.components import label_components
from services.ocr.engine import MADE_UP, OcrEngine, Word

_NUMBER = re.compile(r"-?\d[\d.,]*(?: ?[$€£¥₹₽])?")
"""A number, or an amount with the sign of its currency."""
_DARK = 160
"""Gray level of ink on a page in even light."""
_HEIGHTS = (0.6, 1.3)
"""Height of print that may be a number, in heights of the page's words."""
_WIDEST = 8.0
"""Width of such print: that of 12.345,60 € in heights of small letters."""
_WITHIN = 0.55
"""Widest space within a number, or before the sign of its currency, in heights."""
_APART = 0.7
"""Space between a lone number and the words of its row, in heights. Words of a text are 0.4 apart, and of "4 mm" the
engine read "4mm" in the box of "mm"."""
_LEVEL = 0.4
"""Farthest middles of print of one row, in heights."""
_SAME_EDGE = 0.4
"""Farthest left or right edges, or middles, of the numbers of a column, in heights."""
_LEAST_WORDS = 2
"""Words of the row that a lone number is level with."""
_MARGIN = 0.4
"""Around a number in its crop, in heights."""
_LEAST_CONFIDENCE = 0.8
_MOST_READ: Final = 40
"""Places of a page that are read; each takes about 10 ms."""
_MOST_SEARCHED = 500
"""Pieces of print without words that are looked at, from the top of the page: handwriting and pictures have more."""

Boxes = NDArray[np.float64]


def with_lost_numbers(
    gray: GrayImage, words: Sequence[Word], engine: OcrEngine, ends_s: float = float("inf")
) -> list[Word]:
    """`words` of the page `gray` (H, W), which is in even light, and the numbers that its columns miss.

    A number comes behind the nearest word to its left, as a part of the same line, or before the nearest one to its
    right, and in place of words that are not believed; read twice alike, it needs less confidence. None is read after
    `ends_s` (of `time.process_time`), or after the deadline.
    """
    believed = [place for place, word in enumerate(words) if word.confidence >= MADE_UP]
    if len(believed) < _LEAST_WORDS:
        return list(words)
    boxes = np.array([words[place].box for place in believed])
    height = median((boxes[:, 3] - boxes[:, 1]).tolist())
    numbers = boxes[[_NUMBER.fullmatch(words[place].text) is not None for place in believed]]
    lone = _lone_print(gray, boxes, height)
    found: list[tuple[float, Word]] = []
    gone: set[int] = set()
    for box in lone[_in_columns(lone, numbers, height)][:_MOST_READ]:
        if time.process_time() >= ends_s or time_left_s() <= 0.0:
            break
        margin = round(_MARGIN * height)
        x0, y0, x1, y1 = (int(edge) for edge in box)
        crop = gray[max(0, y0 - margin) : y1 + margin, max(0, x0 - margin) : x1 + margin]
        text, confidence = engine.read_line(np.ascontiguousarray(crop))
        doubted = _doubted(words, box)
        agreed = confidence >= MADE_UP and text.replace(" ", "") == "".join(words[k].text for k in doubted)
        if (confidence >= _LEAST_CONFIDENCE or agreed) and _NUMBER.fullmatch(text):
            gone.update(doubted)
            neighbour, is_behind = _neighbour(box, boxes, height)
            beside = believed[neighbour]
            word = Word(text, (float(x0), float(y0), float(x1), float(y1)), confidence, words[beside].line)
            found.append((beside + (0.5 if is_behind else -0.5), word))
    found += [(float(place), word) for place, word in enumerate(words) if place not in gone]
    return [word for _, word in sorted(found, key=lambda each: each[0])]


def _doubted(words: Sequence[Word], box: NDArray[np.float64]) -> list[int]:
    """Places of the words that are not believed and have their middle in the box."""
    places = []
    for place, word in enumerate(words):
        x, y = (word.box[0] + word.box[2]) / 2, (word.box[1] + word.box[3]) / 2
        if word.confidence < MADE_UP and box[0] <= x <= box[2] and box[1] <= y <= box[3]:
            places.append(place)
    return places


def _lone_print(gray: GrayImage, words: Boxes, height: float) -> Boxes:
    """Boxes (M, 4) of print without words, as high as a number, alone in a row of words; from the top down."""
    ink = np.asarray(cv2.inRange(gray, -1.0, _DARK - 1.0), np.uint8)
    for x0, y0, x1, y1 in words.round().astype(int).clip(0).tolist():
        ink[y0:y1, x0:x1] = 0
    closed = cv2.morphologyEx(
        ink, cv2.MORPH_CLOSE, np.ones((1, 2 * round(_WITHIN * height / 2) + 1), np.uint8)
    )
    joined = np.asarray(closed, np.uint8)
    x, y, width, tall = label_components(joined).stats[1:, :4].astype(np.float64).T
    fits = (tall >= _HEIGHTS[0] * height) & (tall <= _HEIGHTS[1] * height) & (width <= _WIDEST * height)
    lone = np.column_stack([x, y, x + width, y + tall])[fits][:_MOST_SEARCHED]
    level = _are_level(lone, words, height)
    space = _APART * height
    is_near = (lone[:, None, 0] < words[:, 2] + space) & (lone[:, None, 2] > words[:, 0] - space)
    common = np.minimum(lone[:, None, 3], words[:, 3]) - np.maximum(lone[:, None, 1], words[:, 1])
    is_alone = ~np.any(is_near & (common > 0), axis=1)
    return np.asarray(lone[is_alone & (level.sum(axis=1) >= _LEAST_WORDS)])


def _are_level(lone: Boxes, words: Boxes, height: float) -> NDArray[np.bool_]:
    """Which words (M, N) are in a row with the print."""
    middles = (lone[:, 1] + lone[:, 3])[:, None] - (words[:, 1] + words[:, 3])
    return np.asarray(np.abs(middles) / 2 <= _LEVEL * height)


def _in_columns(lone: Boxes, numbers: Boxes, height: float) -> NDArray[np.bool_]:
    """Which print (M,) has its edge or middle below or above that of a number or of other lone print."""
    others = np.concatenate([lone, numbers])
    aligned = np.zeros((len(lone), len(others)), bool)
    for share in (0.0, 0.5, 1.0):
        edges = others[:, 0] + share * (others[:, 2] - others[:, 0])
        aligned |= np.abs(edges[: len(lone), None] - edges) <= _SAME_EDGE * height
    aligned &= ~_are_level(lone, others, height)
    return np.asarray(aligned.any(axis=1))


def _neighbour(box: NDArray[np.float64], words: Boxes, height: float) -> tuple[int, bool]:
    """The nearest word of the row to the left, else to the right, and whether it is to the left."""
    level = _are_level(box[None], words, height)[0]
    left = np.flatnonzero(level & (words[:, 2] <= box[0]))
    if len(left):
        return int(left[words[left, 2].argmax()]), True
    right = np.flatnonzero(level)
    return int(right[words[right, 0].argmin()]), False

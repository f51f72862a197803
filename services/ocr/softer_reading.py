"""Other readings of a page that reads poorly: by a second reader, or of the page enlarged and softened.

Print of thermal and matrix printers is what reads poorly most often, and where no second reader reads its language:
their letters are small and made of dots, which an engine takes apart, or so faint that its one threshold for the page
loses them beside a dark desk. Whether a page is of this kind shows in its reading only: on photos of other print a
softer picture reads worse (92.4 -> 92.1 % of characters).
"""

import time
from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np

from services.arrays import GrayImage
from services.imaging.looks import black_and_white
from services.ocr.engine import AssistedReader, BoundedReader, OcrEngine, Word, mean_confidence
from services.ocr.word_trust import probability_right

ASSISTED_BELOW = 0.85
"""Mean confidence of words below which a page is read by a second reader too. Score and CPU s of 35 receipts and 29
photos: 94.9 % in 1.95 s, 96.2 in 1.48 from 0.8 on, 96.8 in 2.17, 96.7 in 1.56 from here on, 96.7 in 2.27, 96.9 in 2.13
from 0.9 on. No page was read worse."""
READS_POORLY = 0.8
"""Mean confidence of words below which a page is read twice: prose that is in focus has 0.9 and more."""
READS_HARDLY = 0.5
"""The same, below which it is read in black and white too. From 0.8 on values were lost (company 49 -> 43 %)."""
ENLARGEMENT = 1.5
SOFTNESS_PX = 0.8
"""Deviation of the Gaussian on the enlarged picture. Of 26 receipts the engine reads 59.3 % of characters as they are,
64.6 % softened, 68.1 % softened from black and white; no one of them is best on all."""


def read_best(page: GrayImage, engine: OcrEngine, limit_s: float) -> tuple[list[Word], bool]:
    """Words of a page (H, W) in even light that were read in `limit_s`, and whether others were left unread.

    A page that reads poorly is read by a second reader, if the engine has one, else softer: from gray and then from
    black and white, until it reads. The reading with the most letters to be right counts.
    """
    begun_s = time.process_time()
    words, cut = read_within(page, engine, limit_s)
    if cut:
        return words, cut
    return improved(page, engine, words, time.process_time() - begun_s, limit_s)


def improved(
    page: GrayImage, engine: OcrEngine, words: list[Word], once_s: float = 0.0, limit_s: float = float("inf")
) -> tuple[list[Word], bool]:
    """The `words` that the engine read on a page in `once_s` of `limit_s`, or those of a better reading.

    See `read_best`. The last is whether the second reader had no time.
    """
    if mean_confidence(words) >= ASSISTED_BELOW:
        return words, False
    second = engine.second_reader() if isinstance(engine, AssistedReader) else None
    if second is None:
        return _read_softer(page, engine, words, once_s, limit_s), False
    others, cut = second.read_page_within(page, limit_s - once_s)
    return max(words, others, key=_right_letters), cut


def _read_softer(
    page: GrayImage, engine: OcrEngine, best: list[Word], once_s: float, limit_s: float
) -> list[Word]:
    """The best reading; the first one, `best`, took `once_s` of all the time."""
    # Each may take as long as the first one for each of its pixels: none shall be cut.
    longest_s = ENLARGEMENT**2 * once_s
    begun_s = time.process_time() - once_s
    for prepare, least in ((np.asarray, READS_POORLY), (_as_ink, READS_HARDLY)):
        left_s = limit_s - (time.process_time() - begun_s)
        if not best or mean_confidence(best) >= least or longest_s > left_s:
            break
        words, _ = read_within(_softened(prepare(page)), engine, left_s)
        best = max(best, [replace(word, box=_reduced(word)) for word in words], key=_right_letters)
    return best


def read_within(page: GrayImage, engine: OcrEngine, limit_s: float) -> tuple[list[Word], bool]:
    """Words that the engine alone reads on a page in `limit_s`, and whether others were left unread."""
    if isinstance(engine, BoundedReader) and limit_s < float("inf"):
        return engine.read_page_within(page, limit_s)
    return engine.read_page(page), False


def _as_ink(page: GrayImage) -> GrayImage:
    return np.where(black_and_white(page), 255, 0).astype(np.uint8)


def _softened(page: GrayImage) -> GrayImage:
    large = cv2.resize(page, None, fx=ENLARGEMENT, fy=ENLARGEMENT, interpolation=cv2.INTER_CUBIC)
    return np.asarray(cv2.GaussianBlur(large, (0, 0), SOFTNESS_PX), np.uint8)


def _reduced(word: Word) -> tuple[float, float, float, float]:
    x0, y0, x1, y1 = word.box
    return x0 / ENLARGEMENT, y0 / ENLARGEMENT, x1 / ENLARGEMENT, y1 / ENLARGEMENT


def _right_letters(words: Sequence[Word]) -> float:
    """Letters that can be expected to be right."""
    return sum(len(word.text) * probability_right(word.confidence) for word in words)

"""Pages that the tests of segmentation draw, with the truth of their zones."""

from functools import cache

import cv2
import numpy as np

from services.arrays import GrayImage
from services.ocr.engine import Word
from simulation.labelled_pages import LabelledPage, letter_page, memo_page, title_page

Box = tuple[float, float, float, float]


@cache
def sample(kind: str, seed: int, scale: float = 1.0) -> LabelledPage:
    """A labelled page, drawn once."""
    rng = np.random.default_rng(seed)
    if kind == "letter":
        return letter_page(rng, scale=scale)
    if kind == "memo":
        return memo_page(rng, scale=scale)
    return title_page(rng, kind, scale=scale)  # type: ignore[arg-type]


def drawing(page: LabelledPage) -> GrayImage:
    """Its image."""
    assert page.image is not None
    return page.image


def turned(image: GrayImage, degrees: float) -> tuple[GrayImage, np.ndarray]:
    """`image` turned about its centre on white, and the affine map (2, 3) that did it."""
    height, width = image.shape
    turn = cv2.getRotationMatrix2D(((width - 1) / 2, (height - 1) / 2), degrees, 1.0)
    result = cv2.warpAffine(image, turn, (width, height), flags=cv2.INTER_LINEAR, borderValue=255)
    return np.asarray(result, dtype=np.uint8), np.asarray(turn)


def words_of(page: LabelledPage) -> list[Word]:
    """What a perfect engine would read: the words of every line of text, in boxes of equal letters."""
    words = []
    for zone in page.zones:
        rows = zone.text.splitlines()
        x0, y0, x1, y1 = zone.box
        longest = max((len(row) for row in rows), default=1)
        for number, row in enumerate(rows):
            top, bottom = (y0 + (y1 - y0) * (number + k) / len(rows) for k in (0.1, 0.9))
            at = 0
            for text in row.split(" "):
                left, right = (x0 + (x1 - x0) * k / longest for k in (at, at + max(1, len(text))))
                if text:
                    words.append(Word(text, (left, top, right, bottom), 0.95))
                at += len(text) + 1
    return words


def iou(a: Box, b: Box) -> float:
    """Shared area of two boxes over their union's."""
    across, down = min(a[2], b[2]) - max(a[0], b[0]), min(a[3], b[3]) - max(a[1], b[1])
    shared = max(across, 0.0) * max(down, 0.0)
    areas = [(box[2] - box[0]) * (box[3] - box[1]) for box in (a, b)]
    return shared / (sum(areas) - shared)


def whole_share(truth: list[Box], found: list[Box], least: float = 0.7) -> float:
    """Share of true boxes that one found box fits."""
    return sum(any(iou(box, other) >= least for other in found) for box in truth) / len(truth)

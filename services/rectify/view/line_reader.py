"""Lines of a flat page are read in several orientations, to tell which way is up."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from services.arrays import GrayImage
from services.ocr.engine import OcrEngine
from services.ocr.text_lines import TextLine
from services.rectify.results import Orientation
from services.rectify.view.turned_image import apply_orientation

# Scores are length-weighted word confidences, 0-1: print reads at 0.8-0.96 the right way and at 0.1-0.5
# in the wrong ones (measured on English and French pages with Tesseract).
CLEAR_SCORE = 0.75
CLEAR_LETTERS = 20.0
"""One line of so many letters that reads so well in one orientation, and so badly in the other, is enough: right
orientations have 0.8 and more on sharp print, wrong ones below 0.3."""
EVIDENT_SCORE = 0.9
"""A line of `clear_letters` that reads so well upright needs not be read upside down: of 516 lines of 81 pages six
of ten did, and upside down none of more than 19 letters reached 0.65."""
EVIDENT_LINES = 3
"""So many lines are read upright in search of such a one, whatever their mass."""
MOST_CROPS = 18
"""Most crops that are tried for the wanted lines; crops of pictures or texture read as nothing."""
INFORMATIVE_LETTERS = 5.0
"""A crop with fewer letters in every orientation is not a line."""
DIGIT_WEIGHT = 0.4
"""Digits are often digits upside down too."""
UNREAD_SCORE = 0.5
"""If none of few lines reads better, the engine does not know the language, as a rule: its page detection, which takes
as long as six lines, is asked before more are read."""
CROP_HEIGHT_PX = 36
CROP_LENGTH = 26.0
"""Heights of a line that are read: its first words are enough."""


@dataclass(frozen=True, slots=True)
class Way:
    """A candidate: turn, and whether the page is mirrored."""

    rotation_deg: int
    mirrored: bool


class LineReader:
    """Reads the lines of one axis in several orientations, each crop once in each of them."""

    def __init__(
        self, lines: Sequence[TextLine], cut: Callable[[TextLine], GrayImage], turn_deg: int, ocr: OcrEngine
    ) -> None:
        """`cut` makes the crop of a line, `CROP_HEIGHT_PX` high; `turn_deg` is that of the axis against the page."""
        self.turn_deg = turn_deg
        self._cut = cut
        self._order = _reading_order(lines, MOST_CROPS)
        self._ocr = ocr
        self._readings: dict[tuple[int, Way], tuple[float, float]] = {}

    def score(self, ways: list[Way], wanted: int) -> tuple[float, dict[Way, float]]:
        """Letters in `wanted` lines, and the confidence per letter of every orientation.

        A line counts with the letters of the orientation that found most in it, so that a short word found in
        garbage is worth little. It counts with the square of its best confidence, so that lines which cannot be
        read in any orientation (blurred ones, pictures) do not hide the others.
        """
        total = weights = 0.0
        sums = dict.fromkeys(ways, 0.0)
        informative = 0
        for index in range(len(self._order)):
            if informative == wanted:
                break
            readings = {way: self._read(index, way) for way in ways}
            letters = max(count for count, _ in readings.values())
            if letters < INFORMATIVE_LETTERS:
                continue
            informative += 1
            total += letters
            trust = max(confidence for _, confidence in readings.values()) ** 2
            weights += trust * letters
            for way, (count, confidence) in readings.items():
                sums[way] += trust * count * confidence
        return total, {way: value / weights if weights else 0.0 for way, value in sums.items()}

    def evident_score(self, way: Way, *, is_clear_enough: bool = True) -> float | None:
        """Confidence of the first of `EVIDENT_LINES` that reads evidently this way; None if none does.

        The search ends at a line that hardly reads (the page lies otherwise, or its language is not known), and, if
        `is_clear_enough`, at a clear one, which one more reading decides as a rule.
        """
        for index in range(min(EVIDENT_LINES, len(self._order))):
            letters, score = self._read(index, way)
            if letters >= CLEAR_LETTERS and score >= EVIDENT_SCORE:
                return score
            is_clear = is_clear_enough and letters >= CLEAR_LETTERS and score >= CLEAR_SCORE
            if is_clear or score < UNREAD_SCORE:
                break
        return None

    def _read(self, index: int, way: Way) -> tuple[float, float]:
        """Weighted number of letters in one crop, and their confidence."""
        if (index, way) not in self._readings:
            crop = self._cut(self._order[index])
            # From the axis's frame back to the page's, and on to the candidate's.
            crop = np.rot90(crop, self.turn_deg // 90)
            crop = apply_orientation(crop, Orientation(way.rotation_deg, way.mirrored, None))
            text, confidence = self._ocr.read_line(crop)
            letters = sum(map(str.isalpha, text)) + DIGIT_WEIGHT * sum(map(str.isdigit, text))
            self._readings[index, way] = (letters, confidence)
        return self._readings[index, way]


def _reading_order(lines: Sequence[TextLine], most: int) -> list[TextLine]:
    """The most promising lines, any first few spread over the page; every third one of larger print."""
    if not lines:
        return []
    # The usual height is that of long lines: short ones vary.
    heights_px = [line.height_px for line in lines for _ in range(1 + int(line.width_px / line.height_px))]
    usual_px = float(np.median(heights_px))
    large = [line for line in lines if line.height_px > 1.7 * usual_px]
    usual = _spread([line for line in lines if line.height_px <= 1.7 * usual_px], usual_px, most)
    headings = _spread(large, 3.0 * usual_px, most // 3)
    order: list[TextLine] = []
    while usual or headings:
        order += [*usual[:2], *headings[:1]]
        usual, headings = usual[2:], headings[1:]
    return order[:most]


def _spread(lines: list[TextLine], height_px: float, most: int) -> list[TextLine]:
    """At most `most` long lines of about the given height, any first few of them spread over the page."""

    def promise(line: TextLine) -> float:
        ratio = line.height_px / height_px
        return (
            min(line.width_px / line.height_px, CROP_LENGTH)
            * min(ratio, 1.0 / ratio)
            * min(line.strokes, 1.0)
        )

    chosen = sorted(sorted(lines, key=promise, reverse=True)[:most], key=lambda line: line.box[1])
    bits = max(1, (len(chosen) - 1).bit_length())
    spread = sorted(range(len(chosen)), key=lambda index: int(f"{index:0{bits}b}"[::-1], 2))
    return [chosen[index] for index in spread]

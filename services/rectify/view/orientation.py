"""Orientation of a flat page: a few of its lines are read in every possible orientation."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import GrayImage, RgbImage
from services.geometry.page_frame import (
    Frame,
    mesh_of,
    resize_frame,
    turn_against_photo,
    turn_as_in_photo,
)
from services.imaging.channels import luminance
from services.imaging.illumination import flatten_illumination
from services.imaging.reduction import reduce_image
from services.notices import Notice
from services.ocr.engine import DirectionDetector, OcrEngine, ReadDirection
from services.ocr.text_lines import PageLines, TextLine, TextLines, cut_line, detect_text_lines
from services.rectify.analysis.found_text import AnalysisParameters
from services.rectify.analysis.page_analysis import PageAnalysis
from services.rectify.results import Orientation
from services.rectify.view.drawing import draw_gray_view

_TURNS = {90: cv2.ROTATE_90_CLOCKWISE, 180: cv2.ROTATE_180, 270: cv2.ROTATE_90_COUNTERCLOCKWISE}

# When more lines are read, and when an orientation is accepted.
#
# Scores are length-weighted word confidences, 0-1: print reads at 0.8-0.96 the right way and at 0.1-0.5
# in the wrong ones (measured on English and French pages with Tesseract).
FIRST_LINES = 1
CLEAR_SCORE = 0.75
CLEAR_MARGIN = 0.5
CLEAR_LETTERS = 20.0
"""One line of so many letters that reads so well in one orientation, and so badly in the other, is enough: right
orientations have 0.8 and more on sharp print, wrong ones below 0.3."""
EVIDENT_SCORE = 0.9
"""A line of `clear_letters` that reads so well upright needs not be read upside down: of 516 lines of 81 pages six
of ten did, and upside down none of more than 19 letters reached 0.65."""
EVIDENT_LINES = 3
"""So many lines are read upright in search of such a one, whatever their mass."""
FEW_LINES = 3
MORE_LINES = 9
MOST_CROPS = 18
"""Most crops that are tried for the wanted lines; crops of pictures or texture read as nothing."""
CERTAIN_SCORE = 0.6
"""Below it, or within `CERTAIN_MARGIN` of the runner-up, more lines are read."""
CERTAIN_MARGIN = 0.2
FULL_MARGIN = 0.35
"""A margin that leaves no doubt. Over nine lines, wrong ways won by up to 0.17 (Greek, read as English),
and never by 0.2; so confidence is the geometric mean of score and margin over this."""
LEAST_CONFIDENCE = 0.5
"""Below it the orientation is unknown."""
CERTAIN_CONFIDENCE = 0.7
"""Below it mirrored ways are tried too; print that reads well needs no such comparison."""
CLEAR_MASS = 2.0
"""From this mass on, lines along the rows are read both ways before any along the columns are sought: letters make
lines of up to 1.2 across their own, a page of text has 2 to 13."""
CLEAR_AXIS = 0.4
"""The other axis is tried from the start where its text-line mass is at least this share."""
CERTAIN_AXIS = 0.1
"""The other axis is tried, when nothing reads, where its text-line mass is at least this share."""
INFORMATIVE_LETTERS = 5.0
"""A crop with fewer letters in every orientation is not a line."""
ENOUGH_LETTERS = 15.0
"""Fewer read letters weigh the confidence down in proportion."""
DIGIT_WEIGHT = 0.4
"""Digits are often digits upside down too."""
HOPELESS_SCORE = 0.25
"""If no orientation reads better, more lines are not worth the time."""
UNREAD_SCORE = 0.5
"""If none of few lines reads better, the engine does not know the language, as a rule: its page detection, which takes
as long as six lines, is asked before more are read."""
LEAST_DETECTION_CONFIDENCE = 12.0
"""Of Tesseract's script detection, wrong at up to 4 on print, and at up to 11.5 on mirrored print."""
EAST_ASIAN_SCRIPTS = ("Han", "Hangul", "Japanese", "Korean")
LEAST_SURE_CONFIDENCE = 6.0
"""Of these scripts, for which other print is not taken, mirrored or not. Eight photos of a Chinese page were all
right, at 7.8 to 11.2. And of a direction that the lines' readings found as well."""
CROP_HEIGHT_PX = 36


@dataclass(frozen=True, slots=True)
class _Way:
    """A candidate: turn, and whether the page is mirrored."""

    rotation_deg: int
    mirrored: bool


def estimate_orientation(flat: GrayImage, ocr: OcrEngine, lies_deg: int = 0) -> Orientation:
    """Estimate the turn (and flip) after which a flat page can be read.

    Up to three line crops are read upright. If none reads evidently, one is read in both orientations of the rows and
    scored by length-weighted word confidence, then three, then nine, until that is decisive. If it is not, the axis of
    the greater text-line mass is read, then the other one and mirrored orientations.

    Parameters
    ----------
    flat
        (H, W) uint8, flat-fielded.
    ocr
        Reads line crops.
    lies_deg
        The turn after which the page lies as in the photo: photos are upright more often than not.

    Returns
    -------
    Orientation
        Its confidence is at least 0.5 if one orientation can be read and the others cannot. Otherwise (blank pages,
        handwriting, a script that the engine does not know) it is lower, and the page is turned as it lies in the
        photo, unless its lines are clear and would not be level then.
    """
    lines = detect_text_lines(flat)
    found = _read_orientation(flat, lines, ocr, lies_deg)
    if (found.confidence or 0.0) >= LEAST_CONFIDENCE:
        return found
    is_level = lines.rows.mass >= CLEAR_MASS and lines.columns.mass < CLEAR_AXIS * lines.rows.mass
    return Orientation(0 if is_level and lies_deg % 180 else lies_deg, False, found.confidence)


def _read_orientation(flat: GrayImage, lines: PageLines, ocr: OcrEngine, lies_deg: int) -> Orientation:
    """`estimate_orientation` by what is read; below its least confidence only that is of use."""
    rows = _LineReader(flat, lines.rows, 0, ocr)
    engine = _PageDetection(flat, ocr)
    # A flat page has been turned until its lines run along the rows: mostly these can be read.
    score = rows.evident_score(_Way(0, False))
    if score is not None:
        return Orientation(0, False, math.sqrt(score))
    if rows.mass >= CLEAR_MASS:
        found = _decide([rows], (False,), engine)
        if (found.confidence or 0.0) >= CERTAIN_CONFIDENCE:
            return found
    axes = [rows, _LineReader(flat, lines.columns, 90, ocr)]
    axes.sort(key=lambda axis: axis.mass, reverse=True)
    if axes[0].mass == 0.0:
        return Orientation(0, False, 0.0)
    ratio = axes[1].mass / axes[0].mass
    plain = found = _decide(axes[: 1 if ratio < CLEAR_AXIS else 2], (False,), engine)
    if (plain.confidence or 0.0) < CERTAIN_CONFIDENCE and not engine.is_sure:
        is_unread = (plain.confidence or 0.0) < LEAST_CONFIDENCE
        found = _decide(axes[: 1 if ratio < CERTAIN_AXIS else 2], (False, True), is_unread=is_unread)
    # Letters are read into other scripts, and photos are upright more often than not.
    least = LEAST_CONFIDENCE if found.rotation_deg == lies_deg else CERTAIN_CONFIDENCE
    confidence = found.confidence or 0.0
    if confidence < least:
        return engine.answer(plain) or Orientation(0, False, confidence * LEAST_CONFIDENCE / least)
    return found


class _PageDetection:
    """Orientation by the page detection of the engine, which knows scripts whose words it cannot read. Asked once."""

    def __init__(self, flat: GrayImage, ocr: OcrEngine) -> None:
        self._flat = flat
        self._ocr = ocr
        self._found: ReadDirection | None = None
        self._asked = False

    @property
    def is_sure(self) -> bool:
        """Whether it was asked, and needs no line to agree."""
        return self._asked and self.answer() is not None

    def answer(self, plain: Orientation | None = None) -> Orientation | None:
        """What it says, if that is believed.

        `plain` is what the lines' readings say if mirrored ways are left out: less confidence is enough for the same.
        """
        direction = self._ask()
        if direction is None:
            return None
        agrees = (
            plain is not None
            and (plain.confidence or 0.0) >= LEAST_CONFIDENCE
            and plain.rotation_deg == -direction.turned_deg % 360
        )
        sure = agrees or direction.script in EAST_ASIAN_SCRIPTS
        least = LEAST_SURE_CONFIDENCE if sure else LEAST_DETECTION_CONFIDENCE
        if direction.confidence < least:
            return None
        surplus = direction.confidence / least - 1.0
        return Orientation(-direction.turned_deg % 360, False, min(0.9, LEAST_CONFIDENCE + 0.4 * surplus))

    def _ask(self) -> ReadDirection | None:
        if not self._asked:
            self._asked = True
            if isinstance(self._ocr, DirectionDetector):
                factor = min(1.0, AnalysisParameters().long_side_px / max(self._flat.shape))
                self._found = self._ocr.detect_direction(
                    flatten_illumination(reduce_image(self._flat, factor))
                )
        return self._found


def apply_orientation(image: NDArray[np.uint8], orientation: Orientation) -> NDArray[np.uint8]:
    """`image` (H, W) or (H, W, 3) flipped left to right if `mirrored`, then turned clockwise; contiguous.

    OpenCV takes 4 to 13 ms for 12 megapixels, NumPy 37 to 52.
    """
    flipped = cv2.flip(image, 1) if orientation.mirrored else image
    turn = _TURNS.get(orientation.rotation_deg % 360)
    return np.ascontiguousarray(flipped if turn is None else cv2.rotate(flipped, turn), np.uint8)


def _decide(
    axes: list["_LineReader"],
    mirrorings: tuple[bool, ...],
    engine: _PageDetection | None = None,
    *,
    is_unread: bool = False,
) -> Orientation:
    """Best way among the two turns of each axis in each of `mirrorings`.

    Where few lines hardly read, `engine` is asked before more are, and none are where mirrored ways are tried of what
    `is_unread` otherwise.
    """
    best, confidence = _Way(0, False), 0.0
    stages = (
        (FIRST_LINES, CLEAR_SCORE, CLEAR_MARGIN, CLEAR_LETTERS),
        (FEW_LINES, CERTAIN_SCORE, CERTAIN_MARGIN, 0.0),
        (-(-MORE_LINES // len(axes)), CERTAIN_SCORE, CERTAIN_MARGIN, 0.0),
    )
    for lines, least_score, least_margin, least_letters in stages:
        scores: dict[_Way, float] = {}
        letters = 0.0
        for axis in axes:
            ways = [_Way(axis.turn_deg + half, m) for m in mirrorings for half in (0, 180)]
            read, score = axis.score(ways, lines)
            letters = max(letters, read)
            scores.update(score)
        ranked = sorted(scores, key=lambda way: scores[way], reverse=True)
        best = ranked[0]
        margin = scores[best] - scores[ranked[1]]
        evidence = scores[best] * min(1.0, margin / FULL_MARGIN)
        confidence = math.sqrt(evidence) * min(1.0, letters / ENOUGH_LETTERS)
        if scores[best] >= least_score and margin >= least_margin and letters >= least_letters:
            break
        if True in mirrorings and scores[best] < HOPELESS_SCORE:
            break
        if lines == FEW_LINES and scores[best] < UNREAD_SCORE:
            if is_unread:
                return Orientation(0, False, min(confidence, LEAST_CONFIDENCE / 2))
            detected = None if engine is None else engine.answer()
            if detected is not None:
                return detected
    # Mirrored photos are rare, and letters are read into the texture of pictures.
    least = CERTAIN_CONFIDENCE if best.mirrored else LEAST_CONFIDENCE
    if confidence < least:
        return Orientation(0, False, confidence * LEAST_CONFIDENCE / least)
    return Orientation(best.rotation_deg, best.mirrored, confidence)


class _LineReader:
    """Reads the lines of one axis in several orientations, each crop once in each of them."""

    def __init__(self, flat: GrayImage, lines: TextLines, turn_deg: int, ocr: OcrEngine) -> None:
        self.turn_deg = turn_deg
        self.mass = lines.mass
        self._page = np.rot90(flat, -(turn_deg // 90))
        self._inverted = lines.inverted
        self._order = _reading_order(lines.lines, MOST_CROPS)
        self._ocr = ocr
        self._readings: dict[tuple[int, _Way], tuple[float, float]] = {}

    def score(self, ways: list[_Way], wanted: int) -> tuple[float, dict[_Way, float]]:
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

    def evident_score(self, way: _Way) -> float | None:
        """Confidence of the first of `EVIDENT_LINES` that reads evidently this way; None if none does.

        The search ends at a line that hardly reads (the page lies otherwise, or its language is not known), and at a
        clear one, which one more reading decides as a rule.
        """
        for index in range(min(EVIDENT_LINES, len(self._order))):
            letters, score = self._read(index, way)
            if letters >= CLEAR_LETTERS and score >= EVIDENT_SCORE:
                return score
            is_clear = letters >= CLEAR_LETTERS and score >= CLEAR_SCORE
            if is_clear or score < UNREAD_SCORE:
                break
        return None

    def _read(self, index: int, way: _Way) -> tuple[float, float]:
        """Weighted number of letters in one crop, and their confidence."""
        if (index, way) not in self._readings:
            crop = cut_line(self._page, self._order[index], self._inverted, CROP_HEIGHT_PX)
            # From the axis's frame back to the page's, and on to the candidate's.
            crop = np.rot90(crop, self.turn_deg // 90)
            crop = apply_orientation(crop, Orientation(way.rotation_deg, way.mirrored, None))
            text, confidence = self._ocr.read_line(crop)
            letters = sum(map(str.isalpha, text)) + DIGIT_WEIGHT * sum(map(str.isdigit, text))
            self._readings[index, way] = (letters, confidence)
        return self._readings[index, way]


def _reading_order(lines: tuple[TextLine, ...], most: int) -> list[TextLine]:
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
        return min(line.width_px / line.height_px, 26.0) * min(ratio, 1.0 / ratio) * min(line.strokes, 1.0)

    chosen = sorted(sorted(lines, key=promise, reverse=True)[:most], key=lambda line: line.box[1])
    bits = max(1, (len(chosen) - 1).bit_length())
    spread = sorted(range(len(chosen)), key=lambda index: int(f"{index:0{bits}b}"[::-1], 2))
    return [chosen[index] for index in spread]


def orient_page(
    photo: RgbImage, analysis: PageAnalysis | None, frame: Frame, ocr: OcrEngine | None
) -> tuple[Orientation, Notice | None]:
    """Orientation of the flat view, and a notice if it is unknown."""
    lies_deg = turn_as_in_photo(turn_against_photo(mesh_of(frame, 9, 9)))
    return tell_orientation(lambda: draw_for_reading(photo, analysis, frame), ocr, lies_deg)


def draw_for_reading(photo: RgbImage, analysis: PageAnalysis | None, frame: Frame) -> GrayImage:
    """Small flat view in gray under even light, in which words can be read."""
    if analysis is not None:
        text = analysis.strokes
        return draw_gray_view(text.image, text.factor, resize_frame(frame, text.factor), text.origin)
    factor = min(1.0, AnalysisParameters().long_side_px / max(photo.shape))
    gray = reduce_image(luminance(photo), factor)
    return draw_gray_view(flatten_illumination(gray), factor, resize_frame(frame, factor))


def tell_orientation(
    draw: Callable[[], GrayImage], ocr: OcrEngine | None, lies_deg: int = 0
) -> tuple[Orientation, Notice | None]:
    """Orientation of the flat-fielded view that `draw` returns, and a notice if it is unknown.

    `lies_deg`: see `estimate_orientation`.
    """
    if ocr is None:
        return Orientation(0, False, None), Notice(
            "ocr-unavailable",
            "no OCR engine is installed, so the page may be upside down; send rotate if it is.",
        )
    orientation = estimate_orientation(draw(), ocr, lies_deg)
    if (orientation.confidence or 0.0) < 0.5:
        return orientation, Notice(
            "orientation-unknown",
            "too little could be read to tell which way up the page is; send rotate if it is not upright.",
        )
    return orientation, None

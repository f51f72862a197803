"""Orientation of a flat page: a few of its lines are read in every possible orientation."""

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

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
from services.ocr.text_lines import PageLines, TextLines, cut_line, detect_text_lines
from services.rectify.analysis.found_text import AnalysisParameters
from services.rectify.analysis.page_analysis import PageAnalysis
from services.rectify.results import Orientation
from services.rectify.view.drawing import draw_gray_view
from services.rectify.view.line_reader import (
    CLEAR_LETTERS,
    CLEAR_SCORE,
    CROP_HEIGHT_PX,
    CROP_LENGTH,
    UNREAD_SCORE,
    LineReader,
    Way,
)
from services.rectify.view.rows_in_view import evident_line

# When more lines are read, and when an orientation is accepted.
FIRST_LINES = 1
CLEAR_MARGIN = 0.5
FEW_LINES = 3
MORE_LINES = 9
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
ENOUGH_LETTERS = 15.0
"""Fewer read letters weigh the confidence down in proportion."""
HOPELESS_SCORE = 0.25
"""If no orientation reads better, more lines are not worth the time."""
LEAST_DETECTION_CONFIDENCE = 12.0
"""Of Tesseract's script detection, wrong at up to 4 on print, and at up to 11.5 on mirrored print."""
EAST_ASIAN_SCRIPTS = ("Han", "Hangul", "Japanese", "Korean")
LEAST_SURE_CONFIDENCE = 6.0
"""Of these scripts, for which other print is not taken, mirrored or not. Eight photos of a Chinese page were all
right, at 7.8 to 11.2. And of a direction that the lines' readings found as well."""


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
    rows = _reader_along(flat, lines.rows, 0, ocr)
    engine = _PageDetection(flat, ocr)
    # A flat page has been turned until its lines run along the rows: mostly these can be read.
    score = rows.evident_score(Way(0, False))
    if score is not None:
        return Orientation(0, False, math.sqrt(score))
    if lines.rows.mass >= CLEAR_MASS:
        found = _decide([rows], (False,), engine)
        if (found.confidence or 0.0) >= CERTAIN_CONFIDENCE:
            return found
    masses = [lines.rows.mass, lines.columns.mass]
    if max(masses) == 0.0:
        return Orientation(0, False, 0.0)
    axes = [rows, _reader_along(flat, lines.columns, 90, ocr)]
    if masses[1] > masses[0]:
        axes.reverse()
    ratio = min(masses) / max(masses)
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


def _reader_along(flat: GrayImage, lines: TextLines, turn_deg: int, ocr: OcrEngine) -> LineReader:
    """Of the `lines` of `flat` (H, W) turned counterclockwise by `turn_deg`."""
    page = np.rot90(flat, -(turn_deg // 90))
    cut = partial(cut_line, page, inverted=lines.inverted, height_px=CROP_HEIGHT_PX, longest=CROP_LENGTH)
    return LineReader(lines.lines, cut, turn_deg, ocr)


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
                page = flatten_illumination(reduce_image(self._flat, factor))
                self._found = _detect_both_ways(page, self._ocr)
        return self._found


def _detect_both_ways(page: GrayImage, engine: DirectionDetector) -> ReadDirection | None:
    """What the engine says of the page (H, W); surer where it says the same, as sure, of the page turned by half.

    That is asked of East Asian print only.

    One of four views of a Chinese page had a confidence of 4, and 10.7 turned by half.
    """
    found = engine.detect_direction(page)
    if found is None or found.script not in EAST_ASIAN_SCRIPTS or found.confidence >= LEAST_SURE_CONFIDENCE:
        return found
    again = engine.detect_direction(np.ascontiguousarray(np.rot90(page, 2)))
    if again is None or again.script != found.script or (again.turned_deg - found.turned_deg) % 360 != 180:
        return found
    return replace(found, confidence=max(found.confidence, again.confidence))


def _decide(
    axes: list["LineReader"],
    mirrorings: tuple[bool, ...],
    engine: _PageDetection | None = None,
    *,
    is_unread: bool = False,
) -> Orientation:
    """Best way among the two turns of each axis in each of `mirrorings`.

    Where few lines hardly read, `engine` is asked before more are, and none are where mirrored ways are tried of what
    `is_unread` otherwise.
    """
    best, confidence = Way(0, False), 0.0
    stages = (
        (FIRST_LINES, CLEAR_SCORE, CLEAR_MARGIN, CLEAR_LETTERS),
        (FEW_LINES, CERTAIN_SCORE, CERTAIN_MARGIN, 0.0),
        (-(-MORE_LINES // len(axes)), CERTAIN_SCORE, CERTAIN_MARGIN, 0.0),
    )
    for lines, least_score, least_margin, least_letters in stages:
        scores: dict[Way, float] = {}
        letters = 0.0
        for axis in axes:
            ways = [Way(axis.turn_deg + half, m) for m in mirrorings for half in (0, 180)]
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


def orient_page(
    photo: RgbImage, analysis: PageAnalysis | None, frame: Frame, ocr: OcrEngine | None
) -> tuple[Orientation, Notice | None]:
    """Orientation of the flat view, and a notice if it is unknown.

    Mostly a line of the analysed text reads evidently; then no page is drawn to look for its lines.
    """
    if analysis is not None and ocr is not None:
        score = evident_line(analysis, frame, ocr)
        if score is not None:
            return Orientation(0, False, math.sqrt(score)), None
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

"""Text beside the outline of a sheet: texture of a desk forms no lines, print does."""

import cv2
import numpy as np

from services.arrays import Mask
from services.geometry.homographies import to_resized
from services.rectify.analysis.page_analysis import PageAnalysis
from services.sheet.outline.results import CERTAIN_CONFIDENCE, SheetOutline
from services.sheet.tracing.level_rows import shows_print

MOST_BESIDE = 0.03
"""Share of the characters beside the sheet up to which they are specks, which disturb nothing."""


def is_texture_beside(analysis: PageAnalysis, outline: SheetOutline | None) -> bool:
    """Whether part of the text of `analysis` is texture beside the certain sheet within `outline`."""
    if outline is None or outline.confidence < CERTAIN_CONFIDENCE:
        return False
    inside = outline.holds(analysis.characters)
    return inside.mean() < 1 - MOST_BESIDE and not _shows_print_beside(analysis, outline)


def is_print_beside(analysis: PageAnalysis, outline: SheetOutline | None) -> bool:
    """Whether most of the text of `analysis` is print beside `outline`: then it is no end of the sheet.

    So may the border of a picture be, with the page's text above and below it.
    """
    if outline is None or 2 * outline.holds(analysis.characters).mean() >= 1:
        return False
    return _shows_print_beside(analysis, outline)


def _shows_print_beside(analysis: PageAnalysis, outline: SheetOutline) -> bool:
    """Whether the ink outside of `outline` lies in lines, along the photo or across it."""
    beside = _ink_beside(analysis, outline)
    return shows_print(beside) or shows_print(np.ascontiguousarray(beside.T))


def _ink_beside(analysis: PageAnalysis, outline: SheetOutline) -> Mask:
    """Ink (H, W) of the text outside of `outline`, in the frame of the analysis."""
    ink = analysis.text.ink.astype(np.uint8)
    corners = np.round(to_resized(outline.polygon, analysis.factor) * 16).astype(np.int32)
    cv2.fillPoly(ink, [corners], 0, shift=4)
    return np.asarray(ink > 0)

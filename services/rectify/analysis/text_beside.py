"""Text beside the outline of a sheet: texture of a desk forms no lines, print does."""

from typing import Literal

import cv2
import numpy as np

from services.arrays import Mask
from services.geometry.homographies import to_resized
from services.rectify.analysis.page_analysis import PageAnalysis
from services.sheet.outline.results import BELIEVED_CONFIDENCE, SheetOutline
from services.sheet.tracing.level_rows import shows_print

MOST_BESIDE = 0.03
"""Share of the characters beside the sheet up to which they are specks, which disturb nothing."""


def text_beside(analysis: PageAnalysis, outline: SheetOutline | None) -> Literal["texture", "print"] | None:
    """What the text of `analysis` outside of `outline` is, where it matters; None where it does not.

    Texture beside a believed sheet is that of a desk. Print is told where it is most of the text: then the outline is
    no end of the sheet. So may the border of a picture be, with the page's text above and below it.
    """
    if outline is None:
        return None
    inside = outline.holds(analysis.characters).mean()
    is_believed = outline.confidence >= BELIEVED_CONFIDENCE and inside < 1 - MOST_BESIDE
    is_most = inside < 0.5
    if not is_believed and not is_most:
        return None
    beside = _ink_beside(analysis, outline)
    if shows_print(beside) or shows_print(np.ascontiguousarray(beside.T)):
        return "print" if is_most else None
    return "texture" if is_believed else None


def _ink_beside(analysis: PageAnalysis, outline: SheetOutline) -> Mask:
    """Ink (H, W) of the text outside of `outline`, in the frame of the analysis."""
    ink = analysis.text.ink.astype(np.uint8)
    corners = np.round(to_resized(outline.polygon, analysis.factor) * 16).astype(np.int32)
    cv2.fillPoly(ink, [corners], 0, shift=4)
    return np.asarray(ink > 0)

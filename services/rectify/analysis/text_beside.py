"""Text beside the outline of a sheet: texture of a desk forms no lines, print does."""

from typing import Literal

import cv2
import numpy as np
from scipy.spatial import cKDTree

from services.arrays import Mask
from services.geometry.homographies import to_resized
from services.geometry.linked_groups import group_linked
from services.rectify.analysis.page_analysis import PageAnalysis
from services.sheet.outline.results import BELIEVED_CONFIDENCE, SheetOutline
from services.sheet.tracing.level_rows import shows_print

FEWEST_ROWS = 3
"""Of print that go on beyond an outline; one or two end in the grain of a desk."""
LONGEST_STEP = 1.6
"""Text heights between the middles of characters of a word, small spaces between words included."""
LEVEL = 0.4
"""Text heights by which neighbours in a row stand above each other."""
LEAST_HELD = 3
"""Characters of such a row on the sheet."""
MOST_BESIDE = 0.03
"""Share of the characters beside the sheet up to which they are specks, which disturb nothing."""


def text_beside(analysis: PageAnalysis, outline: SheetOutline | None) -> Literal["texture", "print"] | None:
    """What the text of `analysis` outside of `outline` is, where it matters; None where it does not.

    Texture beside a believed sheet is that of a desk. Print is told where it stands in rows of its own along the lines
    of the page, or goes on in rows from the sheet: then the outline is no end of the sheet. So may the border of a
    picture be, with the page's text above and below it, that of a fold or of a panel, or that of a shadow.
    """
    if outline is None:
        return None
    inside = outline.holds(analysis.characters).mean()
    is_believed = outline.confidence >= BELIEVED_CONFIDENCE and inside < 1 - MOST_BESIDE
    is_most = inside < 0.5
    if not is_believed and not is_most:
        return None
    if crossing_rows(analysis, outline) >= FEWEST_ROWS:
        return "print"
    beside = _ink_beside(analysis, outline)
    # Rows across the lines of the page are grain of a desk: print beside it is the page's.
    lies = np.abs(np.cos(np.median(analysis.major_field.at(analysis.characters)))) > np.sqrt(0.5)
    if shows_print(beside if lies else np.ascontiguousarray(beside.T)):
        return "print"
    return "texture" if is_believed else None


def crossing_rows(analysis: PageAnalysis, outline: SheetOutline) -> int:
    """Number of rows of characters that go on beyond `outline`: steps along the text's lines lead there."""
    characters, height_px = analysis.characters, analysis.text_height_px
    first, second = cKDTree(characters).query_pairs(LONGEST_STEP * height_px, output_type="ndarray").T
    angles = analysis.major_field.at(characters[first])
    step = characters[second] - characters[first]
    across = np.abs(step[:, 1] * np.cos(angles) - step[:, 0] * np.sin(angles))
    in_row = across < LEVEL * height_px
    row = group_linked(len(characters), first[in_row], second[in_row])
    inside = outline.holds(characters)
    held, beyond = np.bincount(row, inside), np.bincount(row, ~inside)
    return int(np.sum((held >= LEAST_HELD) & (beyond > 0)))


def _ink_beside(analysis: PageAnalysis, outline: SheetOutline) -> Mask:
    """Ink (H, W) of the text outside of `outline`, in the frame of the analysis."""
    ink = analysis.text.ink.astype(np.uint8)
    corners = np.round(to_resized(outline.polygon, analysis.factor) * 16).astype(np.int32)
    cv2.fillPoly(ink, [corners], 0, shift=4)
    return np.asarray(ink > 0)

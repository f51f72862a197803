"""Whether what was taken for the text of a page is text: it forms straight level lines in the page's own view."""

import numpy as np

from services.arrays import Mask
from services.errors import NoText
from services.rectify.analysis.page_analysis import PICTURE_SHARE, PageAnalysis
from services.sheet.evidence import PageEvidence
from services.sheet.outline.results import SheetOutline
from services.sheet.shape import PageShape
from services.sheet.tracing.level_rows import shows_print
from services.sheet.tracing.line_tracing import FEW_LINES, flatten_ink

SHEET_CONFIDENCE = 0.9
"""Confidence of an outline from which on there is a sheet, whatever is on it."""


class LinesAcross(NoText):
    """The text stands in straight rows that cross what was taken for its lines: figures that stand in columns.

    `taken_rad` is the direction in the photo of what was taken for lines.
    """

    def __init__(self, detail: str, taken_rad: float = 0.0) -> None:
        super().__init__(detail)
        self.taken_rad = taken_rad


def check_text(
    analysis: PageAnalysis, evidence: PageEvidence, shape: PageShape, outline: SheetOutline | None
) -> None:
    """Whether the characters of `analysis` are text, or sides of a sheet are seen.

    Raises
    ------
    NoText
        When they are none, and no sheet's sides are seen.
    """
    if shape.sides_believed:
        return
    is_sheet = outline is not None and outline.confidence >= SHEET_CONFIDENCE
    few = analysis.text.rejected_fraction > PICTURE_SHARE and shape.line_count < FEW_LINES
    if few and not (is_sheet and is_level_in_view(evidence, shape)):
        raise NoText(
            f"most of what is printed is no text, and only {shape.line_count} short lines of text were found. "
            "Send region, a polygon round the text, if there is some."
        )
    if shape.ends_at_sides or is_sheet:
        return
    ink = _ink_in_view(evidence, shape)
    if shows_print(ink):
        return
    detail = (
        "what looks like print forms no straight lines, and no sheet's edges are seen. "
        "Send region, a polygon round the text, if there is some."
    )
    if shows_print(np.ascontiguousarray(ink.T)):
        middle = np.median(evidence.characters, axis=0, keepdims=True)
        along = np.linalg.solve(shape.page_map.jacobians(middle)[0], (1.0, 0.0))
        raise LinesAcross(detail, float(np.arctan2(along[1], along[0])))
    raise NoText(detail)


def is_level_in_view(evidence: PageEvidence, shape: PageShape) -> bool:
    """Whether the ink forms straight level lines in the flat view of `shape`."""
    return shows_print(_ink_in_view(evidence, shape))


def _ink_in_view(evidence: PageEvidence, shape: PageShape) -> Mask:
    """The ink (H, W) in the flat view of `shape`."""
    text, view = evidence.text, evidence.view
    height = text.height_px / view.unit_px
    H_reduced_centred = text.H_reduced_centred(view)
    return flatten_ink(text.ink, H_reduced_centred, shape.page_map, evidence.characters, height).ink

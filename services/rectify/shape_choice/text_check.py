"""Whether what was taken for the text of a page is text: it forms straight level lines in the page's own view."""

from services.rectify.analysis.page_analysis import PICTURE_SHARE, PageAnalysis
from services.sheet.evidence import PageEvidence
from services.sheet.outline.results import SheetOutline
from services.sheet.shape import PageShape
from services.sheet.tracing.level_rows import shows_print
from services.sheet.tracing.line_tracing import FEW_LINES, flatten_ink

SHEET_CONFIDENCE = 0.9
"""Confidence of an outline from which on there is a sheet, whatever is on it."""


def refusal_of_text(
    analysis: PageAnalysis, evidence: PageEvidence, shape: PageShape, outline: SheetOutline | None
) -> str | None:
    """Why the characters of `analysis` are no text, if they are none and no sheet's sides are seen; else None."""
    if shape.sides_believed:
        return None
    is_sheet = outline is not None and outline.confidence >= SHEET_CONFIDENCE
    few = analysis.text.rejected_fraction > PICTURE_SHARE and shape.line_count < FEW_LINES
    if few and not (is_sheet and is_level_in_view(evidence, shape)):
        return (
            f"most of what is printed is no text, and only {shape.line_count} short lines of text were found. "
            "Send region, a polygon round the text, if there is some."
        )
    if shape.ends_at_sides or is_sheet or is_level_in_view(evidence, shape):
        return None
    return (
        "what looks like print forms no straight lines, and no sheet's edges are seen. "
        "Send region, a polygon round the text, if there is some."
    )


def is_level_in_view(evidence: PageEvidence, shape: PageShape) -> bool:
    """Whether the ink forms straight level lines in the flat view of `shape`."""
    text, view = evidence.text, evidence.view
    height = text.height_px / view.unit_px
    H_reduced_centred = text.H_reduced_centred(view)
    flat = flatten_ink(text.ink, H_reduced_centred, shape.page_map, evidence.characters, height)
    return shows_print(flat.ink)

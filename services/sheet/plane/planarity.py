"""Planar or curved (dissertation 3.2.2): do the tangents of each flow meet in one point?"""

from typing import Literal

from services.contract.rectify import PageKind
from services.geometry.vanishing_points import FlowVanishingPoints
from services.sheet.evidence import PageEvidence
from services.texture_flow.minor import blur_of_strokes

# Limits of S3/S1 below which the tangent lines count as convergent, the tighter one for the major flow.
MAJOR_LIMIT = 0.010
MINOR_LIMIT = 0.040


def discriminate_surface(points: FlowVanishingPoints, text_height_px: float) -> Literal["planar", "curved"]:
    """Curved when either flow's tangent lines have full rank, else planar.

    `text_height_px` is the size of characters in the photo, which the minor flow's roughness depends on.
    """
    minor_limit = MINOR_LIMIT * blur_of_strokes(text_height_px)
    converges = points.horizontal.convergence <= MAJOR_LIMIT and points.vertical.convergence <= minor_limit
    return "planar" if converges else "curved"


def apparent_kind(evidence: PageEvidence, kind: PageKind) -> Literal["planar", "curved"]:
    """What the flows of a page say, or the `kind` that the client demands."""
    return (
        discriminate_surface(evidence.vanishing_points, evidence.text.height_px) if kind == "auto" else kind
    )

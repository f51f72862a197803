"""Planar or curved (dissertation 3.2.2): do the tangents of each flow meet in one point?"""

from dataclasses import dataclass
from typing import Literal

from services.rectify.planar import FlowVanishingPoints


@dataclass(frozen=True, slots=True)
class SurfaceTestParameters:
    """Limits of S3/S1 below which the tangent lines count as convergent, the tighter one for the major flow."""

    major_limit: float = 0.010
    minor_limit: float = 0.040


def discriminate_surface(
    points: FlowVanishingPoints, parameters: SurfaceTestParameters | None = None
) -> Literal["planar", "curved"]:
    """ "curved" when either flow's tangent lines have full rank, else "planar"."""
    p = parameters or SurfaceTestParameters()
    full_rank = points.horizontal.convergence > p.major_limit or points.vertical.convergence > p.minor_limit
    return "curved" if full_rank else "planar"

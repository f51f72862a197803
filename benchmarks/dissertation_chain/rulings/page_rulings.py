"""All that is known of a page's rulings, from its flow samples and its ink (3.3.3 and 3.3.4 in order)."""

from dataclasses import dataclass

from benchmarks.dissertation_chain.flow_regression import RegressedFlow, regress_flow
from benchmarks.dissertation_chain.rulings.line_profiles import (
    InkImage,
    find_line_edges,
    measure_line_profiles,
)
from benchmarks.dissertation_chain.rulings.projected import detect_projected_rulings
from benchmarks.dissertation_chain.rulings.reference_points import clip_to_hull, keep_dense_text
from benchmarks.dissertation_chain.rulings.results import ProjectedRulings, RulingVanishingPoints
from benchmarks.dissertation_chain.rulings.vanishing_points import estimate_ruling_vanishing_points
from services.arrays import Points
from services.geometry.hulls import text_hull
from services.texture_flow.field import FlowSamples

MAJOR_SIGMA, MINOR_SIGMA = 5.0, 6.0
"""Deviation of the local regression of the flows over the text height: major samples lie three text heights apart,
minor ones are fewer, and the field that they show is stiffer."""


@dataclass(frozen=True, slots=True, eq=False)
class PageRulings:
    """Projected rulings with their vanishing points, and the flows that they were found in."""

    projected: ProjectedRulings
    vanishing_points: RulingVanishingPoints
    major: RegressedFlow
    minor: RegressedFlow | None


def find_page_rulings(
    major: FlowSamples, minor: FlowSamples | None, characters: Points, text_height: float, ink: InkImage
) -> PageRulings:
    """Rulings of a page from its flow samples and `characters` (N, 2), all in centred unit coordinates.

    `text_height` is in the same unit. Finite for any input; `curved` and `deviations` show what is not known.
    """
    major_flow = regress_flow(major, MAJOR_SIGMA * text_height)
    minor_flow = regress_flow(minor, MINOR_SIGMA * text_height) if minor is not None and len(minor) else None
    projected = detect_projected_rulings(
        major_flow.at, characters, None if minor_flow is None else minor_flow.at, major_flow.trust_at
    )
    hull = text_hull(keep_dense_text(characters, 8 * text_height))
    chords = clip_to_hull(hull, projected.points, projected.angles[:, None])
    reach = (float(chords.low.min()), float(chords.high.max()))
    profiles = measure_line_profiles(
        ink, major_flow.at, projected.points, projected.angles, reach, text_height
    )
    vanishing_points = estimate_ruling_vanishing_points(
        find_line_edges(profiles), projected.points, projected.angles
    )
    return PageRulings(projected, vanishing_points, major_flow, minor_flow)

"""How much work a photo is worth: all of it for an answer, little for a preview."""

from dataclasses import dataclass, field

import numpy as np

from services.imaging.paper import PaperParameters
from services.rectify.analysis.found_text import AnalysisParameters
from services.sheet.outline.candidates import CandidateParameters
from services.sheet.outline.detection import OutlineParameters
from services.sheet.outline.rays import RayParameters
from services.texture_flow.major import MajorFlowParameters
from services.texture_flow.minor import MinorFlowParameters

PREVIEW_PX = 1200
"""Least long side of the reduced photo of a preview: letters must be large enough that their blur can be measured."""


@dataclass(frozen=True, slots=True)
class Effort:
    """`analysis` and `outline` say how closely the photo is looked at.

    With `is_brief` the first shape that explains the page is taken: the sides of the sheet before the directions of the
    text, because they are found in less time, and a bent sheet by one short fit. Its view is framed, but not judged,
    read or drawn.
    """

    analysis: AnalysisParameters = field(default_factory=AnalysisParameters)
    outline: OutlineParameters = field(default_factory=OutlineParameters)
    is_brief: bool = False


WHOLE = Effort()
BRIEF = Effort(
    analysis=AnalysisParameters(
        long_side_px=800,
        least_reduction=0.8,
        major=MajorFlowParameters(
            coarse_block=7.0,
            coarse_step_rad=np.deg2rad(7.5),
            fine_step_rad=np.deg2rad(1.2),
            across_sampling=8.0,
            max_samples=250,
            repeats=1,
            field_spacing=4.0,
        ),
        minor=MinorFlowParameters(max_edges=40_000, band_rows=48, band_share=0.5),
        paper=PaperParameters(long_side_px=280),
    ),
    outline=OutlineParameters(
        candidates=CandidateParameters(rays=RayParameters(rays=120, samples=96, max_shift=6), most_cut=0.15),
        improved=False,
        tried=1,
        well_rated=0.55,
        least_rating=0.5,
        most_cut=0.1,
    ),
    is_brief=True,
)
"""Print of 10 points on a full page is 5 px high then, enough to be found. The lines of a page have few bends, so that
fewer windows show their directions; the strokes' directions need all of their blocks, but not all edges. To reduce the
photo for strokes by a factor near 1 takes more time than it saves."""

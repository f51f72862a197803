"""The dissertation's way to a curved page's shape: rulings, their vanishing points, planar strips (3.3.3 to 3.3.6).

Rectification does not need it: the global surface (`curved_page`) starts from flat sheets and is as straight without.
The benchmarks print its tables.
"""

from dataclasses import dataclass

import numpy as np

from benchmarks.dissertation_chain.rulings.line_profiles import InkImage
from benchmarks.dissertation_chain.rulings.page_rulings import PageRulings, find_page_rulings
from benchmarks.dissertation_chain.strips.evidence import gather_evidence
from benchmarks.dissertation_chain.strips.initial import FocalKnowledge
from benchmarks.dissertation_chain.strips.results import StripShape
from benchmarks.dissertation_chain.strips.shape import estimate_strip_shape
from benchmarks.dissertation_chain.strips.view import unroll_strips
from services.geometry.focal_prior import FocalPrior
from services.geometry.page_map import PageMap
from services.geometry.photo_frame import PhotoFrame
from services.sheet.evidence import PageEvidence
from services.sheet.surfaces import StripsSurface


@dataclass(frozen=True, slots=True, eq=False)
class StripPage:
    """Rulings and strips of a page in centred unit coordinates; `page_map` is None when the strips make no page."""

    rulings: PageRulings
    shape: StripShape
    page_map: PageMap | None

    def surface(self, view: PhotoFrame) -> StripsSurface:
        """The strips in photo pixels."""
        shape = self.shape
        return StripsSurface(
            np.asarray(shape.normals, np.float64),
            np.asarray(shape.reference_points * view.unit_px + view.centre, np.float64),
            np.asarray(shape.ruling_angles, np.float64),
            np.asarray(shape.vanishing_points @ view.H_photo_centred.T, np.float64),
        )


def find_strips(evidence: PageEvidence, prior: FocalPrior) -> StripPage | None:
    """Strips of the page; None where its text shows none."""
    e, text, view, characters = evidence, evidence.text, evidence.view, evidence.characters
    x, y = (np.array(view.centre) + 0.5) * text.factor - 0.5
    ink = InkImage(text.ink.astype(np.float32), view.unit_px * text.factor, (float(x), float(y)))
    rulings = find_page_rulings(e.major, e.strokes, characters, text.height_px / view.unit_px, ink)
    try:
        seen = gather_evidence(
            rulings.projected, rulings.vanishing_points, rulings.major, rulings.minor, characters
        )
    except ValueError:
        return None  # fewer than two rulings cross the text
    knowledge = FocalKnowledge(prior.log_focal, prior.deviation, prior.source in ("given", "exif"))
    shape = estimate_strip_shape(seen, knowledge)
    return StripPage(rulings, shape, unroll_strips(seen, shape.normals, shape.focal, characters))

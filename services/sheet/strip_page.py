"""The dissertation's way to a curved page's shape: rulings, their vanishing points, planar strips (3.3.3 to 3.3.6)."""

from dataclasses import dataclass

import numpy as np

from services.arrays import Floats, Points, Vector
from services.geometry.focal_prior import FocalPrior
from services.geometry.page_map import PageMap
from services.geometry.photo_frame import PhotoFrame
from services.sheet.evidence import PageEvidence
from services.sheet.rulings.line_profiles import InkImage
from services.sheet.rulings.page_rulings import PageRulings, find_page_rulings
from services.sheet.strips.evidence import gather_evidence
from services.sheet.strips.initial import FocalKnowledge
from services.sheet.strips.results import StripShape
from services.sheet.strips.shape import estimate_strip_shape
from services.sheet.strips.view import unroll_strips
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


@dataclass(frozen=True, slots=True, eq=False)
class BentSheet:
    """Strips as a sheet that is bent smoothly along one direction, seen from its middle.

    `rotation` (3, 3) has the text's axes and the normal at the middle strip as columns, `skew_rad` leads from the
    a-axis (across the rulings) to the text; `bends` (n,) is the curvature at `places` (n,) of the a-axis, in units of
    the depth of the `anchor`.
    """

    rotation: Floats
    anchor: Points
    focal: float
    skew_rad: float
    places: Vector
    bends: Vector


def bend_of_strips(page: StripPage) -> BentSheet:
    """The sheet that the strips approximate: N' = k A along the a-axis, A = R x N across the mean ruling R."""
    shape = page.shape
    N, P, f = shape.normals, shape.reference_points_3d, shape.focal
    middle = len(N) // 2
    R = shape.vanishing_points * [1.0, 1.0, f]
    R = R / np.linalg.norm(R, axis=1, keepdims=True)
    R = R * np.sign(R[:, 1:2] + 1e-12)
    ruling = R.mean(axis=0) - N[middle] * (R.mean(axis=0) @ N[middle])
    B = ruling / np.linalg.norm(ruling)
    A = np.cross(B, N[middle])
    # Scale: the a-axis is measured where the page's unit is the photo's, at the middle strip.
    centre = 0.5 * (P[middle] + P[middle + 1])
    unit = f / centre[2]
    steps = unit * np.linalg.norm(np.cross(np.diff(P, axis=0), B), axis=1)
    edges = np.concatenate([[0.0], np.cumsum(steps)])
    edges = edges - 0.5 * (edges[middle] + edges[middle + 1])
    angle = np.unwrap(np.arctan2(N @ A, N @ N[middle]))
    places = edges[1:-1]
    apart = 0.5 * (steps[1:] + steps[:-1])
    anchor = f * centre[:2] / centre[2]
    # The text's direction at the middle: the major flow there, laid on the strip.
    angle_photo = float(page.rulings.major.at(anchor[None])[0])
    t = np.array([np.cos(angle_photo), np.sin(angle_photo), 0.0])
    sight = np.array([*anchor, f])
    U = np.cross(np.cross(t, sight), N[middle])
    U = U / np.linalg.norm(U) * (1.0 if U[0] >= 0 else -1.0)
    V = np.cross(N[middle], U)
    skew = float(np.arctan2(U @ B, U @ A))
    return BentSheet(
        np.stack([U, V, N[middle]], axis=1), anchor, f, skew, places, np.diff(angle) / np.maximum(apart, 1e-6)
    )

"""Choice of a page's shape: a plane, a bent sheet, or a creased one."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np

from services.contract.rectify import PageKind
from services.geometry.focal_prior import FocalPrior
from services.geometry.page_map import PageMap
from services.geometry.photo_frame import PhotoFrame
from services.notices import Notice
from services.rectify.shape_choice.text_check import FEW_LINES
from services.sheet.curved_page import CurvedPage, estimate_curved_page
from services.sheet.evidence import PageEvidence
from services.sheet.outline.results import SheetOutline
from services.sheet.plane.outline_plane import SheetSides
from services.sheet.plane.planar_page import PlanarPage
from services.sheet.plane.planarity import apparent_kind
from services.sheet.plane.pose import choose_pose
from services.sheet.ridged_page import (
    RidgedPage,
    estimate_ridged_page,
    sides_bend,
    sides_crease,
)
from services.sheet.shape import NoShape, PageShape
from services.sheet.straight_sides import straighten_sides
from services.sheet.tracing.line_tracing import measure_bend, measure_straightness, trace_by_characters
from services.sheet.tracing.profile_tracing import trace_by_profiles

STRAIGHT = 0.04
"""RMS deviation of text lines from straight ones, in text heights, that flat pages have too; it is not visible."""
VISIBLE_BEND = 0.2
"""RMS distance of text lines in the photo from straight ones, in text heights, from which on no plane is tried where a
bent sheet straightens them."""
STRAIGHT_SIDE = 0.003
"""RMS bend of a sheet's side, as a share of its size, up to which it counts as straight."""
SMOOTH_SIDE = 0.001
"""RMS distance of a side from a smooth curve, as a share of the sheet's size, up to which it has no kinks."""
FLAT_SIDE = 0.008
"""RMS bend of a side on the flat page, as a share of its length, up to which a smooth surface explains it."""
RIGHT_ANGLE_RAD = 0.02
"""Difference between the directions of the sides on the flat page, up to quarter turns, up to which a smooth surface
explains them: cylinders and cones leave 0.002 to 0.018, crumpled sheets up to 0.05."""
CERTAIN_OUTLINE = 0.95
"""Confidence from which on 99 % of the outlines are right."""
CURVED_GAIN = 0.7
"""A bent sheet must bring the lines' deviation below this share of the plane's."""
FLOW_GAIN = 0.4
"""Where the lines are straight already, a bent sheet must bring the deviation of the flows below this share of the
plane's: flows of sparse print are unreliable."""


def choose_shape(
    evidence: PageEvidence,
    prior: FocalPrior,
    kind: PageKind,
    outline: SheetOutline | None = None,
    sheet: SheetSides | None = None,
) -> PageShape:
    """Choose the simplest shape that the evidence supports: a plane, unless a bent or creased sheet explains more.

    A bent sheet is tried if the flows do not converge (3.2.2), or if the plane leaves text lines or sides of the sheet
    bent. It is chosen if it leaves them clearly straighter. The mesh of a creased sheet needs the sides: it is tried
    where these are seen and have kinks, or where the smooth surface leaves them bent.

    Parameters
    ----------
    evidence
        Text, flows and text lines.
    prior
        Of the focal length.
    kind
        "planar" or "curved" as the client demands, or "auto".
    outline
        Outline of the sheet in the photo, if it was found.
    sheet
        Its straight sides as evidence for a plane.

    Returns
    -------
    PageShape
        Its notices say too why no other was chosen although the page seems to have it.
    """
    seems = apparent_kind(evidence, kind)
    found = _Hypotheses(evidence, prior, seems, outline, sheet)
    if kind == "planar":
        return found.plane
    bent_sides = outline is not None and sides_bend(outline) > STRAIGHT_SIDE
    # Four straight sides and straight lines are those of a plane, even if sparse flows contradict.
    if (
        kind == "auto"
        and not bent_sides
        and (seems == "planar" or sheet is not None)
        and found.plane_straightness < STRAIGHT
        and (seems == "planar" or found.plane.sides_believed)
    ):
        return found.plane
    bent = _choose_bent_shape(found, forced=kind == "curved")
    if bent is not None:
        return bent
    plane = found.plane
    if seems == "planar" or plane.sides_believed:
        return plane
    why = f"is not plausible ({found.refusal})" if found.refusal else "does not explain its text better"
    said = f"the page seems curved, but a bent sheet {why}; this is its best planar view."
    return replace(plane, notices=(Notice("curved-page", said), *plane.notices))


@dataclass(eq=False)
class _Hypotheses:
    """The shapes that a page may have, each fitted when it is first asked for: a page that is clearly bent needs no
    plane."""

    evidence: PageEvidence
    prior: FocalPrior
    seems: Literal["planar", "curved"]
    outline: SheetOutline | None
    sheet: SheetSides | None
    refusal: str = ""

    @cached_property
    def plane(self) -> PlanarPage:
        """The plane that fits best."""
        return choose_pose(self.evidence, self.prior, self.seems, sheet=self.sheet)

    @cached_property
    def plane_straightness(self) -> float:
        """That of the lines in the plane's view, in text heights."""
        lines, page_map = self.plane.lines, self.plane.page_map
        if lines is None:
            lines = trace_by_characters(self.evidence.text, self.evidence.view, page_map)
        return measure_straightness(page_map, lines)

    @cached_property
    def curved(self) -> CurvedPage | None:
        """The bent sheet that fits best; None if none is plausible, and `refusal` says why."""
        found = estimate_curved_page(self.evidence, self.prior)
        if isinstance(found, NoShape):
            self.refusal = found.reason
            return None
        return found

    @cached_property
    def ridged(self) -> RidgedPage | None:
        """The creased sheet within the outline, if there is one."""
        found = None if self.outline is None else ridged_page(self.evidence, self.prior, self.outline)
        return None if isinstance(found, NoShape) else found

    def straightness_by_profiles(self, page_map: PageMap) -> float:
        """That of lines traced by profiles of darkness, as the creased sheet's are, in text heights."""
        lines = trace_by_profiles(self.evidence.text, self.evidence.view, page_map)
        return measure_straightness(page_map, lines)


def _choose_bent_shape(found: _Hypotheses, *, forced: bool) -> PageShape | None:
    """The bent or creased sheet that explains clearly more than the plane; with `forced`, any plausible one."""
    outline = found.outline
    if outline is not None and sides_crease(outline) < SMOOTH_SIDE:
        curved = found.curved
        if (
            curved is not None
            and straightens_sides(curved, outline, found.evidence.view)
            and (forced or _explains_more(curved, found))
        ):
            return with_straight_sides(curved, outline, found.evidence)
    ridged = found.ridged
    if ridged is not None and outline is not None:
        # The outline may be that of a stack of pages or of a picture, so text decides.
        curved = found.curved if outline.confidence < CERTAIN_OUTLINE else None
        if (
            curved is not None
            and _explains_more(curved, found)
            and ridged.line_straightness > CURVED_GAIN * found.straightness_by_profiles(curved.page_map)
        ):
            return curved
        if forced or sides_bend(outline) > STRAIGHT_SIDE:
            return ridged
        # The mesh was measured on lines that were traced by profiles; so the plane is measured on them too.
        if ridged.line_straightness < CURVED_GAIN * found.straightness_by_profiles(found.plane.page_map):
            return ridged
    curved = found.curved
    return curved if curved is not None and (forced or _explains_more(curved, found)) else None


def straightens_sides(curved: CurvedPage, outline: SheetOutline, view: PhotoFrame) -> bool:
    """Whether the sheet's sides are straight and at right angles on the flat page of `curved`, as on paper."""
    directions: list[float] = []
    for side in outline.sides:
        page = curved.page_map.to_page(view.to_centred(side.points))
        known = np.isfinite(page).all(axis=1)
        if len(page) < 8:
            continue
        if known.mean() < 0.8:
            return False
        _, spread, axes = np.linalg.svd(page[known] - page[known].mean(axis=0), full_matrices=False)
        if spread[1] > FLAT_SIDE * np.sqrt(12.0) * spread[0]:
            return False
        directions.append(float(np.arctan2(axes[0, 1], axes[0, 0])))
    # Print may be askew on its sheet: only the angles between the sides count, up to quarter turns.
    quadruple = 4 * np.array(directions)
    mean = np.angle(np.exp(1j * quadruple).sum()) if directions else 0.0
    turns = np.angle(np.exp(1j * (quadruple - mean))) / 4
    return bool(np.ptp(turns) < RIGHT_ANGLE_RAD) if directions else True


def with_straight_sides(curved: CurvedPage, outline: SheetOutline, e: PageEvidence) -> CurvedPage:
    """`curved` with margins corrected by the bends that it leaves in the sides of the sheet."""
    if outline.confidence < CERTAIN_OUTLINE:
        return curved
    top, right, bottom, left = (e.view.to_centred(side.points) for side in outline.sides)
    straight = straighten_sides(curved.page_map, (top, right, bottom, left), e.characters)
    return replace(curved, page_map=straight)


def ridged_page(e: PageEvidence, prior: FocalPrior, outline: SheetOutline) -> RidgedPage | NoShape:
    """The creased sheet within `outline`, refined by the page's text."""
    double = 2 * e.major.angles
    direction = 0.5 * float(np.arctan2(e.major.weights @ np.sin(double), e.major.weights @ np.cos(double)))
    return estimate_ridged_page(
        outline,
        e.view,
        prior,
        direction,
        lambda page: trace_by_profiles(e.text, e.view, page),
        e.strokes,
        e.major,
    )


def _explains_more(curved: CurvedPage, found: _Hypotheses) -> bool:
    """Whether the bent sheet leaves clearly straighter lines than the plane.

    If the plane leaves them straight, or there are too few lines, the flows must decide clearly.
    """
    enough = curved.line_count >= FEW_LINES // 2
    # Every plane leaves at least this much: it maps straight lines to straight lines.
    bend = measure_bend(curved.lines)
    if enough and bend > VISIBLE_BEND and curved.line_straightness < CURVED_GAIN * bend:
        return True
    if found.plane_straightness < STRAIGHT or not enough:
        return not found.plane.sides_believed and curved.deviation < FLOW_GAIN * found.plane.deviation
    straighter = curved.line_straightness < CURVED_GAIN * found.plane_straightness
    return straighter and curved.deviation < found.plane.deviation

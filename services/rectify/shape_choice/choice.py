"""Choice of a page's shape: a plane, a bent sheet, or a creased one."""

from dataclasses import replace
from functools import cached_property
from typing import Literal

import numpy as np

from services.contract.rectify import PageKind
from services.geometry.focal_prior import FocalPrior
from services.geometry.page_map import PlaneMap
from services.geometry.photo_frame import PhotoFrame
from services.notices import Notice
from services.sheet.curved_page import CurvedPage, NoSheet, estimate_curved_page
from services.sheet.evidence import PageEvidence
from services.sheet.outline.results import SheetOutline
from services.sheet.plane.outline_plane import SheetSides
from services.sheet.plane.planarity import discriminate_surface
from services.sheet.plane.pose import EXIF_CONTRADICTED, PagePose, choose_pose
from services.sheet.ridged_page import (
    NoRidgedPage,
    RidgedPage,
    estimate_ridged_page,
    sides_bend,
    sides_crease,
)
from services.sheet.straight_sides import straighten_sides
from services.sheet.tracing.line_tracing import measure_bend, measure_straightness, trace_by_characters
from services.sheet.tracing.profile_tracing import trace_by_profiles

FEW_LINES = 10
"""Fewer lines show little of a page's shape."""
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
) -> tuple[PagePose | CurvedPage | RidgedPage, tuple[Notice, ...]]:
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
    shape : PagePose, CurvedPage or RidgedPage
    notices : tuple of Notice
        Why a shape was not chosen although the page seems to have it.
    """
    seems: Literal["planar", "curved"] = (
        discriminate_surface(evidence.vanishing_points, evidence.text.height_px) if kind == "auto" else kind
    )
    flat = _BestPlane(evidence, prior, seems, sheet)
    if kind == "planar":
        return flat.pose, flat.pose.notices
    bent_sides = outline is not None and sides_bend(outline) > STRAIGHT_SIDE
    # Four straight sides and straight lines are those of a plane, even if sparse flows contradict.
    if (
        kind == "auto"
        and not bent_sides
        and (seems == "planar" or sheet is not None)
        and flat.straightness < STRAIGHT
        and (seems == "planar" or flat.pose.sides_believed)
    ):
        return flat.pose, flat.pose.notices
    bent = _choose_bent_shape(evidence, prior, flat, outline, forced=kind == "curved")
    if isinstance(bent, CurvedPage | RidgedPage):
        contradicted = isinstance(bent, CurvedPage) and bent.exif_contradicted
        return bent, (EXIF_CONTRADICTED,) if contradicted else ()
    pose = flat.pose
    if seems == "planar" or pose.sides_believed:
        return pose, pose.notices
    return pose, (why_not_bent(bent), *pose.notices)


class _BestPlane:
    """The plane that fits best, fitted when it is first asked for: a page that is clearly bent needs none."""

    def __init__(
        self,
        evidence: PageEvidence,
        prior: FocalPrior,
        seems: Literal["planar", "curved"],
        sheet: SheetSides | None,
    ) -> None:
        self._evidence, self._prior, self._seems, self._sheet = evidence, prior, seems, sheet

    @cached_property
    def pose(self) -> PagePose:
        return choose_pose(self._evidence, self._prior, self._seems, sheet=self._sheet)

    @cached_property
    def page_map(self) -> PlaneMap:
        return PlaneMap(np.linalg.inv(self._evidence.view.H_photo_centred) @ self.pose.H_photo_plane)

    @cached_property
    def straightness(self) -> float:
        """That of the lines in the plane's view, in text heights."""
        lines = self.pose.lines
        if lines is None:
            lines = trace_by_characters(self._evidence.text, self._evidence.view, self.page_map)
        return measure_straightness(self.page_map, lines)


def _choose_bent_shape(
    e: PageEvidence, prior: FocalPrior, flat: _BestPlane, outline: SheetOutline | None, *, forced: bool
) -> CurvedPage | RidgedPage | NoSheet | None:
    """The bent or creased sheet that explains clearly more than the plane `flat`.

    With `forced`, any plausible one. Else the reason why none is plausible, or None if one is but explains no more.
    """
    curved: CurvedPage | NoSheet | None = None
    if outline is not None and sides_crease(outline) < SMOOTH_SIDE:
        curved = estimate_curved_page(e, prior)
        if (
            isinstance(curved, CurvedPage)
            and straightens_sides(curved, outline, e.view)
            and (forced or _explains_more(curved, flat))
        ):
            return with_straight_sides(curved, outline, e)
    ridged = None if outline is None else ridged_page(e, prior, outline)
    if isinstance(ridged, RidgedPage) and outline is not None and outline.confidence < CERTAIN_OUTLINE:
        # The outline may be that of a stack of pages or of a picture, so text decides.
        curved = curved or estimate_curved_page(e, prior)
        if isinstance(curved, CurvedPage) and _explains_more(curved, flat):
            smooth = measure_straightness(curved.page_map, trace_by_profiles(e.text, e.view, curved.page_map))
            if ridged.line_straightness > CURVED_GAIN * smooth:
                return curved
    if isinstance(ridged, RidgedPage) and outline is not None:
        if forced or sides_bend(outline) > STRAIGHT_SIDE:
            return ridged
        # The mesh was measured on lines that were traced by profiles; so the plane is measured on them too.
        plane = flat.page_map
        by_profiles = measure_straightness(plane, trace_by_profiles(e.text, e.view, plane))
        if ridged.line_straightness < CURVED_GAIN * by_profiles:
            return ridged
    if curved is None:
        curved = estimate_curved_page(e, prior)
    if isinstance(curved, NoSheet):
        return curved
    return curved if forced or _explains_more(curved, flat) else None


def why_not_bent(bent: NoSheet | None) -> Notice:
    """Notice about a page that seems bent and is flattened as a plane."""
    reason = (
        f"a bent sheet is not plausible ({bent.reason})"
        if isinstance(bent, NoSheet)
        else "a bent sheet does not explain its text better"
    )
    return Notice("curved-page", f"the page seems curved, but {reason}; this is its best planar view.")


def straightens_sides(curved: CurvedPage, outline: SheetOutline, view: PhotoFrame) -> bool:
    """Whether the sheet's sides are straight and at right angles on the flat page of `curved`, as on paper."""
    directions: list[float] = []
    for side in outline.sides:
        page = curved.page_map.to_page((side.points - view.centre) / view.unit_px)
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
    top, right, bottom, left = (
        np.asarray((side.points - e.view.centre) / e.view.unit_px) for side in outline.sides
    )
    straight = straighten_sides(curved.page_map, (top, right, bottom, left), e.characters)
    return replace(curved, page_map=straight)


def ridged_page(e: PageEvidence, prior: FocalPrior, outline: SheetOutline) -> RidgedPage | NoRidgedPage:
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


def _explains_more(curved: CurvedPage, flat: _BestPlane) -> bool:
    """Whether the bent sheet leaves clearly straighter lines than the plane `flat`.

    If the plane leaves them straight, or there are too few lines, the flows must decide clearly.
    """
    enough = curved.line_count >= FEW_LINES // 2
    # Every plane leaves at least this much: it maps straight lines to straight lines.
    bend = measure_bend(curved.lines)
    if enough and bend > VISIBLE_BEND and curved.line_straightness < CURVED_GAIN * bend:
        return True
    if flat.straightness < STRAIGHT or not enough:
        return not flat.pose.sides_believed and curved.deviation < FLOW_GAIN * flat.pose.deviation
    straighter = curved.line_straightness < CURVED_GAIN * flat.straightness
    return straighter and curved.deviation < flat.pose.deviation

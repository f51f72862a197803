"""Choice of a page's shape: a plane, a smooth sheet or a creased one compete, and are asked the same questions.

How straight are the lines in their view, how straight and at right angles are the sides of the sheet, how far are the
flows off? What is not known is NaN, and decides nothing: comparisons with it are false.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from services.contract.rectify import PageKind
from services.geometry.focal_prior import FocalPrior
from services.notices import Notice
from services.rectify.shape_choice.hypotheses import STRAIGHT_SIDE, Hypotheses
from services.sheet.curved_page import CurvedPage
from services.sheet.evidence import PageEvidence
from services.sheet.outline.results import SheetOutline
from services.sheet.plane.outline_plane import SheetSides
from services.sheet.plane.planarity import apparent_kind
from services.sheet.ridged_page import RidgedPage
from services.sheet.shape import PageShape
from services.sheet.tracing.line_tracing import (
    FEW_LINES,
    NO_WORSE,
    STRAIGHT,
    left_by_bends,
    measure_bend,
    measure_straightness,
)

VISIBLE_BEND = 0.2
"""RMS distance of text lines in the photo from straight ones, in text heights, from which on no plane is tried where a
bent sheet straightens them."""
STRAIGHT_SIDES = 0.0002
"""RMS distance of the sides from straight ones, as a share of the sheet's size, up to which a sheet is smooth where its
lines are straight: most smooth sheets leave 0.00002 to 0.0002, those folded in thirds 0.0002 to 0.0018, crumpled and
crossed ones 0.0007 to 0.03."""
CURVED_GAIN = 0.7
"""A bent sheet must bring the deviation of lines or sides below this share of the plane's."""
SMOOTH_SIDES = 0.001
"""The same, from which on a sheet is not smooth."""
PLANE_SIDES = 0.5
"""Every plane leaves more than this share of the bend that the sides have in the photo: it maps straight lines to
straight lines. Of 30 sheets planes left 0.8 to 3.1 times it."""
CREASED_GAIN = 0.5
"""The creased sheet must bring the product of both below this share of a smooth sheet's, and must not
leave its lines less straight by more than tracing them twice does."""
FLOW_GAIN = 0.4
"""Where the lines are straight already, a bent sheet must bring the deviation of the flows below this share of the
plane's: flows of sparse print are unreliable."""


def rank_shapes(
    evidence: PageEvidence,
    prior: FocalPrior,
    kind: PageKind,
    outline: SheetOutline | None = None,
    sheet: SheetSides | None = None,
) -> Iterator[PageShape]:
    """Yield the plausible shapes, the best one first; each is fitted when it is asked for.

    The simplest shape that explains the page is the best: a plane unless a bent sheet explains clearly more, a smooth
    sheet unless a creased one does. Its notices say too why no other was chosen although the page seems to have it.

    Parameters
    ----------
    evidence
        Text, flows and text lines.
    prior
        Of the focal length.
    kind
        "planar" (then there is only the plane) or "curved" as the client demands, or "auto".
    outline
        Outline of the sheet in the photo, if it was found.
    sheet
        Its straight sides as evidence for a plane.
    """
    found = Hypotheses(evidence, prior, apparent_kind(evidence, kind), outline, sheet)
    if kind == "planar":
        yield found.plane
        return
    best = None if kind == "auto" and _is_flat(found) else _choose_bent(found, forced=kind == "curved")
    yield best or _with_doubt(found)
    if best is None and found.rigid:
        return
    if best is not found.smooth and found.smooth is not None:
        yield found.smooth
    if best is not None:
        yield found.plane
    if not isinstance(best, RidgedPage) and found.creased is not None:
        yield found.creased


def _is_flat(found: Hypotheses) -> bool:
    """Whether nothing speaks against a plane: four straight sides, straight lines, even if sparse flows contradict."""
    if found.bent_sides or (found.seems == "curved" and found.sheet is None):
        return False
    level = found.plane_lines.count == 0 or found.plane_straightness < STRAIGHT
    if found.rigid and found.plane_straightness >= STRAIGHT:
        # No fit is needed to see that a bent sheet would not straighten them.
        level = left_by_bends(found.plane.page_map, found.plane_lines) > CURVED_GAIN
    return level and (found.seems == "planar" or found.plane.sides_believed)


def _with_doubt(found: Hypotheses) -> PageShape:
    """The plane, and what is said where the page seems to be bent."""
    plane = found.plane
    if found.seems == "planar" or found.plane_by_sides:
        return plane
    why = f"is not plausible ({found.refusal})" if found.refusal else "does not explain its text better"
    said = f"the page seems curved, but a bent sheet {why}; this is its best planar view."
    # "Already flat" would say the contrary.
    others = (notice for notice in plane.notices if notice.code != "already-flat")
    return replace(plane, notices=(Notice("curved-page", said), *others))


def _choose_bent(found: Hypotheses, *, forced: bool) -> PageShape | None:
    """The bent sheet that explains clearly more than the plane; with `forced`, any plausible one."""
    smooth = found.smooth
    if smooth is None and not (found.certain_outline and _ends_at_sides_better(found)):
        smooth = found.smooth_by_text
    if smooth is not None and _text_contradicts_sides(smooth, found):
        smooth = found.smooth_by_text
    if smooth is not None and _is_smooth(smooth, found):
        return smooth if forced or _explains_more(smooth, found) else None
    creased = found.creased
    needed = creased is not None and (smooth is None or _needs_creases(creased, smooth, found))
    if creased is not None and needed and (forced or found.bent_sides or _straighter(creased, found)):
        return creased
    return smooth if smooth is not None and (forced or _explains_more(smooth, found)) else None


def _ends_at_sides_better(found: Hypotheses) -> bool:
    """Whether the creased sheet has straighter sides than the smooth one that its text alone shows."""
    creased, by_text = found.creased, found.smooth_by_text
    if creased is None or by_text is None:
        return creased is not None
    return found.sides_of(creased.page_map) < found.sides_of(by_text.page_map)


def _is_smooth(smooth: CurvedPage, found: Hypotheses) -> bool:
    """Whether no crease is left to be explained: sides and lines are as straight as smooth sheets leave them."""
    if found.outline is None:
        return True
    return found.sides_of(smooth.page_map) < STRAIGHT_SIDES and not smooth.line_straightness > STRAIGHT


def _text_contradicts_sides(smooth: CurvedPage, found: Hypotheses) -> bool:
    """Whether text alone leaves clearly straighter lines than text and sides together: the outline is no sheet's."""
    if found.outline is None or found.certain_outline or not smooth.line_straightness >= STRAIGHT:
        return False
    by_text = found.smooth_by_text
    return by_text is not None and by_text.line_straightness < CURVED_GAIN * measure_straightness(
        smooth.page_map, by_text.lines
    )


def _needs_creases(creased: RidgedPage, smooth: CurvedPage, found: Hypotheses) -> bool:
    """Whether the creased sheet explains clearly more than the smooth one, by sides and by lines.

    Lines are traced in the views of both: neither was fitted to those of the other. Where the smooth sheet leaves the
    sides bent, the sheet is not smooth, and the better one is right.
    """
    by_sides, gain = found.sides_of(creased.page_map) / found.sides_of(smooth.page_map), 1.0
    if not len(smooth.edges.points):
        # The sides may be those of a stack of pages, and then say nothing.
        by_sides, gain = by_sides if found.believed_outline else 1.0, CURVED_GAIN
    elif found.sides_of(smooth.page_map) < SMOOTH_SIDES:
        gain = CREASED_GAIN
    traced = False
    for shape in (smooth, creased):
        lines = found.profiles_in(shape)
        by_lines = measure_straightness(creased.page_map, lines) / measure_straightness(
            smooth.page_map, lines
        )
        if np.isnan(by_lines):
            continue
        traced = True
        # The lines that speak against it decide: where one view's do, those of the other are not asked.
        if not (by_lines < NO_WORSE and by_lines * by_sides < gain):
            return False
    return traced or by_sides < gain


def _straighter(creased: RidgedPage, found: Hypotheses) -> bool:
    """Whether the creased sheet leaves clearly straighter lines than the plane, both as profiles show them."""
    plane = found.plane
    return creased.line_straightness < CURVED_GAIN * measure_straightness(
        plane.page_map, found.profiles_in(plane)
    )


def _explains_more(smooth: CurvedPage, found: Hypotheses) -> bool:
    """Whether the smooth sheet leaves clearly straighter lines or sides than the plane.

    If the plane leaves them straight, or there are too few lines, the flows must decide clearly.
    """
    enough = smooth.line_count >= FEW_LINES // 2
    # Every plane leaves at least this much: it maps straight lines to straight lines.
    bend = measure_bend(smooth.lines)
    if enough and bend > VISIBLE_BEND and smooth.line_straightness < CURVED_GAIN * bend:
        return True
    sides = found.sides_of(smooth.page_map) if found.bent_sides else np.nan
    clearly = sides < CURVED_GAIN * PLANE_SIDES * found.bend_of_sides
    # The outline may be that of a stack of pages: a smooth sheet is believed against it where its sides are straight.
    if sides < STRAIGHT_SIDE and (clearly or sides < CURVED_GAIN * found.sides_of(found.plane.page_map)):
        left = CURVED_GAIN * smooth.line_straightness
        # The plane's lines are traced only where it matters how straight they are.
        if not left > STRAIGHT or left <= found.plane_straightness:
            return True
    if not enough or not found.plane_straightness >= STRAIGHT:
        return not found.plane.sides_believed and smooth.deviation < FLOW_GAIN * found.plane.deviation
    straighter = smooth.line_straightness < CURVED_GAIN * found.plane_straightness
    return straighter and smooth.deviation < found.plane.deviation

"""The hypothesis that comes next where a page's shape leaves its view bent."""

from dataclasses import replace

from services.contract.rectify import PageKind
from services.rectify.shape_choice.choice import choose_shape, ridged_page, with_straight_sides
from services.rectify.shape_choice.shaped_page import ShapedPage
from services.sheet.curved_page import estimate_curved_page
from services.sheet.plane.outline_plane import read_sides
from services.sheet.shape import NoShape, PageShape


def next_shape(page: ShapedPage, kind: PageKind) -> ShapedPage | None:
    """`page` by its next-best shape of the `kind` that was asked for; None where there is no other.

    After a creased sheet comes a smooth one, after a smooth one a creased one or else a plane, after a plane any bent
    sheet.
    """
    shape = _next(page, kind)
    if shape is None or type(shape) is type(page.shape):
        return None
    kept = tuple(notice for notice in page.notices if notice not in page.shape.notices)
    return replace(page, shape=shape, notices=(*kept, *shape.notices))


def _next(page: ShapedPage, kind: PageKind) -> PageShape | None:
    if page.analysis is None or page.prior is None:
        return None
    evidence, prior, outline = page.analysis.evidence(page.view), page.prior, page.outline
    sheet = read_sides(outline, page.view, prior)
    if page.shape.kind == "planar":
        return None if kind == "planar" else choose_shape(evidence, prior, "curved", outline, sheet)
    if page.shape.ends_at_sides:
        curved = estimate_curved_page(evidence, prior)
        if not isinstance(curved, NoShape):
            return curved if outline is None else with_straight_sides(curved, outline, evidence)
    elif outline is not None:
        ridged = ridged_page(evidence, prior, outline)
        if not isinstance(ridged, NoShape):
            return ridged
    return None if kind == "curved" else choose_shape(evidence, prior, "planar", outline, sheet)

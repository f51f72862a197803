"""A page whose corners a person gave: its shape between them, refined by its text."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import chain

import numpy as np

from services.arrays import Points
from services.contract.rectify import PageKind
from services.geometry.focal_prior import FocalPrior
from services.geometry.hulls import corner_turns
from services.geometry.photo_frame import PhotoFrame
from services.geometry.planar import PagePlane
from services.rectify.shape_choice.shaped_page import ShapedPage
from services.rectify.shape_choice.textless import BENT, STRAIGHT_SIDE, planar_page
from services.sheet.outline.given_corners import with_straight_sides
from services.sheet.outline.results import SheetOutline
from services.sheet.plane.outline_plane import read_sides
from services.sheet.plane.planar_page import PlanarPage
from services.sheet.plane.pose import ASPECT_DEVIATION, aspect_uncertain
from services.sheet.ridged_page import estimate_ridged_page, sides_bend
from services.sheet.shape import NoShape

UNKNOWN_ASPECT = 0.2
"""Standard deviation of the logarithm of the aspect of four corners that no usual camera sees of a rectangle."""


def page_between(
    page: ShapedPage | None,
    corners: Points,
    outline: SheetOutline,
    view: PhotoFrame,
    prior: FocalPrior,
    kind: PageKind,
) -> ShapedPage:
    """The page between its `corners` (4, 2), photo pixels clockwise from its top left; `outline` runs through them.

    `page` is what its text shows, None where it shows nothing. A shape in which the corners are none of a sheet is left
    out.
    """
    shapes = chain(_by_text(page), _by_sides(page, outline, view, prior, kind))
    placed = (shaped for shaped in shapes if places_corners(shaped, corners))
    first = next(placed)
    return replace(first, corners=corners, others=(replace(other, corners=corners) for other in placed))


def places_corners(page: ShapedPage, corners: Points) -> bool:
    """Whether `corners` (4, 2), in their order, are those of a quadrilateral on the flat page that turns right."""
    at = page.shape.page_map.to_page(page.view.to_centred(corners))
    return bool(np.isfinite(at).all() and (corner_turns(at) > 0).all())


def _by_text(page: ShapedPage | None) -> Iterator[ShapedPage]:
    if page is not None:
        yield page
        yield from page.others


def _by_sides(
    page: ShapedPage | None, outline: SheetOutline, view: PhotoFrame, prior: FocalPrior, kind: PageKind
) -> Iterator[ShapedPage]:
    """The shapes that the sides alone show, the last of which places any corners; with the analysis of `page`."""
    outline = with_straight_sides(outline)
    found = ShapedPage(view, frontal_page(prior), (), outline)
    if page is not None:
        found = replace(found, analysis=page.analysis, vanishing_points=page.vanishing_points)
    bent = sides_bend(outline) > STRAIGHT_SIDE if kind == "auto" else kind == "curved"
    if bent:
        ridged = estimate_ridged_page(outline, view, prior, 0.0, None, None)
        if not isinstance(ridged, NoShape):
            yield replace(found, shape=ridged, notices=ridged.notices)
    for parameters in (None, BENT):
        sheet = read_sides(outline, view, prior, parameters)
        if sheet is not None and sheet.plane is not None:
            flat = planar_page(sheet.plane, prior, "outline", sheet)
            yield replace(found, view=sheet.view, shape=flat, notices=flat.notices)
    yield replace(found, notices=found.shape.notices)


def frontal_page(prior: FocalPrior) -> PlanarPage:
    """The plane of a sheet that faces the camera: between given corners its sides have their mean lengths."""
    plane = PagePlane(np.eye(3), float(np.exp(prior.log_focal)))
    return PlanarPage(
        plane,
        prior.source,
        (aspect_uncertain(max(UNKNOWN_ASPECT, ASPECT_DEVIATION), by_format=False),),
        sources=("outline",),
        sides_believed=True,
        log_aspect_deviation=UNKNOWN_ASPECT,
    )

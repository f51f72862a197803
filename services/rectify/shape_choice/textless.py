"""A page whose text does not show its shape: its plane from the sheet's sides, or from straight print."""

from dataclasses import replace

import numpy as np

from services.arrays import RgbImage
from services.errors import NoText
from services.geometry.focal_prior import FocalPrior
from services.geometry.photo_frame import PhotoFrame
from services.imaging.channels import luminance
from services.imaging.ground import even_share
from services.notices import Notice
from services.rectify.shape_choice.even_rim import has_even_rim
from services.rectify.shape_choice.shaped_page import ShapedPage
from services.sheet.outline.even_area import find_even_area
from services.sheet.outline.results import SheetOutline
from services.sheet.plane.outline_plane import (
    OutlinePlane,
    OutlinePlaneParameters,
    SheetSides,
    read_sides,
)
from services.sheet.plane.planar_page import PlanarPage
from services.sheet.plane.pose import ASPECT_DEVIATION, aspect_uncertain
from services.sheet.plane.ruled_plane import plane_from_rules
from services.sheet.ridged_page import estimate_ridged_page, sides_bend
from services.sheet.shape import NoShape, ShapeSource

NOT_FLAT = Notice(
    "curved-page",
    "the sheet's edges are not those of a flat rectangle, and no text shows its shape; this is its best planar view.",
)
BENT = OutlinePlaneParameters(max_bend=0.06, max_misfit_rad=float(np.deg2rad(8.0)), max_off_centre=0.0)
"""For bent sheets, of which only the corners are used."""


EVEN_SHARE = 0.4
"""Of the photo, at least, is the one ground on which straight lines are those of a page: pages have 0.5 and more, tiles
0.15."""
STRAIGHT_SIDE = 0.006
"""RMS bend of a side, as a share of the sheet's size: without text a bend must be obvious."""


def find_textless_page(
    photo: RgbImage, outline: SheetOutline | None, view: PhotoFrame, prior: FocalPrior, refusal: NoText
) -> ShapedPage:
    """The page in `photo` (H, W, 3), whose text was refused, by its `outline`, else by its straight print.

    Raises
    ------
    NoText
        `refusal` with what else was searched, when neither shows a plane.
    """
    if outline is not None and not has_even_rim(photo, outline.polygon):
        outline = None
    # A sheet with bent sides is a bent sheet, even if a plane would fit them.
    if outline is not None and sides_bend(outline) > STRAIGHT_SIDE:
        ridged = estimate_ridged_page(outline, view, prior, 0.0, None, None)
        if not isinstance(ridged, NoShape):
            return ShapedPage(view, ridged, ridged.notices, outline)
    sheet = read_sides(outline, view, prior)
    if sheet is not None and sheet.plane is not None:
        flat = planar_page(sheet.plane, prior, "outline", sheet)
        return ShapedPage(sheet.view, flat, flat.notices, outline)
    ruled = plane_from_rules(luminance(photo), view, prior)
    # Straight lines of tiles or planks are not those of a page.
    if not isinstance(ruled, NoShape) and even_share(photo) < EVEN_SHARE:
        ruled = NoShape("its straight lines do not lie on one sheet")
    if not isinstance(ruled, NoShape):
        ends = view.to_photo(np.concatenate([ruled.lines.starts, ruled.lines.ends]))
        flat = planar_page(ruled, prior, "rules")
        return ShapedPage(view, flat, flat.notices, straight_print=ends)
    bent = read_sides(outline, view, prior, BENT)
    if bent is not None and bent.plane is not None:
        flat = replace(planar_page(bent.plane, prior, "outline"), sides_believed=False)
        return ShapedPage(bent.view, flat, (NOT_FLAT, *flat.notices), outline)
    board = find_even_area(photo)
    on_board = read_sides(board, view, prior)
    if (
        board is not None
        and on_board is not None
        and on_board.plane is not None
        and has_even_rim(photo, board.polygon)
    ):
        flat = planar_page(on_board.plane, prior, "outline", on_board)
        return ShapedPage(on_board.view, flat, flat.notices, board)
    if sheet is not None:
        raise NoText(f"{refusal.detail} A sheet's edge is seen, but {sheet.refusal}.")
    raise NoText(
        f"{refusal.detail} No sheet's edge is seen whole either, and {ruled.reason}: have all four sides in the photo."
    )


def planar_page(
    found: OutlinePlane, prior: FocalPrior, source: ShapeSource, sheet: SheetSides | None = None
) -> PlanarPage:
    """The plane with notices about its uncertainty; `sheet` has the sides that show it."""
    aspect = None if sheet is None else sheet.aspect_in(found.plane)
    uncertain = found.log_aspect_deviation if aspect is None else aspect.log_deviation
    notices: tuple[Notice, ...] = ()
    if uncertain > ASPECT_DEVIATION:
        by_format = sheet is not None and sheet.focal_prior(prior) is not prior
        notices = (aspect_uncertain(uncertain, by_format=by_format),)
    return PlanarPage(
        found.plane,
        prior.source_beside(found.log_focal_deviation),
        notices,
        sources=(source,),
        sides_believed=source == "outline",
        sheet_aspect=aspect,
        log_aspect_deviation=uncertain,
    )

"""The part of a page that its view shows: the frame of its shape, cut to the sheet."""

from services.arrays import Points, RgbImage
from services.contract.rectify import Crop
from services.geometry.page_frame import Frame
from services.imaging.paper import certain_sheet
from services.rectify.shape_choice.shaped_page import ShapedPage
from services.rectify.view.edge_cropping import crop_to_gutter, within_gutter
from services.rectify.view.sheet_cut import cut_to_outline, cut_to_page


def find_border(page: ShapedPage, crop: Crop) -> Points | None:
    """The sheet's outline (N, 2) in the photo, up to the gutter; None if unseen or not to be cut at."""
    if page.analysis is None:
        return None if page.outline is None else page.outline.polygon
    if crop != "sheet" or page.shape.ends_at_sides:
        return None
    outline = page.analysis.paper.outline(page.analysis.characters)
    return outline if outline is None else within_gutter(outline, page.analysis)


def frame_shape(page: ShapedPage, border: Points | None, crop: Crop) -> Frame:
    """The part of the flat page that is shown; `border` (N, 2) is the sheet's in the photo, if its edge is seen."""
    crop = "sheet" if page.analysis is None else crop
    return page.shape.frame(page.view, page.extent, page.text_height_px, border, crop)


def cut_view(photo: RgbImage, frame: Frame, page: ShapedPage, border: Points | None) -> Frame:
    """`frame` cut to the page: its outline's sides, the gutter, edges in the flat view, blank ground."""
    known: frozenset[str] = frozenset()
    if page.analysis is not None and page.shape.ends_at_sides:
        return frame
    if page.outline is not None:
        frame, known = cut_to_outline(frame, page.outline, page.characters)
    if page.analysis is None:
        return frame
    frame = crop_to_gutter(frame, page.analysis)
    # Lines on a flat sheet that is wholly in the photo are print, except on a spread of two pages.
    flat_sheet = border if page.shape.kind == "planar" and not page.analysis.facing_page else None
    whole = flat_sheet is not None and certain_sheet(flat_sheet) is not None
    return cut_to_page(photo, frame, page.analysis, known, whole=whole)

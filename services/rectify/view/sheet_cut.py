"""Cut of a flat view to the sheet: at the sides of its outline, at edges that the flat view shows, beyond the print."""

from dataclasses import dataclass, replace

import cv2
import numpy as np

from services.arrays import Mask, Points, RgbImage
from services.geometry.page_frame import Frame, FramingParameters, resize_frame
from services.imaging.channels import luminance
from services.imaging.ground import sides_reached
from services.imaging.sheet_edges import SheetEdges, find_sheet_edges
from services.rectify.analysis.page_analysis import PageAnalysis
from services.rectify.shape_choice.shaped_page import ShapedPage
from services.rectify.view.drawing import draw_flat_view
from services.rectify.view.edge_cropping import LONG_SIDE_PX, crop_frame, crop_to_gutter, shown_pixels
from services.rectify.view.paper_end import PaperEnd
from services.sheet.outline.results import SheetOutline

SIDES = ("left", "top", "right", "bottom")

STRAY_PERCENT = 0.5
"""Share of the characters beyond either end of the text: they may be specks."""
FEWEST_POINTS = 8
"""Points of a side from which its line is fitted."""


@dataclass(frozen=True, slots=True)
class SheetCutParameters:
    """When a side of the outline is accepted, and how much blank ground is kept."""

    min_seen: float = 0.4
    """Share of a side on which its edge is seen."""
    max_slope: float = 0.2
    """Of a side in the flat view: a larger slope is not that of a side of this page."""
    inner_percentile: float = 85.0
    """Of a side's points, counted from outside: where a side that is not quite straight is cut."""
    max_text_share: float = 0.005
    """Largest share of the characters outside of a side of their sheet."""
    blank_margin: float = 0.12
    """Of the text's larger size, kept beyond the print where the sheet's edge is not seen: margins of pages are as
    wide."""
    close_sides: int = 2
    """Sides on which print, or the sheet, ends near the photo's frame, from which on the page alone is in view."""
    ink_size: float = 1.5
    """Text heights: what is wider is shadow or ground."""
    least_ink_size_px: int = 7
    ink_contrast: float = 0.2
    """Contrast of print to its surroundings, as a share of their brightness: above noise and edges of shadows."""
    black: float = 16.0
    """Gray levels added to the surroundings, so that noise in the dark is not print."""
    least_ink_px: int = 12
    """Within a text height of a row or column of the reduced view; fewer are specks."""


def cut_view(photo: RgbImage, frame: Frame, page: ShapedPage, end: PaperEnd) -> Frame:
    """`frame` cut to the page: its outline's sides, the gutter, edges in the flat view, blank ground."""
    if page.analysis is not None and page.shape.ends_at_sides:
        return frame
    known: frozenset[str] = frozenset()
    if page.outline is not None:
        frame, known = cut_to_outline(frame, page.outline, page.characters, believed=end.believed)
    if page.analysis is None:
        return frame
    return cut_to_page(photo, crop_to_gutter(frame, page.analysis), page.analysis, known, whole=end.whole)


def cut_to_outline(
    frame: Frame, outline: SheetOutline, characters: Points, *, believed: bool
) -> tuple[Frame, frozenset[str]]:
    """`frame` cut at the sides of the `outline` that are seen, and which sides these are.

    A side that would cut off `characters` (N, 2), photo pixels, is not used; outside of a `believed` outline they are
    specks of a desk.
    """
    p = SheetCutParameters()
    if believed:
        characters = characters[outline.holds(characters)]
    text = frame.to_flat(characters)
    text = text[np.isfinite(text).all(axis=1)]
    border = frame.to_flat(outline.polygon)
    centre = np.nanmedian(border, axis=0)
    found: dict[str, float] = {}
    for side in outline.sides:
        points = frame.to_flat(side.points)
        points = points[np.isfinite(points).all(axis=1)]
        if side.seen < p.min_seen or len(points) < FEWEST_POINTS:
            continue
        middle = points.mean(axis=0)
        way = np.linalg.svd(points - middle)[2][0]
        upright = abs(way[1]) > abs(way[0])
        axis = 0 if upright else 1
        if abs(way[axis]) > p.max_slope * abs(way[1 - axis]):
            continue
        before = bool(middle[axis] < centre[axis])
        place = float(
            np.percentile(points[:, axis], p.inner_percentile if before else 100 - p.inner_percentile)
        )
        beyond = text[:, axis] < place if before else text[:, axis] > place
        if len(text) and beyond.mean() > p.max_text_share:
            continue
        found[("left" if before else "right") if upright else ("top" if before else "bottom")] = place
    return crop_frame(frame, SheetEdges(**found)), frozenset(found)


def cut_to_page(
    photo: RgbImage,
    frame: Frame,
    analysis: PageAnalysis,
    known: frozenset[str],
    *,
    whole: bool,
) -> Frame:
    """`frame` cut on the sides that are not `known` yet: at long edges next to the text, or where blank ground begins.

    With `whole` the sheet is certainly in the photo as a whole; then lines inside its outline are print, not edges.
    """
    p = SheetCutParameters()
    if len(known) == len(SIDES):
        return frame
    factor = min(1.0, LONG_SIDE_PX / max(frame.width, frame.height))
    small = resize_frame(frame, factor)
    view = draw_flat_view(photo, small)
    shown = shown_pixels(small, photo.shape[1], photo.shape[0])
    text = small.to_flat(analysis.characters)
    text_height_px = analysis.text_height_px * factor
    edges = SheetEdges() if whole else find_sheet_edges(view, text, text_height_px, shown)
    edges = replace(edges, **{side: None for side in known})
    open_sides = [side for side in SIDES if side not in known and getattr(edges, side) is None]
    if open_sides and not whole:
        blank = blank_ground(view, shown, text, text_height_px, p)
        cut = [side for side in open_sides if getattr(blank, side) is not None]
        # Paper that goes on to the photo's frame is the sheet's, blank or not; with blank ground on all sides, it is a
        # table as white as the sheet.
        close = len(SIDES) - len(cut) >= p.close_sides
        paper = sides_reached(view, shown) if cut and close else frozenset()
        edges = replace(edges, **{side: getattr(blank, side) for side in cut if side not in paper})
    return crop_frame(frame, edges, factor)


def blank_ground(
    view: RgbImage,
    shown: Mask,
    text: Points,
    text_height_px: float,
    parameters: SheetCutParameters | None = None,
) -> SheetEdges:
    """Edges at a margin from the outermost print of the `view` (H, W, 3), on sides with only blank ground beyond.

    `text` (N, 2) are characters, `shown` (H, W) the pixels that the photo shows. None on sides where print, a
    picture or a desk continues to the end of the view.
    """
    p = parameters or SheetCutParameters()
    text = text[np.isfinite(text).all(axis=1)]
    if not len(text):
        return SheetEdges()
    ink = _fine_structure(view, shown, max(round(p.ink_size * text_height_px), p.least_ink_size_px), p)
    low, high = np.percentile(text, STRAY_PERCENT, axis=0), np.percentile(text, 100.0 - STRAY_PERCENT, axis=0)
    margin = max(p.blank_margin * float((high - low).max()), 3 * text_height_px)
    size = (view.shape[1], view.shape[0])
    edges: dict[str, float | None] = {}
    for axis, (before, after) in enumerate((("left", "right"), ("top", "bottom"))):
        near = np.convolve(ink.sum(axis=axis), np.ones(max(round(text_height_px), 1)), "same")
        inked = np.flatnonzero(near >= p.least_ink_px)
        first = min(float(low[axis]), float(inked[0]) if len(inked) else np.inf) - margin
        last = max(float(high[axis]), float(inked[-1]) if len(inked) else -np.inf) + margin
        edges[before] = first if first > 0 else None
        edges[after] = last if last < size[axis] - 1 else None
    return SheetEdges(**edges)


def _fine_structure(view: RgbImage, shown: Mask, size: int, p: SheetCutParameters) -> Mask:
    """Pixels (H, W) of `view` that are darker than their surroundings and narrower than `size`: print, not shadows."""
    gray = luminance(view)
    around = cv2.morphologyEx(gray, cv2.MORPH_CLOSE, np.ones((size, size), np.uint8)).astype(np.float32)
    # The border of the photo is not print.
    rim = 2 * size + 1
    inside = cv2.erode(shown.astype(np.uint8), np.ones((rim, rim), np.uint8), borderValue=0)
    return np.asarray((around - gray > p.ink_contrast * (around + p.black)) & (inside > 0))


def restore_detail(frame: Frame, photo_pixels: int, characters: Points, text_height_px: float) -> Frame:
    """Raise the resolution of `frame` to that of the photo, and above it where print is small.

    A view that was larger before it was cut may have been reduced. Small print loses detail by every resampling, less
    so if it is drawn with more pixels than the photo has, which are `photo_pixels`. `characters` (N, 2) are their
    centres in the photo. `frame` itself is returned if its resolution is right.
    """
    f = FramingParameters()
    at = frame.to_flat(characters)
    at = at[np.isfinite(at).all(axis=1)]
    if not len(at):
        return frame
    steps = [frame.to_photo(at + d) for d in np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])]
    a, b = steps[1] - steps[0], steps[2] - steps[0]
    with np.errstate(invalid="ignore"):
        lost = np.sqrt(np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]))
    growth = float(np.nanpercentile(lost, f.detail_percentile))
    enlargement = float(np.clip(f.small_print_px / max(text_height_px, 1.0), 1.0, f.max_enlargement))
    growth *= enlargement
    pixels = max(f.max_growth * photo_pixels, f.small_view_px if enlargement > 1 else 0.0)
    room = np.sqrt(pixels / (frame.width * frame.height))
    growth = min(growth, float(room), f.longest_side_px / max(frame.width, frame.height))
    return resize_frame(frame, growth) if growth > f.least_growth else frame

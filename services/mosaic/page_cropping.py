"""Crop of the mosaic to the sheet: straight edges between paper and background."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import Floats, Mask, Points, RgbImage
from services.geometry.homographies import to_resized
from services.imaging.channels import luminance
from services.imaging.illumination import flatten_illumination
from services.imaging.node_grid import MAX_REDUCTION, between_nodes, continuous_nodes, node_grid, take_values
from services.imaging.paper import PaperParameters, model_paper
from services.imaging.reduction import average_areas, reduce_image
from services.mosaic.flat_photo import FlatPhoto
from services.mosaic.placed_photo import PlacedPhoto
from services.rectify.analysis.found_text import AnalysisParameters
from services.rectify.view.outside_text import is_outside_text, of_text_height
from services.sheet.plane.flat_photo import PhotoAsPage
from services.texture_flow.text_identification import FEWEST_CHARACTERS, IdentifiedText, identify_text

# Lengths are cells, which are pixels of a page reduced to `LONG_SIDE_PX`, or shares of the page.
LONG_SIDE_PX = 600
"""Size at which the sheet is detected: a cell is then half a millimetre of an A4 page."""
STEEPEST = 0.04
"""Largest slope of an edge: sheets are cut parallel to their print within two degrees."""
SLOPES = 41
"""Number of slopes that are tried: two next to each other differ by one cell over the page's height."""
STRAIGHTNESS = 1.5
"""Largest distance of an edge's points from its line, cells."""
SUPPORT = 0.05
"""Share of the page's height (width) along which paper and background must meet at an edge."""
CONSENT = 0.5
"""Smallest share of an edge's length with paper inside where the outside is not paper."""
BEYOND = 0.004
"""Largest share of the paper outside of such an edge."""
SURE_CONSENT = 0.96
"""An edge with at least this consent may have more paper outside. Neither a picture on the page nor the paper on
its other side has such a straight border."""
SURE_BEYOND = 0.15
"""Largest share of the paper outside of an edge of `SURE_CONSENT`: it may be a bright desk."""
STEP = 0.25
"""Least step of a colour's logarithm across an edge in a photo's own colours: 0.05 on paper, 0.5 from paper to
wood."""
HUE = 0.15
"""Largest deviation of the logarithms of colours over their mean along an edge: 0.03 on paper, 0.2 to 0.6 on
wood."""
CLOSING = 7
"""Size of the morphological closing, cells: more than the height of a text line."""
CANDIDATES = 4
"""Number of lines that are tested on each side, because a bright spot of the desk also has a border."""
GROUND = 3
"""Width of the background next to the paper, cells, so that a photo's border is not mistaken for the sheet's."""
INSET = 0.75
"""Distance of the cut inside the edge, cells: pixels of the edge mix paper and background."""


@dataclass(frozen=True, slots=True, eq=False)
class PageCrop:
    """Columns `left` to `right` and rows `top` to `bottom`, ends excluded, and the visible edges of the sheet.

    `edges` (K, 3) are lines a x + b y + c = 0 in pixels before cropping, positive on the sheet's side.
    """

    left: int
    top: int
    right: int
    bottom: int
    edges: Floats


@dataclass(frozen=True, slots=True, eq=False)
class PageCells:
    """Reduced maps (h, w) of the mosaic: where photos show it, and where most of them show the sheet.

    `views` are (h, w, 3), one for each photo: its background colours without print, black where it shows nothing.
    Where `are_pages`, each photo is the page itself, as a scan or a screenshot is: no sheet is seen within it.
    """

    seen: Mask
    paper: Mask
    views: tuple[RgbImage, ...] = ()
    are_pages: bool = False


def see_sheet(placed: Sequence[PlacedPhoto], width: int, height: int) -> PageCells:
    """Maps of the sheet on a page of `width` x `height` mosaic pixels. In each cell the majority of photos decides."""
    factor = min(1.0, LONG_SIDE_PX / max(width, height))
    columns, rows = max(round(width * factor), 1), max(round(height * factor), 1)
    nodes, shape = node_grid(0, 0, columns, rows)
    mosaic = (nodes + 0.5) * (width / columns, height / rows) - 0.5
    votes, views = np.zeros((2, rows, columns), np.int16), []
    for photo in placed:
        # Exact at the nodes of a grid: between them the maps bend by less than a cell.
        nodes_flat = photo.placement.to_flat(mosaic)
        nodes_photo = photo.flat.to_photo(nodes_flat).reshape(*shape, 2)
        nodes_photo[~continuous_nodes(nodes_photo, MAX_REDUCTION * max(width / columns, height / rows))] = (
            np.nan
        )
        flat, at = (
            between_nodes(places.reshape(*shape, 2).astype(np.float32), columns, rows)
            for places in (nodes_flat, nodes_photo)
        )
        shown = _take_nearest(photo.flat.shown.view(np.uint8), flat, cv2.BORDER_CONSTANT) > 0
        beyond = shown & np.isnan(at[..., 0])  # next to where the sheet's model ends
        if beyond.any():
            at[beyond] = photo.flat.to_photo(flat[beyond].astype(np.float64))
        view = _take_nearest(*_blank_photo(photo.flat.photo, at), cv2.BORDER_REPLICATE)
        views.append(np.asarray(cv2.copyTo(np.maximum(view, np.uint8(1)), shown.view(np.uint8)), np.uint8))
        votes[0] += shown
        votes[1] += 2 * (shown & _on_sheet(photo.flat, at))
    seen = votes[0] > 0
    paper = np.asarray(seen & (votes[1] >= votes[0]))
    return PageCells(seen, paper, tuple(views), all(_is_page(photo.flat) for photo in placed))


def _is_page(photo: FlatPhoto) -> bool:
    """Whether a photo is the page itself, and no sheet is seen within it."""
    return photo.page is not None and isinstance(photo.page.shape, PhotoAsPage) and photo.sheet is None


def find_page_crop(page: RgbImage, cells: PageCells) -> PageCrop:
    """The part of the mosaic `page` (H, W, 3) that is the sheet.

    Background is what differs from paper in the photos or in the page. A bright desk differs in the photos' own
    colours. A dark desk differs on the page, even where one photo shows too little of it. A desk that looks like paper
    in places is recognized by the colour step across the edge. Everything beyond an edge is not the page. On a side
    without a visible edge the page extends to the end of the photos.
    """
    height, width = page.shape[:2]
    factor = cells.seen.shape[1] / width
    edges: Floats = np.zeros((0, 3))
    if not cells.are_pages:
        reduced = _reduce_page(page, cells.seen)
        paper = _paper_of_page(reduced, cells.seen.shape)
        edges = _find_edges(PageCells(cells.seen, cells.paper & paper, cells.views))
        if len(edges) and reduced.has_text:
            edges = edges[~_cuts_text(reduced, edges)]
    kept = cells.seen & _within(edges, cells.seen.shape)
    if not kept.any():
        return PageCrop(0, 0, width, height, np.zeros((0, 3)))
    rows, columns = np.flatnonzero(kept.any(axis=1)), np.flatnonzero(kept.any(axis=0))
    down, across = height / cells.seen.shape[0], width / cells.seen.shape[1]
    left, right = int(columns[0] * across), int(np.ceil((columns[-1] + 1) * across))
    top, bottom = int(rows[0] * down), int(np.ceil((rows[-1] + 1) * down))
    # Cell coordinates are (x + 0.5) factor - 0.5 for pixel x.
    shift = (0.5 * factor - 0.5) * (edges[:, 0] + edges[:, 1])
    in_pixels = np.column_stack([edges[:, :2] * factor, edges[:, 2] + shift])
    return PageCrop(left, top, right, bottom, in_pixels)


def crop_page(page: RgbImage, crop: PageCrop) -> RgbImage:
    """The cropped page, a view. Pixels beyond the sheet's edges become white, in place."""
    part = page[crop.top : crop.bottom, crop.left : crop.right]
    height, width = part.shape[:2]
    for a, b, c in crop.edges:
        # The half plane beyond the edge, clipped to a box around the page.
        box = np.array([[-1.0, -1.0], [width, -1.0], [width, height], [-1.0, height]])
        beyond = _clip(box, np.array([-a, -b, -(a * crop.left + b * crop.top + c)]))
        if len(beyond) >= 3:
            cv2.fillPoly(part, [np.round(beyond).astype(np.int32)], (255, 255, 255))
    return part


def _on_sheet(photo: FlatPhoto, at: NDArray[np.float32]) -> Mask:
    """Which photo pixels `at` (h, w, 2) lie on the sheet; all if its edge is not visible."""
    if photo.sheet is None:
        return np.ones(at.shape[:2], bool)
    height, width = photo.photo.shape[:2]
    factor = min(1.0, LONG_SIDE_PX / max(width, height))
    inside = np.zeros((round(height * factor) + 1, round(width * factor) + 1), np.uint8)
    cv2.fillPoly(inside, [np.round(to_resized(photo.sheet, factor)).astype(np.int32)], (1,))
    return np.asarray(_take_nearest(inside, to_resized(at, factor), cv2.BORDER_REPLICATE) > 0)


def _blank_photo(photo: RgbImage, at: NDArray[np.float32]) -> tuple[RgbImage, NDArray[np.float32]]:
    """The photo, reduced and without print, and the places there of its pixels `at` (h, w, 2)."""
    factor = min(1.0, LONG_SIDE_PX / max(photo.shape[:2]))
    kernel = np.ones((CLOSING, CLOSING), np.uint8)
    blank = cv2.morphologyEx(reduce_image(photo, factor, fine=False), cv2.MORPH_CLOSE, kernel)
    return np.asarray(blank, np.uint8), to_resized(at, factor)


def _take_nearest(image: NDArray[np.uint8], at: NDArray[np.float32], border: int) -> NDArray[np.uint8]:
    return np.asarray(take_values(image, np.asarray(at, np.float32), cv2.INTER_NEAREST, border), np.uint8)


@dataclass(frozen=True, slots=True, eq=False)
class _ReducedPage:
    """The page `image` (h, w, 3) at the size of analysis, where it is `shown` (h, w) 0/1, in `gray`, and its text.

    A pixel is `cells_per_px` cells.
    """

    image: RgbImage
    shown: NDArray[np.uint8]
    gray: NDArray[np.uint8]
    text: IdentifiedText
    cells_per_px: float

    @property
    def has_text(self) -> bool:
        """Whether there is enough of it to know paper and the size of print by."""
        return len(self.text.components.centres) >= FEWEST_CHARACTERS

    def to_cells(self, pixels: Points) -> Points:
        """Cells (N, 2) of pixels (N, 2)."""
        return to_resized(pixels, self.cells_per_px)


def _reduce_page(page: RgbImage, seen: Mask) -> _ReducedPage:
    factor = min(1.0, AnalysisParameters().long_side_px / max(page.shape[:2]))
    size = (max(round(page.shape[1] * factor), 1), max(round(page.shape[0] * factor), 1))
    small = average_areas(page, *size)
    shown = cv2.resize(seen.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST)
    gray = luminance(small)
    text = identify_text(flatten_illumination(gray))
    return _ReducedPage(small, np.asarray(shown, np.uint8), gray, text, seen.shape[1] / size[0])


def _paper_of_page(page: _ReducedPage, shape: tuple[int, ...]) -> Mask:
    """Cells of the page that are paper; all if no background is found, or no text."""
    if not page.has_text:
        return np.ones(shape, bool)
    # Areas that no photo shows are white, but not paper.
    shown = np.asarray(cv2.bitwise_and(page.image, page.image, mask=page.shown), np.uint8)
    sizes, characters = PaperParameters(long_side_px=LONG_SIDE_PX), page.text.components.centres
    outline = model_paper(shown, characters, sizes).outline(characters, sizes)
    if outline is None:
        return np.ones(shape, bool)
    paper = np.zeros(shape, np.uint8)
    cv2.fillPoly(paper, [np.round(page.to_cells(outline)).astype(np.int32)], (1,))
    return np.asarray(paper > 0)


def _cuts_text(page: _ReducedPage, edges: Floats) -> Mask:
    """Which of the `edges` (K,) have text beyond them, dark or light, on paper or elsewhere."""

    def beyond(text: IdentifiedText) -> Mask:
        centres = page.to_cells(of_text_height(text.components, page.text.text_height_px))
        return np.asarray(centres @ edges[:, :2].T + edges[:, 2] < 0)

    dark = beyond(page.text)
    cut = np.array([is_outside_text(count, 0, len(dark)) for count in dark.sum(axis=0).tolist()])
    if cut.all():
        return cut
    negative = flatten_illumination(np.where(page.shown > 0, 255 - page.gray, 0).astype(np.uint8))
    light = beyond(identify_text(negative))
    return cut | [is_outside_text(0, count, len(dark)) for count in light.sum(axis=0).tolist()]


def _find_edges(cells: PageCells) -> Floats:
    """Edges (K, 3) of the sheet in cells, positive on the sheet's side."""
    edges = []
    for quarters in range(4):
        # Rotated so that the current side is the left one.
        views = tuple(np.rot90(view, quarters) for view in cells.views)
        turned = PageCells(np.rot90(cells.seen, quarters), np.rot90(cells.paper, quarters), views)
        edge = _find_left_edge(turned)
        if edge is not None:
            edges.append(_turned_back(edge, quarters, cells.seen.shape))
    return np.array(edges).reshape(-1, 3)


def _find_left_edge(cells: PageCells) -> Floats | None:
    """Line (a, b, c) along the left side of the sheet, if background is visible there; else None."""
    y, x = _left_borders(cells.paper, cells.seen)
    for _ in range(CANDIDATES):
        best = _on_one_line(y, x)
        if best.sum() < SUPPORT * len(cells.paper):
            return None
        slope, intercept = np.polyfit(y[best], x[best], 1)
        if _is_edge(cells, slope, intercept, y[best].astype(int)):
            # x is the first cell of paper; its left border is half a cell to the left.
            return np.array([1.0, -slope, -(intercept - 0.5 + INSET)])
        y, x = y[~best], x[~best]
    return None


def _left_borders(paper: Mask, seen: Mask) -> tuple[Floats, Floats]:
    """Rows and columns (N,) of paper cells with background to their left and more paper to their right."""
    ground = seen & ~paper
    width = paper.shape[1] - 2 * GROUND + 1
    border = np.ones((len(paper), max(width, 0)), bool)
    for step in range(GROUND):
        border &= ground[:, step : step + width] & paper[:, GROUND + step : GROUND + step + width]
    y, x = np.nonzero(border)
    return y.astype(np.float64), x.astype(np.float64) + GROUND


def _on_one_line(y: Floats, x: Floats) -> NDArray[np.bool_]:
    """Which points (N,) lie on the steep line with most points."""
    best = np.zeros(len(y), bool)
    if len(y) == 0:
        return best
    for slope in np.linspace(-STEEPEST, STEEPEST, SLOPES):
        # The line of this slope with most points: the densest window of their intercepts.
        intercept = x - slope * y
        order = np.sort(intercept)
        last = np.searchsorted(order, order + 2 * STRAIGHTNESS, side="right")
        start = int(np.argmax(last - np.arange(len(order))))
        on = (intercept >= order[start]) & (intercept <= order[start] + 2 * STRAIGHTNESS)
        best = on if on.sum() > best.sum() else best
    return best


def _is_edge(cells: PageCells, slope: float, intercept: float, borders: NDArray[np.int_]) -> bool:
    """Whether the sheet ends at x = slope y + intercept; in the rows `borders` background meets paper there."""
    paper, seen = cells.paper, cells.seen
    columns, lines = np.arange(paper.shape[1]), np.arange(paper.shape[0])
    off = columns - (intercept + slope * lines)[:, None]
    beyond = (paper & (off < -2 * STRAIGHTNESS)).sum() / paper.sum()
    # Rows where the line has paper inside and any photo shows its outside.
    reach = 2 * STRAIGHTNESS + 1
    inner = (paper & (off >= 0) & (off < reach)).any(axis=1)
    outer = (seen & (off < -1) & (off >= -reach)).any(axis=1)
    differs = np.zeros(len(paper), bool)
    both = inner & outer
    if cells.views:
        differs, other = _steps(cells.views, slope, intercept)
        # Beyond the sheet's corners the desk is on both sides of the line.
        both &= ~other
    differs[borders] = True
    consent = (both & differs).sum() / max(both.sum(), 1)
    return bool(
        (beyond <= BEYOND and consent >= CONSENT) or (beyond <= SURE_BEYOND and consent >= SURE_CONSENT)
    )


def _steps(
    views: tuple[RgbImage, ...], slope: float, intercept: float
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Rows (h,) in which most photos that show both sides of the line show different colours there, and rows in which
    the colour to its right has another hue than along most of the line.
    """
    height, width = views[0].shape[:2]
    rows = np.arange(height)
    line = intercept + slope * rows
    inside, outside = (
        np.clip(np.round(line + shift).astype(int), 0, width - 1) for shift in (GROUND, -GROUND - 1)
    )
    votes = np.zeros((3, height), np.int16)
    for view in views:
        inner, outer = view[rows, inside].astype(np.float64), view[rows, outside].astype(np.float64)
        shown = inner.any(axis=1) & outer.any(axis=1)
        step = np.abs(np.log((inner + 1) / (outer + 1))).max(axis=1)
        votes[0] += shown
        votes[1] += 2 * (shown & (step > STEP))
        if shown.any():
            hue = np.log((inner + 1) / (inner.mean(axis=1, keepdims=True) + 1))
            away = np.linalg.norm(hue - np.median(hue[shown], axis=0), axis=1)
            votes[2] += 2 * (shown & (away > HUE))
    differs, other = (votes[1:] > 0) & (votes[1:] >= votes[0])
    return differs, other


def _turned_back(edge: Floats, quarters: int, shape: tuple[int, ...]) -> Floats:
    """`edge` of an image that was rotated counter-clockwise by `quarters`, in the image of `shape` before."""
    height, width = shape
    for left in range(quarters, 0, -1):
        # The rotated point (x, y) was (w - 1 - y, x) in the image of width w before.
        w = width if left % 2 else height
        a, b, c = edge
        edge = np.array([-b, a, c + b * (w - 1)])
    return edge


def _within(edges: Floats, shape: tuple[int, ...]) -> Mask:
    x, y = np.arange(shape[1]), np.arange(shape[0])[:, None]
    inside = np.ones(shape, bool)
    for a, b, c in edges:
        inside &= a * x + b * y + c >= 0
    return inside


def _clip(polygon: Points, line: Floats) -> Points:
    """The part (N, 2) of a convex polygon where the line is positive (Sutherland and Hodgman 1974)."""
    values = polygon @ line[:2] + line[2]
    kept = []
    for k in range(len(polygon)):
        following = (k + 1) % len(polygon)
        if values[k] >= 0:
            kept.append(polygon[k])
        if values[k] * values[following] < 0:
            share = values[k] / (values[k] - values[following])
            kept.append(polygon[k] + share * (polygon[following] - polygon[k]))
    return np.array(kept).reshape(-1, 2)

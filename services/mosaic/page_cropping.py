"""Where the sheet ends on the whole mosaic: straight edges between paper and what it lies on."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import Floats, Mask, Points, RgbImage
from services.imaging.illumination import flatten_illumination
from services.imaging.paper import PaperParameters, model_paper
from services.mosaic.flat_photo import FlatPhoto
from services.mosaic.outside_text import find_characters, is_outside_text
from services.mosaic.photo_graph import is_shown
from services.mosaic.placed_photo import PlacedPhoto
from services.texture_flow.text_identification import identify_text


@dataclass(frozen=True, slots=True)
class PageCroppingParameters:
    """Lengths are cells: pixels of a reduced page of `long_side_px`, or shares of it."""

    long_side_px: int = 600
    """The sheet is looked for at this size: a cell is then half a millimetre of an A4 page."""
    text_long_side_px: int = 1600
    """As in `AnalysisParameters`."""
    min_components: int = 30
    steepest: float = 0.04
    """Sheets are cut parallel to their print to two degrees."""
    straightness: float = 1.5
    """Cells by which points of an edge may lie off it."""
    support: float = 0.05
    """Share of the page's height (width) along which an edge must be seen between paper and ground."""
    consent: float = 0.5
    """Where paper is on the inner side of an edge, on so much of its length something else is on the outer one."""
    beyond: float = 0.004
    """Of the paper at most this share lies beyond such an edge."""
    sure_consent: float = 0.96
    """On so much of its length a picture on the page has no straight end, nor the paper on its other side..."""
    sure_beyond: float = 0.15
    """...so that this share of what is taken for paper may be a bright desk."""
    step: float = 0.25
    """Of the logarithm of a colour across an edge, in a photo's own light: paper on paper has 0.05, on wood 0.5."""
    hue: float = 0.15
    """Of the logarithms of colours over their mean: the sheet's keep within 0.03 along an edge, wood has 0.2 to 0.6."""
    closing: int = 7
    """Cells: wider than a line of print."""
    candidates: int = 4
    """Lines that are tried on each side: a bright spot of the desk has a border too."""
    ground: int = 3
    """Cells beside the paper that must be ground, so that a photo's border is not taken for the sheet's."""
    inset: float = 0.75
    """Cells by which the cut lies within the edge, whose own pixels are half paper, half ground."""


@dataclass(frozen=True, slots=True, eq=False)
class PageCrop:
    """Columns `left` to `right` and rows `top` to `bottom`, ends left out, and the edges of the sheet that are seen.

    `edges` (K, 3) are lines a x + b y + c = 0 in pixels before cropping, positive on the sheet's side.
    """

    left: int
    top: int
    right: int
    bottom: int
    edges: Floats


@dataclass(frozen=True, slots=True, eq=False)
class PageCells:
    """Reduced maps (h, w) of the mosaic: where photos show it, and where what they show is the sheet.

    `views` are (h, w, 3) each: what a photo shows of it, in its own light and free of print; black where it does not.
    """

    seen: Mask
    paper: Mask
    views: tuple[RgbImage, ...] = ()


def see_sheet(
    placed: Sequence[PlacedPhoto], width: int, height: int, parameters: PageCroppingParameters | None = None
) -> PageCells:
    """What the photos tell of the sheet on a page of `width` x `height`: most of those that show a cell decide."""
    p = parameters or PageCroppingParameters()
    factor = min(1.0, p.long_side_px / max(width, height))
    columns, rows = max(round(width * factor), 1), max(round(height * factor), 1)
    x, y = np.meshgrid((np.arange(columns) + 0.5) * width / columns, (np.arange(rows) + 0.5) * height / rows)
    grid = np.stack([x, y], axis=-1).reshape(-1, 2) - 0.5
    votes, views = np.zeros((2, len(grid)), np.int16), []
    for photo in placed:
        flat = photo.placement.to_flat(grid)
        shown = np.flatnonzero(is_shown(photo.flat, flat))
        at = photo.flat.to_photo(flat[shown])
        view = np.zeros((len(grid), 3), np.uint8)
        view[shown] = _colours(photo.flat.photo, at, p)
        views.append(view.reshape(rows, columns, 3))
        on_sheet = _on_sheet(photo.flat, at, p)
        votes[0, shown] += 1
        votes[1, shown[on_sheet]] += 2
    seen = (votes[0] > 0).reshape(rows, columns)
    paper = np.asarray(seen & (votes[1] >= votes[0]).reshape(rows, columns))
    return PageCells(seen, paper, tuple(views))


def find_page_crop(
    page: RgbImage, cells: PageCells, parameters: PageCroppingParameters | None = None
) -> PageCrop:
    """The part of the mosaic `page` (H, W, 3) that is the sheet.

    Ground is what the photos or the page itself tell from paper: a bright desk differs in the photos' own light, a dark
    one where a photo shows too little of it. A desk that is like paper in places is known by the step across the edge
    there in the photos' own light. What lies beyond an edge is not the page. Where no edge is seen the page goes on to
    the end of the photos.
    """
    p = parameters or PageCroppingParameters()
    height, width = page.shape[:2]
    factor = cells.seen.shape[1] / width
    paper, printed = _paper_of_page(page, cells.seen, p)
    edges = _find_edges(PageCells(cells.seen, cells.paper & paper, cells.views), p)
    if printed:
        dark, light = (centres @ edges[:, :2].T + edges[:, 2] < 0 for centres in printed)
        counts = zip(dark.sum(axis=0).tolist(), light.sum(axis=0).tolist(), strict=True)
        edges = edges[[not is_outside_text(of_dark, of_light, len(dark)) for of_dark, of_light in counts]]
    kept = cells.seen & _within(edges, cells.seen.shape)
    if not kept.any():
        return PageCrop(0, 0, width, height, np.zeros((0, 3)))
    rows, columns = np.flatnonzero(kept.any(axis=1)), np.flatnonzero(kept.any(axis=0))
    down, across = height / cells.seen.shape[0], width / cells.seen.shape[1]
    left, right = int(columns[0] * across), int(np.ceil((columns[-1] + 1) * across))
    top, bottom = int(rows[0] * down), int(np.ceil((rows[-1] + 1) * down))
    # A line of cells holds at (x + 0.5) factor - 0.5 for pixel x.
    shift = (0.5 * factor - 0.5) * (edges[:, 0] + edges[:, 1])
    in_pixels = np.column_stack([edges[:, :2] * factor, edges[:, 2] + shift])
    return PageCrop(left, top, right, bottom, in_pixels)


def crop_page(page: RgbImage, crop: PageCrop) -> RgbImage:
    """The cropped page, a view; what lies beyond the sheet's edges becomes white, in place."""
    part = page[crop.top : crop.bottom, crop.left : crop.right]
    height, width = part.shape[:2]
    for a, b, c in crop.edges:
        # The half plane beyond, cut to a box round the page.
        box = np.array([[-1.0, -1.0], [width, -1.0], [width, height], [-1.0, height]])
        beyond = _clip(box, np.array([-a, -b, -(a * crop.left + b * crop.top + c)]))
        if len(beyond) >= 3:
            cv2.fillPoly(part, [np.round(beyond).astype(np.int32)], (255, 255, 255))
    return part


def _on_sheet(photo: FlatPhoto, points: Points, p: PageCroppingParameters) -> NDArray[np.bool_]:
    """Which photo pixels (N, 2) lie on the sheet; all where its edge is not seen."""
    if photo.sheet is None:
        return np.ones(len(points), bool)
    height, width = photo.photo.shape[:2]
    factor = min(1.0, p.long_side_px / max(width, height))
    inside = np.zeros((round(height * factor) + 1, round(width * factor) + 1), np.uint8)
    cv2.fillPoly(inside, [np.round((photo.sheet + 0.5) * factor - 0.5).astype(np.int32)], (1,))
    at = np.round((points + 0.5) * factor - 0.5).astype(int)
    at = np.clip(at, 0, np.array(inside.shape[::-1]) - 1)
    return np.asarray(inside[at[:, 1], at[:, 0]] > 0)


def _colours(photo: RgbImage, points: Points, p: PageCroppingParameters) -> NDArray[np.uint8]:
    """Colours (N, 3) of a photo's ground at `points` (N, 2), never quite black."""
    factor = min(1.0, p.long_side_px / max(photo.shape[:2]))
    size = (max(round(photo.shape[1] * factor), 1), max(round(photo.shape[0] * factor), 1))
    kernel = np.ones((p.closing, p.closing), np.uint8)
    blank = cv2.morphologyEx(cv2.resize(photo, size, interpolation=cv2.INTER_AREA), cv2.MORPH_CLOSE, kernel)
    at = np.clip(np.round((points + 0.5) * factor - 0.5).astype(int), 0, np.array(size) - 1)
    return np.asarray(np.maximum(blank[at[:, 1], at[:, 0]], 1), np.uint8)


def _paper_of_page(page: RgbImage, seen: Mask, p: PageCroppingParameters) -> tuple[Mask, list[Points]]:
    """Cells of the page that are paper; all where no ground is told from it, or there is no text on it.

    And, in cells, where print is, dark or light, on paper or not.
    """
    factor = min(1.0, p.text_long_side_px / max(page.shape[:2]))
    size = (max(round(page.shape[1] * factor), 1), max(round(page.shape[0] * factor), 1))
    small = np.asarray(cv2.resize(page, size, interpolation=cv2.INTER_AREA), np.uint8)
    gray = np.asarray(cv2.cvtColor(small, cv2.COLOR_RGB2GRAY), np.uint8)
    even = flatten_illumination(gray)
    text = identify_text(even)
    characters = text.components.centres
    if len(characters) < p.min_components:
        return np.ones(seen.shape, bool), []
    # What is white because no photo shows it is not paper.
    mask = cv2.resize(seen.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST)
    negative = flatten_illumination(np.where(mask > 0, 255 - gray, 0).astype(np.uint8))
    printed = [
        (find_characters(image, text.text_height_px) + 0.5) * seen.shape[1] / size[0] - 0.5
        for image in (even, negative)
    ]
    small = np.asarray(cv2.bitwise_and(small, small, mask=mask), np.uint8)
    sizes = PaperParameters(long_side_px=p.long_side_px)
    outline = model_paper(small, characters, sizes).outline(characters, sizes)
    if outline is None:
        return np.ones(seen.shape, bool), printed
    cells = np.round((outline + 0.5) * seen.shape[1] / size[0] - 0.5).astype(np.int32)
    paper = np.zeros(seen.shape, np.uint8)
    cv2.fillPoly(paper, [cells], (1,))
    return np.asarray(paper > 0), printed


def _find_edges(cells: PageCells, p: PageCroppingParameters) -> Floats:
    """Edges (K, 3) of the sheet in cells, positive on the sheet's side."""
    edges = []
    for quarters in range(4):
        # Turned so that the side in question is the left one.
        views = tuple(np.rot90(view, quarters) for view in cells.views)
        turned = PageCells(np.rot90(cells.seen, quarters), np.rot90(cells.paper, quarters), views)
        edge = _find_left_edge(turned, p)
        if edge is not None:
            edges.append(_turned_back(edge, quarters, cells.seen.shape))
    return np.array(edges).reshape(-1, 3)


def _find_left_edge(cells: PageCells, p: PageCroppingParameters) -> Floats | None:
    """Line (a, b, c) along the left side of the sheet, where ground is seen beside it."""
    y, x = _left_borders(cells.paper, cells.seen, p)
    for _ in range(p.candidates):
        best = _on_one_line(y, x, p)
        if best.sum() < p.support * len(cells.paper):
            return None
        slope, intercept = np.polyfit(y[best], x[best], 1)
        if _is_edge(cells, slope, intercept, y[best].astype(int), p):
            # x counts the first cell of paper, whose left border is half a cell before.
            return np.array([1.0, -slope, -(intercept - 0.5 + p.inset)])
        y, x = y[~best], x[~best]
    return None


def _left_borders(paper: Mask, seen: Mask, p: PageCroppingParameters) -> tuple[Floats, Floats]:
    """Rows and columns (N,) of cells of paper with ground to the left of them, and more paper to the right."""
    ground = seen & ~paper
    width = paper.shape[1] - 2 * p.ground + 1
    border = np.ones((len(paper), max(width, 0)), bool)
    for step in range(p.ground):
        border &= ground[:, step : step + width] & paper[:, p.ground + step : p.ground + step + width]
    y, x = np.nonzero(border)
    return y.astype(np.float64), x.astype(np.float64) + p.ground


def _on_one_line(y: Floats, x: Floats, p: PageCroppingParameters) -> NDArray[np.bool_]:
    """Which points (N,) lie on the steep line that most lie on."""
    best = np.zeros(len(y), bool)
    if len(y) == 0:
        return best
    for slope in np.linspace(-p.steepest, p.steepest, 41):
        # The line of this slope that most points lie on: the densest window of their intercepts.
        intercept = x - slope * y
        order = np.sort(intercept)
        last = np.searchsorted(order, order + 2 * p.straightness, side="right")
        start = int(np.argmax(last - np.arange(len(order))))
        on = (intercept >= order[start]) & (intercept <= order[start] + 2 * p.straightness)
        best = on if on.sum() > best.sum() else best
    return best


def _is_edge(
    cells: PageCells, slope: float, intercept: float, borders: NDArray[np.int_], p: PageCroppingParameters
) -> bool:
    """Whether the sheet ends at x = slope y + intercept, which has ground beside paper in the rows `borders`."""
    paper, seen = cells.paper, cells.seen
    columns, lines = np.meshgrid(np.arange(paper.shape[1]), np.arange(paper.shape[0]))
    off = columns - (intercept + slope * lines)
    beyond = (paper & (off < -2 * p.straightness)).sum() / paper.sum()
    # Rows in which the line has paper on its inner side and something seen on its outer one.
    reach = 2 * p.straightness + 1
    inner = (paper & (off >= 0) & (off < reach)).any(axis=1)
    outer = (seen & (off < -1) & (off >= -reach)).any(axis=1)
    differs = np.zeros(len(paper), bool)
    both = inner & outer
    if cells.views:
        differs, other = _steps(cells.views, slope, intercept, p)
        # Past the sheet's corners the line has the desk on both sides.
        both &= ~other
    differs[borders] = True
    consent = (both & differs).sum() / max(both.sum(), 1)
    return bool(
        (beyond <= p.beyond and consent >= p.consent)
        or (beyond <= p.sure_beyond and consent >= p.sure_consent)
    )


def _steps(
    views: tuple[RgbImage, ...], slope: float, intercept: float, p: PageCroppingParameters
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Rows (h,) in which photos show something else left of the line than right of it: most of those that show both.

    And rows in which what they show right of it has another hue than along most of the line.
    """
    height, width = views[0].shape[:2]
    rows = np.arange(height)
    line = intercept + slope * rows
    inside, outside = (
        np.clip(np.round(line + shift).astype(int), 0, width - 1) for shift in (p.ground, -p.ground - 1)
    )
    votes = np.zeros((3, height), np.int16)
    for view in views:
        inner, outer = view[rows, inside].astype(np.float64), view[rows, outside].astype(np.float64)
        shown = inner.any(axis=1) & outer.any(axis=1)
        step = np.abs(np.log((inner + 1) / (outer + 1))).max(axis=1)
        votes[0] += shown
        votes[1] += 2 * (shown & (step > p.step))
        if shown.any():
            hue = np.log((inner + 1) / (inner.mean(axis=1, keepdims=True) + 1))
            away = np.linalg.norm(hue - np.median(hue[shown], axis=0), axis=1)
            votes[2] += 2 * (shown & (away > p.hue))
    differs, other = (votes[1:] > 0) & (votes[1:] >= votes[0])
    return differs, other


def _turned_back(edge: Floats, quarters: int, shape: tuple[int, ...]) -> Floats:
    """`edge` of an image turned counter-clockwise by `quarters`, in the image of `shape` before."""
    height, width = shape
    for left in range(quarters, 0, -1):
        # The turned point (x, y) was (w - 1 - y, x) in the image of width w before.
        w = width if left % 2 else height
        a, b, c = edge
        edge = np.array([-b, a, c + b * (w - 1)])
    return edge


def _within(edges: Floats, shape: tuple[int, ...]) -> Mask:
    x, y = np.meshgrid(np.arange(shape[1]), np.arange(shape[0]))
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

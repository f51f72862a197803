"""Cut of a flat view to the sheet: its outline, the gutter, edges that the flat view shows, the end of the print."""

from dataclasses import replace

import cv2
import numpy as np

from services.arrays import Mask, Points, RgbImage, Vector
from services.geometry.homographies import translation
from services.geometry.page_frame import Frame, resize_frame
from services.imaging.channels import luminance
from services.imaging.ground import sides_reached
from services.imaging.long_edges import LONG_SIDE_PX
from services.imaging.sheet_edges import SheetEdges, find_sheet_edges
from services.rectify.analysis.found_text import STRAY_SHARE
from services.rectify.analysis.page_analysis import PageAnalysis
from services.rectify.effort import WHOLE, Effort
from services.rectify.shape_choice.shaped_page import ShapedPage
from services.rectify.view.drawing import draw_flat_view
from services.rectify.view.flatness import NOT_FLAT_PERCENT
from services.rectify.view.outside_text import REACH, WORD
from services.rectify.view.paper_end import PaperEnd
from services.rectify.view.print_kept import groups_within
from services.sheet.outline.results import SheetOutline

NO_POINTS: Points = np.zeros((0, 2))
MOST_SPECKS = 0.02
"""Share of all characters that may lie beyond a side where they stand in no word: its own edge, a desk."""
SIDES = ("left", "top", "right", "bottom")
MAX_SLOPE = 0.2
"""Of a side in the flat view: a steeper one is not that of this page, or print is aslant on its sheet."""
GUTTER_MARGIN = 0.5
"""Text heights between the text and the cut at the gutter."""
SHOWN_STEP_PX = 8
"""Whether the photo shows a place of that view is computed at every eighth pixel."""
BLANK_MARGIN = 0.12
"""Of the text's larger size, kept beyond the print where the sheet's edge is not seen: margins of pages are as wide."""
CLOSE_SIDES = 2
"""Sides on which print, or the sheet, ends near the photo's frame, from which on the page alone is in view."""
INK_SIZE = 1.5
"""Text heights: what is wider is shadow or ground."""
INK_CONTRAST = 0.2
"""Of print to its surroundings, as a share of their brightness: above noise and edges of shadows."""
DARK = 16.0
"""Gray levels added to the surroundings, so that noise in the dark is not print."""
LEAST_INK_PX = 12
"""Within a text height of a row or column of the reduced view; fewer are specks."""


def cut_view(
    photo: RgbImage,
    frame: Frame,
    page: ShapedPage,
    end: PaperEnd,
    effort: Effort = WHOLE,
    more: Points = NO_POINTS,
) -> Frame:
    """`frame` cut to the page: its outline's sides, the gutter, edges in the flat view, blank ground.

    A brief `effort` looks at the outline alone. `more` (N, 2) are places of print beside the characters of the page.
    """
    if page.analysis is not None and page.shape.ends_at_sides:
        return frame
    known: frozenset[str] = frozenset()
    if page.outline is not None:
        may_wave = page.shape.kind == "curved"
        characters = np.concatenate([page.characters, more])
        frame, known = cut_to_outline(
            frame, page.outline, characters, page.text_height_px, believed=end.believed, may_wave=may_wave
        )
    if page.analysis is None or effort.is_brief:
        return frame
    frame = crop_to_gutter(frame, page.analysis)
    return cut_to_page(photo, frame, page.analysis, known, whole=end.whole, more=more)


def cut_to_outline(
    frame: Frame,
    outline: SheetOutline,
    characters: Points,
    text_height_px: float,
    *,
    believed: bool,
    may_wave: bool = False,
) -> tuple[Frame, frozenset[str]]:
    """`frame` cut at the sides of the `outline` that are seen, and which sides these are.

    A side that would cut off `characters` (N, 2), photo pixels, of `text_height_px` is not used. Outside of a
    `believed` outline they are specks of a desk; a few that stand in no word are so at every edge. Sides of a believed
    outline of a sheet that is no plane `may_wave`.
    """
    if believed:
        # To a pixel: what looks like a letter on the very edge of a sheet is its edge.
        characters = characters[outline.holds(characters, 1.0)]
    text = frame.to_flat(characters)
    characters, text = (points[np.isfinite(text).all(axis=1)] for points in (characters, text))
    centre = np.nanmedian(frame.to_flat(outline.polygon), axis=0)
    found: dict[str, float] = {}
    for side in outline.seen_sides:
        points = _finite(frame.to_flat(side.points))
        if len(points) < 2:
            continue
        middle = np.median(points, axis=0)
        way = np.linalg.svd(points - middle)[2][0]
        upright = abs(way[1]) > abs(way[0])
        axis = 0 if upright else 1
        if abs(way[axis]) > MAX_SLOPE * abs(way[1 - axis]):
            continue
        before = bool(middle[axis] < centre[axis])
        place = _cut_place(points[:, axis], frame.width, before=before, may_wave=believed and may_wave)
        beyond = text[:, axis] < place if before else text[:, axis] > place
        if _is_print(characters[beyond], len(text), text_height_px):
            continue
        found[("left" if before else "right") if upright else ("top" if before else "bottom")] = place
    return crop_frame(frame, SheetEdges(**found)), frozenset(found)


def _is_print(beyond: Points, count: int, text_height_px: float) -> bool:
    """Whether the characters `beyond` (N, 2) a side, photo pixels, of `count` in all, are more than its specks."""
    share = len(beyond) / max(count, 1)
    if share <= STRAY_SHARE or share > MOST_SPECKS:
        return share > STRAY_SHARE
    return bool(np.bincount(groups_within(beyond, REACH * text_height_px)).max() >= WORD)


def _cut_place(places: Vector, width: int, *, before: bool, may_wave: bool) -> float:
    """Where a side whose points lie at `places` (N,) along an axis of a view of `width` pixels is cut.

    In the middle of them; of a side that waves, as on crumpled paper, at the outermost one: beyond a believed outline
    the view is white, but paper that is cut off is lost with its print. A side of a plane that waves was followed along
    something else.
    """
    middle = float(np.median(places))
    outermost = float(places.min() if before else places.max())
    waves = abs(outermost - middle) > NOT_FLAT_PERCENT / 100 * width
    return outermost if may_wave and waves else middle


def crop_to_gutter(frame: Frame, analysis: PageAnalysis) -> Frame:
    """`frame` without what lies beyond the gutter, if a facing page was found; no text of the page is cut."""
    if analysis.gutter is None:
        return frame
    text, line = _finite(frame.to_flat(analysis.characters)), frame.to_flat(_dense(analysis.gutter))
    low, high = text.min(axis=0), text.max(axis=0)
    with np.errstate(invalid="ignore"):
        beside = line[(line[:, 1] >= low[1]) & (line[:, 1] <= high[1]), 0]
    if not len(beside):
        return frame
    gutter, margin = float(np.median(beside)), GUTTER_MARGIN * analysis.text_height_px
    if gutter > np.median(text[:, 0]):
        return crop_frame(frame, SheetEdges(right=max(gutter, float(high[0]) + margin)))
    return crop_frame(frame, SheetEdges(left=min(gutter, float(low[0]) - margin)))


def _dense(line: Points, count: int = 400) -> Points:
    """`line` (N, 2) with more points between its own."""
    steps = np.linspace(0, len(line) - 1, count)
    at = np.arange(len(line))
    return np.column_stack([np.interp(steps, at, line[:, 0]), np.interp(steps, at, line[:, 1])])


def cut_to_page(
    photo: RgbImage,
    frame: Frame,
    analysis: PageAnalysis,
    known: frozenset[str],
    *,
    whole: bool,
    more: Points = NO_POINTS,
) -> Frame:
    """`frame` cut on the sides that are not `known` yet: at long edges next to the text, or where blank ground begins.

    With `whole` the sheet's end is known all round; then lines inside of it are print, not edges.
    """
    if whole or len(known) == len(SIDES):
        return frame
    factor = min(1.0, LONG_SIDE_PX / max(frame.width, frame.height))
    small = resize_frame(frame, factor)
    view = draw_flat_view(photo, small)
    shown = shown_pixels(small, photo.shape[1], photo.shape[0])
    text = small.to_flat(np.concatenate([analysis.characters, more]))
    text_height_px = analysis.text_height_px * factor
    edges = find_sheet_edges(view, text, text_height_px, shown)
    edges = replace(edges, **{side: None for side in known})
    open_sides = [side for side in SIDES if side not in known and getattr(edges, side) is None]
    if open_sides:
        blank = blank_ground(view, shown, text, text_height_px)
        cut = [side for side in open_sides if getattr(blank, side) is not None]
        # Paper that goes on to the photo's frame is the sheet's, blank or not; with blank ground on all sides, it is a
        # table as white as the sheet.
        close = len(SIDES) - len(cut) >= CLOSE_SIDES
        paper = sides_reached(view, shown) if cut and close else frozenset()
        edges = replace(edges, **{side: getattr(blank, side) for side in cut if side not in paper})
    return crop_frame(frame, edges, factor)


def blank_ground(view: RgbImage, shown: Mask, text: Points, text_height_px: float) -> SheetEdges:
    """Edges at a margin from the outermost print of the `view` (H, W, 3), on sides with only blank ground beyond.

    `text` (N, 2) are characters, `shown` (H, W) the pixels that the photo shows. None on sides where print, a
    picture or a desk continues to the end of the view.
    """
    text = _finite(text)
    if not len(text):
        return SheetEdges()
    ink = _fine_structure(view, shown, round(INK_SIZE * text_height_px))
    low, high = np.quantile(text, STRAY_SHARE, axis=0), np.quantile(text, 1 - STRAY_SHARE, axis=0)
    margin = max(BLANK_MARGIN * float((high - low).max()), 3 * text_height_px)
    size = (view.shape[1], view.shape[0])
    edges: dict[str, float | None] = {}
    for axis, (before, after) in enumerate((("left", "right"), ("top", "bottom"))):
        near = np.convolve(ink.sum(axis=axis), np.ones(max(round(text_height_px), 1)), "same")
        inked = np.flatnonzero(near >= LEAST_INK_PX)
        first = min(float(low[axis]), float(inked[0]) if len(inked) else np.inf) - margin
        last = max(float(high[axis]), float(inked[-1]) if len(inked) else -np.inf) + margin
        edges[before] = first if first > 0 else None
        edges[after] = last if last < size[axis] - 1 else None
    return SheetEdges(**edges)


def _fine_structure(view: RgbImage, shown: Mask, size: int) -> Mask:
    """Pixels (H, W) of `view` that are darker than their surroundings and narrower than `size`: print, not shadows."""
    gray = luminance(view)
    around = cv2.morphologyEx(gray, cv2.MORPH_CLOSE, np.ones((size, size), np.uint8)).astype(np.float32)
    # The border of the photo is not print.
    rim = 2 * size + 1
    inside = cv2.erode(shown.astype(np.uint8), np.ones((rim, rim), np.uint8), borderValue=0)
    return np.asarray((around - gray > INK_CONTRAST * (around + DARK)) & (inside > 0))


def _finite(points: Points) -> Points:
    """Those of `points` (N, 2) that the page's map places."""
    return points[np.isfinite(points).all(axis=1)]


def crop_frame(frame: Frame, edges: SheetEdges, factor: float = 1.0) -> Frame:
    """`frame` cropped to `edges`, which are in pixels of the frame resized by `factor`."""

    def side(edge: float | None, otherwise: int, limit: int) -> int:
        return otherwise if edge is None else int(np.clip(round((edge + 0.5) / factor - 0.5), 0, limit))

    left, top = side(edges.left, 0, frame.width - 1), side(edges.top, 0, frame.height - 1)
    right = side(edges.right, frame.width - 1, frame.width - 1)
    bottom = side(edges.bottom, frame.height - 1, frame.height - 1)
    if right <= left or bottom <= top:
        return frame
    return frame.through(translation(float(left), float(top)), right - left + 1, bottom - top + 1)


def shown_pixels(frame: Frame, width: int, height: int) -> Mask:
    """Pixels (H, W) of the frame that lie well within a photo of `width` x `height`, to a step of a grid."""
    x, y = np.arange(0, frame.width, SHOWN_STEP_PX), np.arange(0, frame.height, SHOWN_STEP_PX)
    grid = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2).astype(np.float64) + 0.5 * (SHOWN_STEP_PX - 1)
    seen = frame.to_photo(grid)
    with np.errstate(invalid="ignore"):
        inside = ((seen >= 1) & (seen <= np.array([width, height]) - 2)).all(axis=1).reshape(len(y), len(x))
    cells = np.ones((SHOWN_STEP_PX, SHOWN_STEP_PX), bool)
    return np.asarray(np.kron(inside, cells)[: frame.height, : frame.width])

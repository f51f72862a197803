"""Cropping of a view to the sheet's edges that show only once the page is flat."""

import numpy as np

from services.arrays import Mask, Points
from services.geometry.homographies import translation
from services.geometry.page_frame import Frame
from services.imaging.sheet_edges import SheetEdges
from services.rectify.analysis.page_analysis import PageAnalysis

LONG_SIDE_PX = 700
"""Long side of the view in which edges are searched."""
MARGIN = 0.5
"""Text heights between the text and the cut at the gutter."""
GRID_STEP_PX = 8
"""Whether the photo shows a place of the view is computed at every eighth pixel."""


def crop_to_gutter(frame: Frame, analysis: PageAnalysis) -> Frame:
    """`frame` without what lies beyond the gutter, if a facing page was found; no text of the page is cut."""
    if analysis.gutter is None:
        return frame
    text, line = frame.to_flat(analysis.characters), frame.to_flat(_dense(analysis.gutter))
    text = text[np.isfinite(text).all(axis=1)]
    low, high = text.min(axis=0), text.max(axis=0)
    with np.errstate(invalid="ignore"):
        beside = line[(line[:, 1] >= low[1]) & (line[:, 1] <= high[1]), 0]
    if not len(text) or not len(beside):
        return frame
    gutter, margin = float(np.median(beside)), MARGIN * analysis.text_height_px
    if gutter > np.median(text[:, 0]):
        return crop_frame(frame, SheetEdges(right=max(gutter, float(high[0]) + margin)))
    return crop_frame(frame, SheetEdges(left=min(gutter, float(low[0]) - margin)))


def _dense(line: Points, count: int = 400) -> Points:
    """`line` (N, 2) with more points between its own."""
    steps = np.linspace(0, len(line) - 1, count)
    at = np.arange(len(line))
    return np.column_stack([np.interp(steps, at, line[:, 0]), np.interp(steps, at, line[:, 1])])


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
    """Pixels (H, W) of the frame that lie well within a photo of `width` x `height`, to a grid step."""
    x, y = np.arange(0, frame.width, GRID_STEP_PX), np.arange(0, frame.height, GRID_STEP_PX)
    grid = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2).astype(np.float64) + 0.5 * (GRID_STEP_PX - 1)
    seen = frame.to_photo(grid)
    with np.errstate(invalid="ignore"):
        inside = ((seen >= 1) & (seen <= np.array([width, height]) - 2)).all(axis=1).reshape(len(y), len(x))
    cells = np.ones((GRID_STEP_PX, GRID_STEP_PX), bool)
    return np.asarray(np.kron(inside, cells)[: frame.height, : frame.width])

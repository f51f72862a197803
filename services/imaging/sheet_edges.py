"""Where the sheet ends in a flat view that shows too much: its edge, the page stack under it, or the gutter.

These are long, nearly straight lines or steps of brightness next to the text that continue beyond it at its head and
foot, where rules, frames and pictures end with the print. The innermost one is taken.
"""

from dataclasses import dataclass

import numpy as np

from services.arrays import Floats, Mask, Points, RgbImage
from services.imaging.channels import log_brightness
from services.imaging.long_edges import LongEdge, LongEdgeParameters, find_long_edges

UPRIGHT = LongEdgeParameters()
LEVEL = LongEdgeParameters(contrast=0.15, share_of_view=0.85)
"""The upper and the lower edge: creases that run across a letter are fainter."""


# Contrasts are differences of the logarithm of brightness; lengths are pixels unless documented otherwise.
OUTLIERS = 1.0
"""Per cent of the characters that may lie beyond an edge, where a desk or the edges of a page stack follow it."""
STACK_EDGES = 2
"""This many more edges beyond are a page stack."""
STACK_STEP_PX = 6.0
"""Edges of a stack are apart by this."""
GROUND_CONTRAST = 0.15
"""A desk is brighter or darker by this."""
OUTER_PERCENTILE = 25.0
"""Of an edge's columns along the text, counted from outside: where a sloping edge is cut."""
CORNER_PX = 18.0
"""The upper and the lower edge meet the end of an upright one within this distance, ..."""
BEYOND_PX = (5, 25)
"""... or at these distances beyond them the ground is the same on both sides of an upright edge."""
ALIKE = 0.08
"""Grounds that differ by less are the same one: grain of wood is that uneven."""
LEAST_SEEN_PX = 40
"""Pixels of a ground that must be in view to compare it."""
MIN_MARGIN_PX = 8
BESIDE_PX = 20
"""Columns of the text that are used, with the margin, to measure the ground next to an edge."""
RIM = 0.004
"""Of the view's long side, by which the edges lie outside of what was found."""


@dataclass(frozen=True, slots=True)
class SheetEdges:
    """Where the sheet ends, pixels of the view; None on sides where nothing certain is seen."""

    left: float | None = None
    top: float | None = None
    right: float | None = None
    bottom: float | None = None


@dataclass(frozen=True, slots=True, eq=False)
class _Margin:
    """One side of the view, turned so that the sheet's edge is upright and the text lies to the right.

    `text` (N, 2) are its characters (column, row), `along` the first and last row of text.
    """

    brightness: Floats
    shown: Mask
    text: Points
    along: tuple[float, float]
    level: bool

    def mirrored(self) -> "_Margin":
        """The opposite side."""
        last = self.brightness.shape[1] - 1
        text = np.stack([last - self.text[:, 0], self.text[:, 1]], axis=1)
        return _Margin(self.brightness[:, ::-1], self.shown[:, ::-1], text, self.along, self.level)


@dataclass(frozen=True, slots=True)
class _Edge:
    """Column of an upright edge, and the rows where it, or an edge beyond it, begins and ends."""

    place: float
    begins: tuple[float, ...]
    ends: tuple[float, ...]
    path: LongEdge


def find_sheet_edges(
    view: RgbImage, text_points: Points, text_height_px: float, seen: Mask | None = None
) -> SheetEdges:
    """Edges of the sheet in the flat `view` (H, W, 3), beyond its text.

    `text_points` (N, 2) are centres of the characters, which may include some that are none, `text_height_px` is
    their size, and `seen` (H, W) marks the pixels that the photo shows; all if it is None. Of every side the
    innermost certain edge is taken, None rather than a guess.
    """
    height, width = view.shape[:2]
    text = text_points[np.isfinite(text_points).all(axis=1)]
    if not len(text):
        return SheetEdges()
    brightness = log_brightness(view)
    shown = np.ones((height, width), bool) if seen is None else seen
    low = np.percentile(text, OUTLIERS, axis=0) - text_height_px
    high = np.percentile(text, 100 - OUTLIERS, axis=0) + text_height_px
    upright = _Margin(brightness, shown, text, (float(low[1]), float(high[1])), level=False)
    left = _innermost_edge(upright, float(low[0]))
    right = _innermost_edge(upright.mirrored(), width - 1 - float(high[0]))
    first = 0 if left is None else max(int(left.place), 0)
    last = width if right is None else width - max(int(right.place), 0)
    level = _Margin(
        brightness[:, first:last].T,
        shown[:, first:last].T,
        (text - [first, 0])[:, ::-1],
        (float(low[0]) - first, float(high[0]) - first),
        level=True,
    )
    top = _innermost_edge(level, float(low[1]))
    bottom = _innermost_edge(level.mirrored(), height - 1 - float(high[1]))
    sides = [
        (edge, margin) for edge, margin in ((left, upright), (right, upright.mirrored())) if edge is not None
    ]
    if top is not None and not _ends_sides(top.place, sides, -1):
        top = None
    if bottom is not None and not _ends_sides(height - 1 - bottom.place, sides, 1):
        bottom = None
    rim = RIM * max(height, width)
    return SheetEdges(
        None if left is None else left.place - rim,
        None if top is None else top.place - rim,
        None if right is None else width - 1 - right.place + rim,
        None if bottom is None else height - 1 - bottom.place + rim,
    )


def _ends_sides(row: float, sides: list[tuple[_Edge, _Margin]], way: int) -> bool:
    """Whether upright edges end at a level one in `row`, above (-1) or below (1) which the sheet would have ended.

    At a corner of the sheet they do: beyond, the desk is on both sides of them. At a coloured band across the page they
    go on. Each of the `sides` is in the frame of its own margin.
    """
    for edge, margin in sides:
        ends = np.array(edge.begins if way < 0 else edge.ends)
        if (np.abs(ends - row) <= CORNER_PX).any() or _same_ground_beyond(edge.path, margin, row, way):
            return True
    return False


def _same_ground_beyond(edge: LongEdge, margin: _Margin, row: float, way: int) -> bool:
    """Whether the ground is the same left and right of an upright `edge`, where it would go on beyond `row`.

    It goes on from the text as it is nearest to `row`; beside the text its grounds differ.
    """
    near, far = UPRIGHT.ground_px
    beside = np.flatnonzero(edge.beside_text)
    nearest = beside[np.abs(edge.rows[beside] - row).argmin()]
    column = int(edge.columns[nearest])
    first, last = sorted(int(row) + way * distance for distance in BEYOND_PX)
    rows = slice(max(first, 0), max(last, 0))
    left, right = (
        _ground(margin, rows, slice(max(column + low, 0), max(column + high, 0)))
        for low, high in ((1 - far, 1 - near), (near, far))
    )
    return left is not None and right is not None and abs(left - right) < ALIKE and edge.ground_differs(ALIKE)


def _ground(margin: _Margin, rows: slice, columns: slice) -> float | None:
    """Median brightness of a part of the view; None where too little of it is in the photo."""
    seen = margin.brightness[rows, columns][margin.shown[rows, columns]]
    return float(np.median(seen)) if seen.size >= LEAST_SEEN_PX else None


def _innermost_edge(margin: _Margin, limit: float) -> _Edge | None:
    """The certain edge next to, and left of, column `limit`."""
    columns = min(int(limit), margin.brightness.shape[1])
    if columns < MIN_MARGIN_PX:
        return None
    beside = slice(None, columns + BESIDE_PX)
    found = find_long_edges(
        margin.brightness[:, beside],
        margin.shown[:, beside],
        margin.along,
        columns,
        LEVEL if margin.level else UPRIGHT,
    )
    places = np.array([np.percentile(edge.columns[edge.beside_text], OUTER_PERCENTILE) for edge in found])
    for k in np.argsort(-places):
        beyond = margin.text[:, 0] < found[k].at(margin.text[:, 1])
        further = np.unique(np.floor((places[k] - places) / STACK_STEP_PX))
        if not beyond.any() or (further > 0).sum() >= STACK_EDGES or found[k].ground_differs(GROUND_CONTRAST):
            outer = [edge for edge, place in zip(found, places, strict=True) if place <= places[k]]
            return _Edge(
                float(places[k]), tuple(e.first for e in outer), tuple(e.last for e in outer), found[k]
            )
    return None

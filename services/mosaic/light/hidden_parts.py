"""Parts of photos where glare, a shadow or a finger hides what other photos of the same place show."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import Homography, Mask
from services.geometry.homographies import scaling, transform_points, translation
from services.imaging.channels import strongest_channel
from services.mosaic.light.canvas import CELL_PX, Canvas, CanvasView, FloatImage
from services.mosaic.light.light_field import CLIPPED_LEVEL, CLOSING_PX, DARKEST, ITERATIONS, to_cells
from services.robust import cauchy_weights

LEAST_DEVIATION = 0.2
"""Logarithm of a ratio of paper's levels from which they differ. Light that is added to well exposed paper clips it
from here on; photos without anything in the way differ by 0.01 (95 % of their cells)."""
PAPER_SCALE = 0.05
"""Scale of the Cauchy loss with which the light on the paper is fitted."""
PRINT_CELLS = 3
"""Window in which print is compared, cells: two text lines."""
LEAST_PRINT = 0.04
"""Least darkness of a window with print, relative to its paper; noise and show-through have less."""
PRINT_LEFT = 0.5
"""Share of the print's darkness in other photos, below which it is lost. Blur does not change darkness: of photos
without anything in the way 1 % of the cells have less than 0.6 of it."""
WHITE_PAPER = 0.05
"""Share of the cells with print whose paper is clipped, from which on white paper is the page's, as for one photo
(`quality`). White pages have 0.4 to 0.6, sheets with glare in each photo at most 0.004."""
CLIPPED_SHARE = 0.5
"""Share of a cell from which it is clipped: its level tells nothing."""
WHOLE = 0.99
"""Share of a cell that a view shows, from which it is compared."""
REACH_CELLS = 2
"""Width of the rim of what hides something, which is not used either, and of a view's border, which is not compared."""
RIM_CELLS = 5
"""Window in which the rim of what hides the paper is an edge, cells: a twentieth of a view, for soft shadows."""
STEEP_SHARE = 0.5
"""Share of the rim that is such an edge."""
MOST_CELLS = 6000
"""Cells to which it is fitted; a smooth surface needs no more."""


@dataclass(frozen=True, slots=True, eq=False)
class HiddenPart:
    """`cells` (rows, columns) of the mosaic that are hidden, among those that are `shown`.

    `H_cells_mosaic` takes mosaic pixels to cells: a scale and a shift.
    """

    cells: Mask
    shown: Mask
    H_cells_mosaic: Homography

    def fraction(self, left: float, top: float, right: float, bottom: float) -> float:
        """Share of the cells that are shown within a rectangle of the mosaic, which are hidden."""
        corners = transform_points(self.H_cells_mosaic, np.array([[left, top], [right, bottom]], np.float64))
        first, last = np.maximum(np.ceil(corners), 0).astype(int)
        part = np.s_[first[1] : last[1], first[0] : last[0]]
        return float((self.cells & self.shown)[part].sum() / max(self.shown[part].sum(), 1))

    def over(self, left: float, top: float, side: float, width: int, height: int) -> Mask:
        """Which squares (height, width) of the mosaic are hidden, rims too, of `side` pixels, from (left, top) on."""
        middle = (side - 1) / 2
        H_mosaic_squares = translation(left + middle, top + middle) @ scaling(side)
        warped = cv2.warpAffine(
            _with_rim(self.cells).astype(np.uint8) * np.uint8(255),
            (self.H_cells_mosaic @ H_mosaic_squares)[:2],
            (width, height),
            flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
        )
        return np.asarray(warped > 127)


@dataclass(frozen=True, slots=True, eq=False)
class CellMeasures:
    """What a view shows in its cells (rows, columns).

    known : whether it shows the whole cell and those around it.
    levels : (..., 3) logarithm of the paper's colour, in matched light.
    darkness : mean darkness of the print relative to the paper, 0-1.
    clipped : whether the camera clipped the paper in all channels.
    """

    known: Mask
    levels: NDArray[np.float32]
    darkness: NDArray[np.float32]
    clipped: Mask


@dataclass(frozen=True, slots=True, eq=False)
class HiddenCells:
    """What something hides: of each view, cells (h, w) that another view shows; of the canvas, those that none shows.

    `shown` are the cells (rows, columns) of the canvas that any view covers, `clipped` those of them that are white in
    all of these, brighter than the page's paper, with a steep rim: glare.
    """

    of_views: tuple[Mask, ...]
    shown: Mask
    clipped: Mask


def find_hidden_cells(views: Sequence[CanvasView], gains: Sequence[FloatImage]) -> HiddenCells:
    """The cells of the views, and of the page, that glare, a shadow or a finger hides.

    `gains` (h, w, 3) make the light of the views agree, but for what changes within a small part of a view. The paper's
    light over the page is a smooth surface. Where views show different paper, the one that is most like it is right,
    unless print that others have is lost in it, or it is clipped.
    """
    measured = [_measure_cells(view, gain) for view, gain in zip(views, gains, strict=True)]
    places = [_cells_of(view) for view in views]
    rows, columns = (max(place[axis].stop for place in places) for axis in (0, 1))
    paper = _fit_paper(measured, places, (rows, columns))
    count, legible = np.zeros((2, rows, columns), np.uint8)
    clipped = np.zeros((rows, columns), bool)
    for at, cells in zip(places, measured, strict=True):
        count[at] += cells.known
        legible[at] += cells.known & ~cells.clipped
        # White paper is clipped as well, and ends at print and pictures with a steep rim.
        brighter = (cells.levels - paper[at]).mean(axis=2) > LEAST_DEVIATION / 2
        clipped[at] |= _with_steep_rim(cells.known & cells.clipped & brighter, cells)
    clipped &= legible == 0
    if clipped.any() and _has_white_paper(measured):
        clipped[:] = False
    shared = count > 1
    if not shared.any():
        return HiddenCells(tuple(np.zeros(cells.known.shape, bool) for cells in measured), count > 0, clipped)
    lost, away = _compare(measured, places, shared, paper)
    of_views = (
        _without_specks(lost[k] | _with_steep_rim(away[k], cells)) for k, cells in enumerate(measured)
    )
    return HiddenCells(tuple(of_views), count > 0, clipped)


def hidden_part(cells: Mask, shown: Mask, corner: tuple[int, int], canvas: Canvas) -> HiddenPart:
    """`cells` and `shown` cells of the canvas, or of a view with this first pixel (x, y), as parts of the mosaic."""
    # A pixel's, or a cell's, middle is half of its side from its corner; origins are middles.
    H_canvas_mosaic = (
        translation(-0.5, -0.5)
        @ scaling(canvas.scale)
        @ translation(0.5 - canvas.origin[0], 0.5 - canvas.origin[1])
    )
    H_cells_canvas = (
        translation(-0.5, -0.5) @ scaling(1 / CELL_PX) @ translation(0.5 - corner[0], 0.5 - corner[1])
    )
    return HiddenPart(cells, shown, H_cells_canvas @ H_canvas_mosaic)


def yielding_part(own: HiddenPart, leader: HiddenPart) -> HiddenPart:
    """The cells of a photo where its `leader` shows the page and nothing hides it."""
    # A hidden part is used with its rim: what lies next to what the leader hides is left out twice.
    clear = leader.shown & ~_with_rim(_with_rim(leader.cells))
    H_own_leader = own.H_cells_mosaic @ np.linalg.inv(leader.H_cells_mosaic)
    rows, columns = own.cells.shape
    warped = cv2.warpAffine(
        clear.astype(np.uint8), H_own_leader[:2], (columns, rows), flags=cv2.INTER_NEAREST
    )
    return replace(own, cells=np.asarray(warped > 0) & own.shown)


def show_only(view: CanvasView, hidden: Mask) -> CanvasView:
    """The view without its `hidden` cells and their rims, whose borders are borders of what it shows."""
    if not hidden.any():
        return view
    side = np.ones((CELL_PX, CELL_PX), np.uint8)
    shown = view.shown & (np.kron(_with_rim(hidden).astype(np.uint8), side) == 0)
    feather = cv2.distanceTransform(np.pad(shown.astype(np.uint8), 1), cv2.DIST_L2, 3)[1:-1, 1:-1]
    return replace(view, shown=shown, feather=np.asarray(feather, np.float32))


def _cells_of(view: CanvasView) -> tuple[slice, slice]:
    """Rows and columns of the view's cells among those of the canvas."""
    down, across = view.box
    return (
        slice(down.start // CELL_PX, down.stop // CELL_PX),
        slice(across.start // CELL_PX, across.stop // CELL_PX),
    )


def _measure_cells(view: CanvasView, gain: FloatImage) -> CellMeasures:
    image = cv2.copyTo(view.image, view.shown.view(np.uint8)).astype(np.uint8)
    closed = cv2.morphologyEx(image, cv2.MORPH_CLOSE, np.ones((CLOSING_PX,) * 2, np.uint8))
    paper = np.asarray(closed, np.uint8)
    shown = to_cells(view.shown.astype(np.float32)) > WHOLE
    ground = to_cells(paper)
    gray, bright = strongest_channel(to_cells(image)), strongest_channel(ground)
    window = (PRINT_CELLS, PRINT_CELLS)
    print_, ground_ = (cv2.blur(np.where(shown, each, 0), window) for each in (bright - gray, bright))
    darkness = np.asarray(print_ / np.maximum(ground_, 1.0), np.float32)
    # At the border nothing lighter surrounds the print.
    inner = np.ones((2 * REACH_CELLS + 1,) * 2, np.uint8)
    known = cv2.erode(shown.astype(np.uint8), inner, borderType=cv2.BORDER_CONSTANT, borderValue=0) > 0
    white = cv2.inRange(paper, (CLIPPED_LEVEL,) * 3, (255,) * 3)
    clipped = to_cells(np.asarray(white, np.uint8)) > 255 * CLIPPED_SHARE
    levels = np.log(np.maximum(ground * gain[CELL_PX // 2 :: CELL_PX, CELL_PX // 2 :: CELL_PX], DARKEST))
    return CellMeasures(known, levels, darkness, clipped)


def _fit_paper(
    measured: Sequence[CellMeasures], places: Sequence[tuple[slice, slice]], shape: tuple[int, int]
) -> FloatImage:
    """Levels (rows, columns, 3) of bare paper: a quadratic surface, fitted robustly to cells with print; 0 if no view
    shows a cell."""
    y, x = np.meshgrid(*(np.linspace(-1, 1, side) for side in shape), indexing="ij")
    surface = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=-1)
    used = [cells.known & (cells.darkness > LEAST_PRINT) for cells in measured]
    if not any(each.any() for each in used):
        used = [cells.known for cells in measured]
    A = np.concatenate([surface[at][each] for at, each in zip(places, used, strict=True)])
    b = np.concatenate([cells.levels[each] for cells, each in zip(measured, used, strict=True)])
    if not len(A):
        return np.zeros((*shape, 3), np.float32)
    step = max(len(A) // MOST_CELLS, 1)
    A, b = A[::step], b[::step].astype(np.float64)
    left = b - np.median(b, axis=0)
    for _ in range(ITERATIONS):
        weighted = A * cauchy_weights(np.sqrt((left**2).mean(axis=1)), PAPER_SCALE)[:, None]
        solved = np.linalg.solve(weighted.T @ A + 1e-6 * len(A) * np.eye(A.shape[1]), weighted.T @ b)
        left = b - A @ solved
    return np.asarray(surface @ solved, np.float32)


def _has_white_paper(measured: Sequence[CellMeasures]) -> bool:
    """Whether paper round print is clipped: no glare can be told from it. Glare hides print."""
    printed = [cells.known & (cells.darkness > LEAST_PRINT) for cells in measured]
    white = sum(int((each & cells.clipped).sum()) for each, cells in zip(printed, measured, strict=True))
    return white > WHITE_PAPER * sum(int(each.sum()) for each in printed)


def _compare(
    measured: Sequence[CellMeasures], places: Sequence[tuple[slice, slice]], shared: Mask, paper: FloatImage
) -> tuple[list[Mask], list[Mask]]:
    """For each view its cells whose print is lost, and those whose level is not that of the view that is right."""
    count = int(shared.sum())
    levels = np.zeros((len(measured), count, 3), np.float32)
    darkness = np.zeros((len(measured), count), np.float32)
    clipped, known = np.zeros((2, len(measured), count), bool)
    for k, (cells, at) in enumerate(zip(measured, places, strict=True)):
        inside = np.zeros(shared.shape, bool)
        inside[at] = cells.known
        known[k] = inside[shared]
        there = cells.known & shared[at]
        levels[k, known[k]], darkness[k, known[k]] = cells.levels[there], cells.darkness[there]
        clipped[k, known[k]] = cells.clipped[there]
    beyond = np.where(known, np.abs(levels - paper[shared]).max(axis=2), np.inf)
    # Print counts where it lies on paper; where no view shows paper, where it is not clipped.
    trusted = np.where(beyond.min(axis=0) < LEAST_DEVIATION, beyond < LEAST_DEVIATION, known & ~clipped)
    print_ = np.where(trusted, darkness, 0).max(axis=0)
    lost = known & (darkness < PRINT_LEFT * print_) & (print_ > LEAST_PRINT)
    away = known & (
        _apart(levels, beyond + np.where(lost, 1e3, 0) + np.where(clipped, 1e2, 0)) > LEAST_DEVIATION
    )
    masks = []
    for values in (lost, away):
        whole = np.zeros((len(measured), *shared.shape), bool)
        whole[:, shared] = values
        masks.append([whole[k][at] for k, at in enumerate(places)])
    return masks[0], masks[1]


def _apart(levels: NDArray[np.float32], unfit: NDArray[np.float32]) -> NDArray[np.float32]:
    """Largest difference (views, N) in a channel from the level of the view that is least `unfit`."""
    right = np.take_along_axis(levels, unfit.argmin(axis=0)[None, :, None], axis=0)
    return np.asarray(np.abs(levels - right).max(axis=2), np.float32)


def _with_steep_rim(away: Mask, cells: CellMeasures) -> Mask:
    """The connected parts of `away` whose rim is an edge in this view: uneven light that is left has none."""
    if not away.any():
        return away
    window = np.ones((RIM_CELLS, RIM_CELLS), np.uint8)
    known = cells.known[..., None]
    highest = cv2.dilate(np.where(known, cells.levels, cells.levels.min()), window)
    lowest = cv2.erode(np.where(known, cells.levels, cells.levels.max()), window)
    step = np.where(cells.known, (highest - lowest).max(axis=2), 0)
    around = (cv2.dilate(away.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0) & ~away & cells.known
    count, parts = cv2.connectedComponents(away.astype(np.uint8))
    near = cv2.dilate(parts.astype(np.float32), np.ones((3, 3), np.uint8)).astype(np.intp)[around]
    rim = np.bincount(near, minlength=count)
    steep = np.bincount(near[step[around] > LEAST_DEVIATION / 2], minlength=count)
    kept = steep > STEEP_SHARE * rim
    kept[0] = False
    return np.asarray(kept[parts])


def _without_specks(hidden: Mask) -> Mask:
    """The cells, but for places smaller than two by two of them."""
    return np.asarray(
        cv2.morphologyEx(hidden.astype(np.uint8), cv2.MORPH_OPEN, np.ones((2, 2), np.uint8)) > 0
    )


def _with_rim(hidden: Mask) -> Mask:
    """The cells and what lies within `REACH_CELLS` of them."""
    side = np.ones((2 * REACH_CELLS + 1,) * 2, np.uint8)
    return np.asarray(cv2.dilate(hidden.astype(np.uint8), side) > 0)

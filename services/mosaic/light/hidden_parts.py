"""Parts of photos where glare, a shadow or a finger hides what other photos of the same place show."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import Floats, Homography, Mask
from services.geometry.homographies import scaling, translation
from services.imaging.channels import strongest_channel
from services.mosaic.light.canvas import CELL_PX, Canvas, CanvasView, FloatImage
from services.mosaic.light.light_field import CLIPPED_LEVEL, CLOSING_PX, DARKEST, to_cells
from services.robust import cauchy_weights

LEAST_DEVIATION = 0.2
"""Logarithm of a ratio of paper's levels from which they differ. Light that is added to well exposed paper clips it
from here on; photos without anything in the way differ by 0.01 (95 % of their cells)."""
DEVIATIONS = 6.0
"""The same in robust standard deviations of all cells: bent sheets are shaded unevenly."""
PAPER_SCALE = 0.05
"""Scale of the Cauchy loss with which the light on the paper is fitted."""
PAPER_ITERATIONS = 6
PRINT_CELLS = 3
"""Window in which print is compared, cells: two text lines."""
LEAST_PRINT = 0.04
"""Least darkness of a window with print, relative to its paper; noise and show-through have less."""
PRINT_LEFT = 0.5
"""Share of the print's darkness in other photos, below which it is lost. Blur does not change darkness: of photos
without anything in the way 1 % of the cells have less than 0.6 of it."""
CLIPPED_SHARE = 0.5
"""Share of a cell from which it is clipped: its level tells nothing."""


@dataclass(frozen=True, slots=True, eq=False)
class HiddenPart:
    """Cells (rows, columns) of the mosaic that something hides from a photo, and that another photo shows.

    `H_cells_mosaic` takes mosaic pixels to cells.
    """

    cells: Mask
    H_cells_mosaic: Homography

    def over(self, left: float, top: float, side: float, width: int, height: int) -> Mask:
        """Which squares (height, width) of the mosaic are hidden: of `side` pixels, the first one's corner pixel given."""
        middle = (side - 1) / 2
        H_mosaic_squares = translation(left + middle, top + middle) @ scaling(side)
        warped = cv2.warpAffine(
            self.cells.astype(np.uint8) * np.uint8(255),
            (self.H_cells_mosaic @ H_mosaic_squares)[:2],
            (width, height),
            flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
        )
        return np.asarray(warped > 127)


@dataclass(frozen=True, slots=True, eq=False)
class CellMeasures:
    """What the views show in the canvas's cells, (views, rows, columns); NaN where a view does not show the cell.

    levels : (..., 3) logarithm of the paper's colour, in matched light.
    darkness : mean darkness of the print relative to the paper, 0-1.
    clipped : whether the camera clipped the paper.
    """

    levels: NDArray[np.float32]
    darkness: NDArray[np.float32]
    clipped: Mask


def find_hidden_cells(views: Sequence[CanvasView], gains: Sequence[FloatImage]) -> list[Mask]:
    """For each view, its cells (rows, columns) that something hides, and that another view shows.

    `gains` (h, w, 3) make the light of the views agree, but for what changes within a small part of a view. The paper's
    light over the page is a smooth surface. Where views show different paper, the one that is most like it is right,
    unless print that others have is lost in it, or it is clipped.
    """
    places = [_cells_of(view) for view in views]
    if len(views) < 2:
        return [np.zeros(to_cells(view.feather).shape, bool) for view in views]
    cells = _measure_cells(views, gains, places)
    beyond = _beyond_paper(cells)
    known = np.isfinite(cells.darkness)
    shared = known.sum(axis=0) > 1
    deviation = np.where(known, np.abs(beyond).max(axis=3), np.inf)
    best = deviation.min(axis=0)
    usual = np.median(_apart(cells, deviation, known)[known & shared]) if shared.any() else 0.0
    least = max(LEAST_DEVIATION, DEVIATIONS * 1.4826 * float(usual))
    # Print counts where it lies on paper; where no view shows paper, where it is not clipped.
    trusted = np.where(best < least, deviation < least, known & ~cells.clipped)
    print_ = np.where(trusted, cells.darkness, 0).max(axis=0)
    with np.errstate(invalid="ignore"):
        lost = (cells.darkness < PRINT_LEFT * print_) & (print_ > LEAST_PRINT)
    fit = deviation + np.where(lost, 1e3, 0) + np.where(cells.clipped, 1e2, 0)
    hidden = (lost | (_apart(cells, fit, known) > least)) & known & shared
    return [_without_specks(hidden[k][at]) for k, at in enumerate(places)]


def hidden_part(cells: Mask, view: CanvasView, canvas: Canvas) -> HiddenPart:
    """`cells` of a view, as a part of the mosaic."""
    # A pixel's, or a cell's, middle is half of its side from its corner; origins are middles.
    H_canvas_mosaic = (
        translation(-0.5, -0.5)
        @ scaling(canvas.scale)
        @ translation(0.5 - canvas.origin[0], 0.5 - canvas.origin[1])
    )
    H_cells_canvas = (
        translation(-0.5, -0.5) @ scaling(1 / CELL_PX) @ translation(0.5 - view.left, 0.5 - view.top)
    )
    return HiddenPart(cells, H_cells_canvas @ H_canvas_mosaic)


def show_only(view: CanvasView, hidden: Mask) -> CanvasView:
    """The view without its `hidden` cells, whose borders are borders of what it shows."""
    if not hidden.any():
        return view
    side = np.ones((CELL_PX, CELL_PX), np.uint8)
    shown = view.shown & (np.kron(hidden.astype(np.uint8), side) == 0)
    feather = cv2.distanceTransform(np.pad(shown.astype(np.uint8), 1), cv2.DIST_L2, 3)[1:-1, 1:-1]
    return replace(view, shown=shown, feather=np.asarray(feather, np.float32))


def _cells_of(view: CanvasView) -> tuple[slice, slice]:
    """Rows and columns of the view's cells among those of the canvas."""
    down, across = view.box
    return (
        slice(down.start // CELL_PX, down.stop // CELL_PX),
        slice(across.start // CELL_PX, across.stop // CELL_PX),
    )


def _measure_cells(
    views: Sequence[CanvasView], gains: Sequence[FloatImage], places: Sequence[tuple[slice, slice]]
) -> CellMeasures:
    rows, columns = (max(place[axis].stop for place in places) for axis in (0, 1))
    levels = np.full((len(views), rows, columns, 3), np.nan, np.float32)
    darkness = np.full((len(views), rows, columns), np.nan, np.float32)
    clipped = np.zeros((len(views), rows, columns), bool)
    window = (PRINT_CELLS, PRINT_CELLS)
    for k, (view, gain, at) in enumerate(zip(views, gains, places, strict=True)):
        image = np.where(view.shown[..., None], view.image, 0).astype(np.float32)
        paper = cv2.morphologyEx(image, cv2.MORPH_CLOSE, np.ones((CLOSING_PX,) * 2, np.uint8))
        whole = to_cells(view.shown.astype(np.float32)) > 0.99
        gray, bright = to_cells(strongest_channel(image)), to_cells(strongest_channel(paper))
        dark = cv2.blur(np.where(whole, bright - gray, 0), window)
        dark /= np.maximum(cv2.blur(np.where(whole, bright, 0), window), 1.0)
        levels[k][at] = np.where(whole[..., None], np.log(np.maximum(to_cells(paper * gain), DARKEST)), np.nan)
        darkness[k][at] = np.where(whole, dark, np.nan)
        least = strongest_channel(255 - paper)  # The darkest channel's distance from white.
        clipped[k][at] = to_cells((least <= 255 - CLIPPED_LEVEL).astype(np.float32)) > CLIPPED_SHARE
    return CellMeasures(levels, darkness, clipped)


def _beyond_paper(cells: CellMeasures) -> NDArray[np.float32]:
    """Difference (views, rows, columns, 3) of the levels from those of the paper: a quadratic surface, fitted robustly to
    the cells with print, whose ground is paper."""
    _, rows, columns = cells.darkness.shape
    y, x = np.meshgrid(np.linspace(-1, 1, rows), np.linspace(-1, 1, columns), indexing="ij")
    surface = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=-1)
    with np.errstate(invalid="ignore"):
        printed = cells.darkness > LEAST_PRINT
    used = printed if printed.sum() > 10 * surface.shape[-1] else np.isfinite(cells.darkness)
    A: Floats = np.broadcast_to(surface, (*used.shape, surface.shape[-1]))[used][::3]
    b: Floats = cells.levels[used][::3].astype(np.float64)
    left = b - np.median(b, axis=0)
    for _ in range(PAPER_ITERATIONS):
        weighted = A * cauchy_weights(np.sqrt((left**2).mean(axis=1)), PAPER_SCALE)[:, None]
        solved = np.linalg.solve(weighted.T @ A + 1e-6 * len(A) * np.eye(A.shape[1]), weighted.T @ b)
        left = b - A @ solved
    return np.asarray(cells.levels - (surface @ solved).astype(np.float32), np.float32)


def _apart(cells: CellMeasures, fit: NDArray[np.float32], known: Mask) -> NDArray[np.float32]:
    """Largest difference (views, rows, columns) in a channel from the level of the view of least `fit`; 0 if unknown."""
    right = np.take_along_axis(cells.levels, fit.argmin(axis=0)[None, ..., None], axis=0)
    return np.asarray(np.where(known, np.abs(cells.levels - right).max(axis=3), 0), np.float32)


def _without_specks(hidden: Mask) -> Mask:
    """The cells and their neighbours, but for places smaller than two by two cells."""
    opened = cv2.morphologyEx(hidden.astype(np.uint8), cv2.MORPH_OPEN, np.ones((2, 2), np.uint8))
    return np.asarray(cv2.dilate(opened, np.ones((3, 3), np.uint8)) > 0)

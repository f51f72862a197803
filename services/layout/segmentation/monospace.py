"""Rows of monospaced print, as of typewriters and listings of programs, and the width of their cells."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from services.layout.segmentation.components import Boxes, Indices
from services.layout.segmentation.parameters import SegmentationParameters
from services.order_statistics import median, quantile

_WIDTHS = np.arange(0.6, 1.6, 0.01)
"""Of cells, over the height of the row's glyphs."""


def cell_widths(
    glyphs: Boxes, members: Sequence[Indices], parameters: SegmentationParameters
) -> NDArray[np.float64]:
    """Width of the cells of each row (R,), px; 0 for rows whose glyphs do not stand in cells.

    Glyphs stand in the middle of their cells: for a cell of width c the phases 2 pi x / c of their centres x are alike.
    A row of few glyphs has the cells of the rows around it, if it fits them.

    Parameters
    ----------
    glyphs
        (N, 4) boxes.
    members
        Of each row, indices of its glyphs.
    """
    sure = np.array([_cell_width(glyphs[own], parameters) for own in members])
    cells = sure.copy()
    if not np.any(sure):
        return cells
    boxes = np.array(
        [np.concatenate([glyphs[own, :2].min(axis=0), glyphs[own, 2:].max(axis=0)]) for own in members]
    )
    middle, height = (boxes[:, 1] + boxes[:, 3]) / 2, boxes[:, 3] - boxes[:, 1]
    for row in np.flatnonzero(sure == 0).tolist():
        near = (sure > 0) & (np.abs(middle - middle[row]) < parameters.gutter_reach * height[row])
        near &= (boxes[:, 0] < boxes[row, 2]) & (boxes[row, 0] < boxes[:, 2])
        if np.any(near):
            cell = median(sure[near])
            if concentration(glyphs[members[row]], np.array([cell]))[0] > parameters.least_concentration:
                cells[row] = cell
    return cells


def concentration(glyphs: Boxes, cells: NDArray[np.float64]) -> NDArray[np.float64]:
    """How alike the places of glyphs are in cells of each width (C,): the length of the mean phase, 0-1."""
    centres = (glyphs[:, 0] + glyphs[:, 2]) / 2
    return np.asarray(np.abs(np.exp(2j * np.pi * centres[:, None] / cells).mean(axis=0)))


def _cell_width(glyphs: Boxes, parameters: SegmentationParameters) -> float:
    if len(glyphs) < parameters.least_cells:
        return 0.0
    tried = quantile(glyphs[:, 3] - glyphs[:, 1], 0.6) * _WIDTHS
    found = concentration(glyphs, tried)
    best = int(np.argmax(found))
    is_sure = len(glyphs) * found[best] ** 2 > parameters.least_surprise
    return float(tried[best]) if is_sure and found[best] > parameters.least_concentration else 0.0

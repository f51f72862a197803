"""Rows of monospaced print, as of typewriters and listings of programs, and the width of their cells."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from services.layout.segmentation.components import Boxes, Indices
from services.layout.segmentation.typical_print import ROW_REACH
from services.order_statistics import median, quantile

_LEAST_CONCENTRATION = 0.65
"""Of the places of a monospaced row's glyphs in their cells."""
_LEAST_SURPRISE = 10
"""A concentration c of n glyphs comes by chance exp(-n c^2) times: the exponent is larger, so there are more glyphs."""


_WIDTHS = np.arange(0.6, 1.6, 0.01)
"""Of cells, over the height of the row's glyphs."""


def cell_widths(glyphs: Boxes, members: Sequence[Indices]) -> NDArray[np.float64]:
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
    sure = np.array([_cell_width(glyphs[own]) if len(own) > _LEAST_SURPRISE else 0.0 for own in members])
    cells = sure.copy()
    known = np.flatnonzero(sure)
    if not len(known):
        return cells
    counts = np.array([len(own) for own in members])
    starts = np.concatenate([[0], np.cumsum(counts)[:-1]])
    ordered = glyphs[np.concatenate(members)]
    x0, y0 = np.minimum.reduceat(ordered[:, :2], starts).T
    x1, y1 = np.maximum.reduceat(ordered[:, 2:], starts).T
    away = np.abs((y0 + y1)[:, None] - (y0 + y1)[known]) / 2
    near = (away < ROW_REACH * (y1 - y0)[:, None]) & (x0[known] < x1[:, None])
    near &= x0[:, None] < x1[known]
    for row in np.flatnonzero((sure == 0) & near.any(axis=1)).tolist():
        cell = median(sure[known[near[row]]])
        if concentration(glyphs[members[row]], np.array([cell]))[0] > _LEAST_CONCENTRATION:
            cells[row] = cell
    return cells


def concentration(glyphs: Boxes, cells: NDArray[np.float64]) -> NDArray[np.float64]:
    """How alike the places of glyphs are in cells of each width (C,): the length of the mean phase, 0-1."""
    centres = (glyphs[:, 0] + glyphs[:, 2]) / 2
    turns = centres[:, None] / cells
    # Within one turn single precision is exact to 1e-7, and takes a twentieth of the complex exponential's time.
    phases = (2 * np.pi * (turns - np.floor(turns))).astype(np.float32)
    mean = [part.mean(axis=0, dtype=np.float64) for part in (np.cos(phases), np.sin(phases))]
    return np.asarray(np.hypot(*mean))


def _cell_width(glyphs: Boxes) -> float:
    tried = quantile(glyphs[:, 3] - glyphs[:, 1], 0.6) * _WIDTHS
    found = concentration(glyphs, tried)
    best = int(np.argmax(found))
    is_sure = len(glyphs) * found[best] ** 2 > _LEAST_SURPRISE
    return float(tried[best]) if is_sure and found[best] > _LEAST_CONCENTRATION else 0.0

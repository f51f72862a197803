"""Standard deviations of the fit of a creased sheet, and the stages of the fit."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True)
class Stage:
    """One of several successive fits: the last one does not converge from a start that is further off.

    `cells` of the mesh across the sheet; `scale` of the robust loss of observations, in deviations; `slack`, by which
    factor the sheet may stretch more than paper; `ridge`, scale of the robust loss of ridges.
    """

    cells: int
    scale: float
    slack: float
    ridge: float


# Standard deviations; lengths are relative to what is named.
STRETCH = 0.002
"""Of an edge's length, in steps: paper does not stretch, but a ridge within a cell shortens its edges."""
LEAST_LINE = 0.02
"""Text heights, least deviation of a line's point; else it has its own."""
SPACING = 0.02
"""Of the step from a line to the next, in line spacings: type is set evenly, but a baseline is seen through
letters."""
STROKE_RAD = np.deg2rad(0.8)
FLOW_RAD = np.deg2rad(1.0)
"""Of a text line's direction; weights are as for strokes."""
MARGIN = 0.4
"""Of a flush end, in text heights."""
LEAST_SIDE = 0.0006
"""Photo units, least deviation of a side's point; else it has its own: the side of a sheet is cut as straight as
that, and not found better."""
MAX_DAMPING = 1e6
"""Of a step, relative to the diagonal: beyond it no step helps."""


@dataclass(frozen=True, slots=True)
class RidgedParameters:
    """Standard deviations; lengths are relative to what is named."""

    bend_rad: float = 0.3
    """Of the angle over the width of the sheet where there is no ridge; a cell has its share."""
    schedule: tuple[Stage, ...] = (
        Stage(12, 100.0, 10.0, 30.0),
        Stage(12, 10.0, 3.0, 3.0),
        Stage(24, 1.0, 1.0, 1.0),
    )
    evaluations: int = 12
    """Of each stage, at most."""
    gain: float = 3e-3
    """Relative decrease of the cost below which a stage ends."""

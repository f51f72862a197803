"""Observations of the page's shape in a photo: flows, traced text lines, line spacing, margins."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from services.arrays import Mask, Points, Vector
from services.geometry.camera import PrincipalPointPrior
from services.texture_flow.field import FlowSamples

# Standard deviations of what print shows, on flat and on bent sheets.
FLOW_OVERLAP = 12.0
"""Windows of neighbouring major samples share ink: this many count as one."""
STROKE_OVERLAP = 4.0
"""Windows of neighbouring minor samples share ink: this many count as one."""
SLANT_MEAN_RAD = np.deg2rad(0.2)
MARGIN_DEVIATION = 0.25
"""Deviation of a flush end in text heights (side bearings)."""
TILT_RAD = np.deg2rad(35.0)
"""People hold a camera approximately over the page; it decides only where the page shows nothing."""


@dataclass(frozen=True, slots=True)
class ObservationParameters:
    """Standard deviations of what print shows, on flat and on bent sheets."""

    slant_rad: float = np.deg2rad(0.15)
    """Flag serifs and round strokes make roman type appear slanted: by 0.14 to 0.18 degrees on ten sharp pages at
    seven angles, 0.25 to 0.4 blurred. One unknown slant with this prior accounts for it (and for a few italics)."""
    spacing: float = 0.012
    """Deviation of a line's place over the spacing, and of the logarithm of spacings of different paragraphs that are
    taken as equal."""


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """Lines of equal spacing: `lines` (n,) are line numbers, `order` (n,) their places in the paragraph."""

    lines: NDArray[np.intp]
    order: Vector


@dataclass(frozen=True, slots=True, eq=False)
class LineObservations:
    """Traced text lines in centred coordinates.

    `points` (M, 2) lie on lines `index` (M,), with `deviations` (M,) across the line in centred units. `runs` are
    lines of equal spacing, `alike` groups of run numbers with nearly the same spacing, `margins` the points (n, 2) of
    ends that are flush. `text_height` is in centred units.
    """

    points: Points
    index: NDArray[np.intp]
    deviations: Vector
    runs: list[Run]
    alike: list[NDArray[np.intp]]
    margins: list[Points]
    text_height: float

    @property
    def count(self) -> int:
        """Number of lines."""
        return int(self.index.max()) + 1 if len(self.index) else 0


NO_LINES = LineObservations(np.zeros((0, 2)), np.zeros(0, np.intp), np.zeros(0), [], [], [], 0.01)


@dataclass(frozen=True, slots=True, eq=False)
class SideObservations:
    """Points of the sheet's sides in centred coordinates.

    `points` (M, 2) lie on sides `index` (M,): 0 and 2 along the text lines, 1 and 3 across them; `deviations` (M,) are
    across the side. On the flat page each side is straight and all meet at right angles; the print may be askew
    on its sheet.
    """

    points: Points
    index: NDArray[np.intp]
    deviations: Vector

    @property
    def upright(self) -> Mask:
        """Which points (M,) lie on sides across the text lines."""
        return np.asarray(self.index % 2 == 1)


NO_EDGES = SideObservations(np.zeros((0, 2)), np.zeros(0, np.intp), np.zeros(0))


@dataclass(frozen=True, slots=True, eq=False)
class PageObservations:
    """All that a surface is fitted to, in centred unit coordinates.

    `hull` (H, 2) surrounds the text, where rulings must not cross; `log_focal` and `focal_deviation` are the prior
    of the focal length; `edges` are those of the sheet where they are seen.
    """

    major: FlowSamples
    minor: FlowSamples
    lines: LineObservations
    hull: Points
    log_focal: float
    focal_deviation: float
    edges: SideObservations = NO_EDGES
    principal_point: PrincipalPointPrior | None = None
    """None: the principal point is the origin."""

"""Observations of a creased sheet in a photo: its text, its strokes, its sides."""

from dataclasses import dataclass

from services.arrays import Points, Vector
from services.sheet.developable.observations import LineObservations
from services.sheet.ridged.views import OtherView
from services.texture_flow.field import FlowSamples


@dataclass(frozen=True, slots=True, eq=False)
class SideObservations:
    """Points (N, 2) on one side of the sheet, centred units, and their deviations (N,) across it."""

    points: Points
    deviations: Vector


@dataclass(frozen=True, slots=True, eq=False)
class SheetObservations:
    """What the mesh is fitted to, in centred units.

    `sides` are top, right, bottom and left of the page, None where one is not seen. `flow` are directions of text
    lines: less precise than traced lines, but known also where no line can be followed over a crease.
    """

    lines: LineObservations
    strokes: FlowSamples | None
    sides: tuple[SideObservations | None, ...]
    log_focal: float
    focal_deviation: float
    flow: FlowSamples | None = None
    views: tuple[OtherView, ...] = ()

"""Residuals of a creased sheet and their derivatives: of the observations, and of the properties of paper.

The places of the observed photo points on the sheet are computed again at every step: the points of a text line share
one row, lines of a paragraph are equally spaced, flush ends share one column, strokes run along the columns (but for
the slant of the type), and the sheet's own sides are the mesh's border. Paper does not stretch (edges and diagonals
of cells keep their lengths) and is flat except at few ridges (second differences under Cauchy's loss: the cost of a
ridge is about the logarithm of its angle).
"""

from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from services.arrays import Points, Vector
from services.sheet.developable.observations import SLANT_MEAN_RAD, STROKE_OVERLAP, LineObservations
from services.sheet.ridged.blocks import ResidualBlock, SparseRows, single_entries
from services.sheet.ridged.mesh import SheetMesh, invert_2x2
from services.sheet.ridged.observations import SheetObservations, SideObservations
from services.sheet.ridged.paper import PaperResiduals
from services.sheet.ridged.parameters import (
    FLOW_RAD,
    LEAST_LINE,
    LEAST_SIDE,
    MARGIN,
    SPACING,
    STROKE_RAD,
    RidgedParameters,
    Stage,
)
from services.sheet.ridged.point_jacobians import point_jacobians
from services.sheet.ridged.views import CAMERA_UNKNOWNS, OtherView, view_residuals

FLOW_PROBE = 0.01
"""Photo units from a sample of the flow to the points that show its direction."""
LOST = 6.0
"""Residual of a point that the mesh does not show; it has no derivative."""


class SheetResiduals:
    """Residuals at a vector of unknowns: nodes, levels of lines, then log focal length, log aspect, slant, margins,
    line spacings."""

    def __init__(
        self, start: SheetMesh, observed: SheetObservations, parameters: RidgedParameters, stage: Stage
    ) -> None:
        self.start, self.p, self.observed, self.stage = start, parameters, observed, stage
        lines = observed.lines
        p, count = parameters, start.rows * start.columns
        self.node_unknowns = 3 * count
        sides = [side or SideObservations(np.zeros((0, 2)), np.zeros(0)) for side in observed.sides]
        ends = np.concatenate(lines.margins) if lines.margins else np.zeros((0, 2))
        strokes = observed.strokes
        stroke = np.zeros((0, 2)) if strokes is None else strokes.points
        way = np.zeros((0, 2)) if strokes is None else _ways(strokes.angles)
        probe = 0.6 * (lines.text_height or FLOW_PROBE)
        flow = np.zeros((0, 2)) if observed.flow is None else observed.flow.points
        along = np.zeros((0, 2)) if observed.flow is None else _ways(observed.flow.angles)
        parts = [
            lines.points,
            ends,
            stroke - probe * way,
            stroke + probe * way,
            *(s.points for s in sides),
            flow - FLOW_PROBE * along,
            flow + FLOW_PROBE * along,
            *(view.points for view in observed.views),
        ]
        self.points = np.concatenate(parts)
        self.slices = _slices([len(part) for part in parts])
        self.grid = start.locate(self.points)
        known = np.asarray(np.isfinite(self.grid).all(axis=1))
        self.grid[~known] = 0.0
        placed = start.place(self.grid)
        inverse = np.linalg.norm(invert_2x2(start.derivatives(placed)), axis=2)
        across_rows, across_columns = inverse[:, 1], inverse[:, 0]
        self.levels = lines.count
        first = self.slices[0]
        size = np.bincount(lines.index, known[first], minlength=self.levels)
        self.start_levels = np.bincount(
            lines.index, np.where(known, self.grid[:, 1], 0.0)[first], minlength=self.levels
        ) / np.maximum(size, 1)
        # A deviation across the line in the photo is one across the rows by the map's local scale at the start.
        height = lines.text_height * float(np.median(across_rows[first])) if len(lines.points) else 1.0
        self.line_deviation = np.hypot(lines.deviations * across_rows[first], LEAST_LINE * height)
        self.margin_deviation = (
            MARGIN * lines.text_height * float(np.median(across_columns[self.slices[1]]))
            if len(ends)
            else 1.0
        )
        self.margin_index = np.repeat(np.arange(len(lines.margins)), [len(m) for m in lines.margins])
        self.start_margins = np.array(
            [
                np.median(self.grid[self.slices[1], 0][self.margin_index == k])
                for k in range(len(lines.margins))
            ]
        )
        self.stroke_deviation = (
            np.zeros(0)
            if strokes is None
            else STROKE_RAD * np.sqrt(STROKE_OVERLAP / np.maximum(strokes.weights, 0.05))
        )
        self.flow_deviation = (
            np.zeros(0)
            if observed.flow is None
            else FLOW_RAD * np.sqrt(STROKE_OVERLAP / np.maximum(observed.flow.weights, 0.05))
        )
        self.side_deviation = [
            np.hypot(side.deviations, LEAST_SIDE)
            * (across_columns if k % 2 else across_rows)[self.slices[4 + k]]
            for k, side in enumerate(sides)
        ]
        self.globals_at = self.node_unknowns + self.levels
        self._gaps, self._gap_group = _line_gaps(lines)
        gaps = np.abs(np.diff(self.start_levels[self._gaps], axis=1)[:, 0])
        self.start_spacings = np.array(
            [
                max(float(np.median(gaps[self._gap_group == k])), 1e-6)
                for k in range(int(self._gap_group.max(initial=-1)) + 1)
            ]
        )
        self.spacings_at = self.globals_at + 3 + len(lines.margins)
        self.cameras_at = self.spacings_at + len(self.start_spacings)
        self.unknowns = self.cameras_at + CAMERA_UNKNOWNS * len(observed.views)
        self.border = self.unknowns - self.globals_at
        self._paper = PaperResiduals(start, p, stage, self.globals_at + 1)

    @property
    def x0(self) -> Vector:
        """The start as a vector of unknowns."""
        ends = [np.log(self.start.focal), np.log(self.start.aspect), SLANT_MEAN_RAD]
        cameras = [view.start for view in self.observed.views]
        return np.concatenate(
            [
                self.start.nodes.ravel(),
                self.start_levels,
                ends,
                self.start_margins,
                self.start_spacings,
                *cameras,
            ]
        )

    @property
    def order(self) -> NDArray[np.intp]:
        """Unknowns from the top of the sheet to its bottom, so that coupled ones are near each other; globals last."""
        rows = np.repeat(np.arange(self.start.rows), 3 * self.start.columns).astype(np.float64)
        keys = np.concatenate([rows, self.start_levels + 0.5])
        return np.concatenate([np.argsort(keys, kind="stable"), np.arange(self.globals_at, self.unknowns)])

    def mesh(self, x: Vector) -> SheetMesh:
        """The mesh of the unknowns `x`."""
        nodes = x[: self.node_unknowns].reshape(self.start.nodes.shape)
        focal, aspect = (float(np.exp(v)) for v in x[self.globals_at : self.globals_at + 2])
        return replace(self.start, nodes=nodes, focal=focal, aspect=aspect)

    def views(self, x: Vector) -> tuple[OtherView, ...]:
        """The other views with the cameras of the unknowns `x`."""
        return tuple(
            replace(view, camera=view.camera.moved(x[self._camera(k)]))
            for k, view in enumerate(self.observed.views)
        )

    def _camera(self, number: int) -> slice:
        begin = self.cameras_at + CAMERA_UNKNOWNS * number
        return slice(begin, begin + CAMERA_UNKNOWNS)

    def blocks(self, x: Vector) -> list[ResidualBlock]:
        """All residuals at `x`, before any loss."""
        mesh = self.mesh(x)
        grid = mesh.locate(self.points, self.grid)
        known = np.asarray(np.isfinite(grid).all(axis=1))
        grid[~known] = self.grid[~known]
        self.grid = grid.copy()
        to_columns, to_rows = point_jacobians(mesh, self.points, grid, known, self.globals_at)
        return [
            self._lines(x, grid[:, 1], known, to_rows),
            self._spacing(x),
            self._margins(x, grid[:, 0], known, to_columns),
            self._strokes(x, mesh, grid, known, to_columns, to_rows),
            self._flow(mesh, grid, known, to_columns, to_rows),
            *self._sides(grid, known, to_columns, to_rows),
            *self._other_views(x, mesh, grid),
            self._paper.stretch(x),
            *self._paper.bends(x),
            self._priors(x),
        ]

    def _lines(self, x: Vector, rows: Vector, known: NDArray[np.bool_], to_rows: SparseRows) -> ResidualBlock:
        part, index = self.slices[0], self.observed.lines.index
        levels = x[self.node_unknowns : self.globals_at]
        values = np.where(known[part], (rows[part] - levels[index]) / self.line_deviation, LOST)
        slope = -1.0 * known[part] / self.line_deviation
        own = single_entries(index + self.node_unknowns, slope)
        return ResidualBlock(values, to_rows[part].scaled(1 / self.line_deviation) + own, 1)

    def _spacing(self, x: Vector) -> ResidualBlock:
        """Neighbouring lines of a paragraph lie one spacing apart, which paragraphs of like type share."""
        first, second = self._gaps.T
        group = self.spacings_at + self._gap_group
        scale = 1 / (SPACING * self.start_spacings[self._gap_group])
        levels = x[self.node_unknowns :]
        values = scale * (levels[second] - levels[first] - x[group])
        columns = np.stack([self.node_unknowns + first, self.node_unknowns + second, group], axis=1)
        return ResidualBlock(values, SparseRows(columns, scale[:, None] * [-1.0, 1.0, -1.0]), 1)

    def _margins(
        self, x: Vector, columns: Vector, known: NDArray[np.bool_], to_columns: SparseRows
    ) -> ResidualBlock:
        part, index = self.slices[1], self.margin_index + self.globals_at + 3
        values = np.where(known[part], (columns[part] - x[index]) / self.margin_deviation, LOST)
        own = single_entries(index, -1.0 * known[part] / self.margin_deviation)
        return ResidualBlock(values, to_columns[part].scaled(1 / self.margin_deviation) + own, 1)

    def _strokes(
        self,
        x: Vector,
        mesh: SheetMesh,
        grid: Points,
        known: NDArray[np.bool_],
        to_columns: SparseRows,
        to_rows: SparseRows,
    ) -> ResidualBlock:
        """Angles of strokes against the columns, less the slant of the type."""
        a, b = self.slices[2], self.slices[3]
        across, down = _steps(mesh, grid, a, b)
        down = np.where(np.abs(down) < 1e-9, 1e-9, down)
        seen = known[a] & known[b]
        values = (np.arctan(-across / down) - x[self.globals_at + 2]) / self.stroke_deviation
        jacobian = self._angle_jacobian(
            mesh, (across, down), seen, self.stroke_deviation, (a, b), (to_columns, to_rows)
        )
        by_slant = single_entries(
            np.full(len(values), self.globals_at + 2, np.intp), -1.0 * seen / self.stroke_deviation
        )
        return ResidualBlock(np.where(seen, values, LOST), jacobian + by_slant, 1)

    def _flow(
        self,
        mesh: SheetMesh,
        grid: Points,
        known: NDArray[np.bool_],
        to_columns: SparseRows,
        to_rows: SparseRows,
    ) -> ResidualBlock:
        """Angles of text lines against the rows."""
        a, b = self.slices[8], self.slices[9]
        across, down = _steps(mesh, grid, a, b)
        across = np.where(np.abs(across) < 1e-9, 1e-9, across)
        seen = known[a] & known[b]
        values = np.arctan(down / across) / self.flow_deviation
        jacobian = self._angle_jacobian(
            mesh, (across, down), seen, self.flow_deviation, (a, b), (to_columns, to_rows)
        )
        return ResidualBlock(np.where(seen, values, LOST), jacobian, 1)

    def _angle_jacobian(
        self,
        mesh: SheetMesh,
        step: tuple[Vector, Vector],
        seen: NDArray[np.bool_],
        deviation: Vector,
        ends: tuple[slice, slice],
        to_grid: tuple[SparseRows, SparseRows],
    ) -> SparseRows:
        """Derivatives (n, unknowns) of the angles of steps across and down the sheet, in units of `deviation` (n,).

        A step leads from one of `ends` to the other among the points; `to_grid` are the derivatives of the points'
        columns and rows.
        """
        across, down = step
        square = np.maximum(across * across + down * down, 1e-18) * deviation
        by_column = (-1.0 * seen * down / square)[:, None]
        by_row = (seen * mesh.aspect * across / square)[:, None]
        begin, end = (by_column * to_grid[0].entries[k] + by_row * to_grid[1].entries[k] for k in ends)
        begin_columns, end_columns = (to_grid[0].columns[k] for k in ends)
        # Both ends mostly lie in one cell: their entries are added up here.
        together = (begin_columns == end_columns).all(axis=1)[:, None]
        by_nodes = SparseRows(end_columns, np.where(together, end - begin, end)) + SparseRows(
            begin_columns, np.where(together, 0.0, -begin)
        )
        return by_nodes + single_entries(
            np.full(len(across), self.globals_at + 1, np.intp), seen * across * down / square
        )

    def _sides(
        self, grid: Points, known: NDArray[np.bool_], to_columns: SparseRows, to_rows: SparseRows
    ) -> list[ResidualBlock]:
        """The sheet's sides are the mesh's border: top, right, bottom, left."""
        found = []
        borders = (0.0, self.start.columns - 1.0, self.start.rows - 1.0, 0.0)
        for k, border in enumerate(borders):
            part, deviation = self.slices[4 + k], self.side_deviation[k]
            place = grid[part, 0 if k % 2 else 1]
            values = np.where(known[part], (place - border) / deviation, LOST)
            by_nodes = (to_columns if k % 2 else to_rows)[part]
            found.append(ResidualBlock(values, by_nodes.scaled(1 / deviation), 1))
        return found

    def _other_views(self, x: Vector, mesh: SheetMesh, grid: Points) -> list[ResidualBlock]:
        """Other photos show the points that they share with this one where their cameras see the sheet."""
        found = []
        for k, view in enumerate(self.observed.views):
            placed, camera = mesh.place(grid[self.slices[10 + k]]), self._camera(k)
            found.append(view_residuals(view, x[camera], placed, self.globals_at, camera.start))
        return found

    def _priors(self, x: Vector) -> ResidualBlock:
        """Priors of focal lengths, slant and aspect, the last one weak."""
        views = self.observed.views
        others = [self._camera(k).stop - 1 for k in range(len(views))]
        at = np.array([*(self.globals_at + np.arange(3)), *others], np.intp)
        deviation = np.array(
            [self.observed.focal_deviation, 1.0, np.deg2rad(0.4), *(view.focal_deviation for view in views)]
        )
        known = [view.log_focal for view in views]
        mean = np.array([self.observed.log_focal, np.log(self.start.aspect), SLANT_MEAN_RAD, *known])
        return ResidualBlock((x[at] - mean) / deviation, single_entries(at, 1 / deviation), 0)


def _line_gaps(lines: LineObservations) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Pairs (n, 2) of neighbouring lines, and the number (n,) of the spacing that they have."""
    group = np.arange(len(lines.runs))
    for members in lines.alike:
        group[members] = group[members[0]]
    _, group = np.unique(group, return_inverse=True)
    pairs = [np.stack([run.lines[:-1], run.lines[1:]], axis=1) for run in lines.runs]
    numbers = [np.full(len(pair), group[k]) for k, pair in enumerate(pairs)]
    if not pairs:
        return np.zeros((0, 2), np.intp), np.zeros(0, np.intp)
    return np.concatenate(pairs), np.concatenate(numbers)


def _steps(mesh: SheetMesh, grid: Points, start: slice, end: slice) -> tuple[Vector, Vector]:
    """Steps across and down the sheet from the points of `start` to those of `end`, in column widths."""
    return grid[end, 0] - grid[start, 0], mesh.aspect * (grid[end, 1] - grid[start, 1])


def _ways(angles: Vector) -> Points:
    return np.stack([np.cos(angles), np.sin(angles)], axis=1)


def _slices(sizes: list[int]) -> list[slice]:
    ends = np.cumsum([0, *sizes])
    return [slice(int(a), int(b)) for a, b in pairwise(ends)]

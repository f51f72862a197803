"""The shape of a creased page: a mesh between the sheet's sides, refined by the text lines that are traced in it."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import ClassVar, Literal

import numpy as np

from services.arrays import Floats, Points, Vector
from services.contract.rectify import Crop
from services.geometry.focal_prior import FocalLengthSource, FocalPrior
from services.geometry.page_map import PageMap
from services.geometry.photo_frame import PhotoFrame
from services.notices import Notice
from services.sheet.developable.observations import NO_LINES, LineObservations
from services.sheet.framing import CurvedFrame, frame_curved_page, frame_mesh
from services.sheet.line_residual import ResidualParameters, morph_to_lines
from services.sheet.outline.results import CORNER_BEYOND, LEAST_POINTS, LEAST_SEEN, SheetOutline
from services.sheet.ridged.cylinder_start import cylinder_between_sides
from services.sheet.ridged.fitting import FittedMesh, fit_mesh
from services.sheet.ridged.mesh import SheetMesh
from services.sheet.ridged.observations import SheetObservations, SideObservations
from services.sheet.ridged.parameters import RidgedParameters, Stage
from services.sheet.ridged.start import mesh_between_sides
from services.sheet.shape import NoShape, ShapeSource
from services.sheet.surfaces import MAX_MAGNIFICATION_RATIO, MeshSurface
from services.sheet.tracing.line_tracing import STRAIGHT, measure_straightness
from services.texture_flow.field import FlowSamples

WAVES = ResidualParameters(columns=24, rows=22, bend=0.25, max_shift=2.5)
"""Of a crumpled sheet: its facets are smaller than the mesh's cells, and its lines wave by more than those of books."""


# How the mesh is fitted, and when it is accepted.
FIT = RidgedParameters()
SIDES_ONLY = RidgedParameters(bend_rad=3.0)
"""Without text. Sides alone do not separate a few creases from a smooth bend, which is more frequent: a prior for
few ridges made cylinders worse than the start (aspect 3-12 % off, now 0-1.5 %)."""
COARSE, FINE = FIT.schedule[:-1], FIT.schedule[-1:]
"""Of two starts the one of less cost after the first stages goes on."""
FIT_TO_FLOW = (Stage(12, 100.0, 10.0, 30.0), Stage(12, 10.0, 3.0, 3.0))
"""Schedule of a fit to the directions of the text lines, before any is traced."""
FOCAL_STEPS = (1.25, 0.8)
"""Factors of a search over an assumed focal length, first upwards, else downwards."""
FOCAL_ENDS = 1e-2
"""Relative decrease of the cost below which a fit of this search ends: it is compared only."""
FOCAL_GAIN = 0.97
"""A step is taken when it brings the cost below this share."""
BELIEVABLE_FOCAL = 2.0
"""Of the prior's deviations: if the sheet is not paper, the cost falls with the focal length without limit."""
AGAIN = (Stage(24, 3.0, 1.5, 1.5), Stage(24, 1.0, 1.0, 1.0))
"""Schedule of the second fit, on lines traced in the view of the first."""
ROUNDS = 4
"""Most fits, each on lines traced again; the last ones only while lines are not straight and still improve."""
IMPROVEMENT = 0.85
"""Share of the straightness before, above which another round gains nothing."""
END = 0.15
"""Share of a side's points, nearest to a corner that is not seen, whose line leads to it."""
MAX_SKEW_RAD = float(np.deg2rad(4.0))
"""Largest skew of the print; above it the sides of the sheet show nothing of the lines' directions."""
MAX_STRETCH = 0.02
"""Largest RMS change of the edges' lengths; paper stretches less."""
MAX_SIDE = 0.012
"""RMS distance of the sides from the mesh's border, in photo units: above it, the outline is another sheet's."""


@dataclass(frozen=True, slots=True, eq=False)
class RidgedPage:
    """The map that flattens a creased page, and the evidence for it; see `PageShape`.

    `page_map` is that of its `mesh`, with a small field for the waves of lines that its cells are too coarse for;
    `observed` is what the mesh was fitted to (None: it is only a start).
    `line_straightness` is the RMS deviation of its lines from straight ones, in text heights, NaN if unknown;
    `side_deviation` the RMS distance of the outline from the mesh's border, in photo units, `stretch` the RMS relative
    change of the lengths of the mesh's edges.
    """

    mesh: SheetMesh
    page_map: PageMap
    focal_source: FocalLengthSource
    observed: SheetObservations | None = None
    line_count: int = 0
    line_straightness: float = float("nan")
    side_deviation: float = 0.0
    stretch: float = 0.0
    kind: ClassVar[Literal["curved"]] = "curved"
    log_focal_deviation: ClassVar[float] = float("inf")
    """A flexible sheet shows the focal length less precisely than a smooth one; the precision is not known."""
    notices: ClassVar[tuple[Notice, ...]] = ()
    sides_believed: ClassVar[bool] = True
    sheet_aspect: ClassVar[None] = None
    log_aspect_deviation: ClassVar[float] = 0.0
    ends_at_sides: ClassVar[bool] = True

    @property
    def focal(self) -> float:
        """See `PageShape`."""
        return self.mesh.focal

    @property
    def sources(self) -> tuple[ShapeSource, ...]:
        """See `PageShape`."""
        return ("outline", "text") if self.line_count else ("outline",)

    def in_space(self, centred: Points) -> Floats:
        """See `PageShape`."""
        grid = self.mesh.locate(centred)
        known = np.isfinite(grid).all(axis=1, keepdims=True)
        return np.where(known, self.mesh.place(np.nan_to_num(grid)).X, np.nan)

    def surface(self, view: PhotoFrame) -> MeshSurface:
        """See `PageShape`."""
        X = self.mesh.nodes
        points = self.mesh.project(X.reshape(-1, 3)) * view.unit_px + view.centre
        along = X[:-1, 1:] - X[:-1, :-1] + X[1:, 1:] - X[1:, :-1]
        down = X[1:, :-1] - X[:-1, :-1] + X[1:, 1:] - X[:-1, 1:]
        N = np.cross(along, down)
        N /= np.linalg.norm(N, axis=2, keepdims=True)
        return MeshSurface(points.reshape(*X.shape[:2], 2).astype(np.float64), N.astype(np.float64))

    def frame(
        self, view: PhotoFrame, points: Points, text_height_px: float, paper: Points | None, crop: Crop
    ) -> CurvedFrame:
        """See `PageShape`."""
        if crop == "sheet":
            return frame_mesh(self.mesh, self.page_map, view, points)
        return frame_curved_page(self.page_map, view, points, text_height_px, None, only_text=crop == "text")


def complete_corners(outline: SheetOutline) -> Points | None:
    """The outline's corners (4, 2); one that is not seen is where its two sides meet. None if they do not."""
    corners = outline.corners.copy()
    low, high = outline.polygon.min(axis=0), outline.polygon.max(axis=0)
    reach = CORNER_BEYOND * float((high - low).max())
    for k in np.flatnonzero(~np.isfinite(corners).all(axis=1)):
        before, after = outline.sides[k - 1].points, outline.sides[k].points
        if min(len(before), len(after)) < LEAST_POINTS:
            return None
        lines = []
        for points in (before[-int(END * len(before)) :], after[: int(END * len(after))]):
            middle = points.mean(axis=0)
            way = np.linalg.svd(points - middle)[2][0]
            lines.append(np.array([-way[1], way[0], way[1] * middle[0] - way[0] * middle[1]]))
        meeting = np.cross(lines[0], lines[1])
        if meeting[2] == 0:
            return None
        corners[k] = meeting[:2] / meeting[2]
        if (corners[k] < low - reach).any() or (corners[k] > high + reach).any():
            return None
    return np.asarray(corners)


def turn_outline(corners: Points, direction_rad: float) -> tuple[Points, tuple[int, ...]]:
    """Corners (4, 2) from the page's top left, and the numbers of its top, right, bottom and left side.

    `corners` (4, 2) are clockwise as the photo shows them; `direction_rad` is the direction of the text lines in the
    photo, up to a half turn.
    """
    text = np.array([np.cos(direction_rad), np.sin(direction_rad)])
    if text[0] < 0:
        text = -text
    c = corners

    def along(k: int) -> float:
        way = c[(k + 1) % 4] - c[k] + c[(k + 2) % 4] - c[(k + 3) % 4]
        return float(way @ text / np.linalg.norm(way))

    first = max(range(4), key=along)
    return np.roll(c, -first, axis=0), tuple((first + k) % 4 for k in range(4))


def sides_bend(outline: SheetOutline) -> float:
    """The largest RMS distance of a side from a straight line, as a share of the sheet's size."""
    size = float(np.sqrt(np.prod(np.ptp(outline.polygon, axis=0))))
    return max(side.straightness_px for side in outline.sides) / size


def mean_bend(outline: SheetOutline) -> float:
    """The RMS distance of all sides from straight lines, as a share of the sheet's size."""
    size = float(np.sqrt(np.prod(np.ptp(outline.polygon, axis=0))))
    return float(np.sqrt(np.mean([side.straightness_px**2 for side in outline.sides]))) / size


def print_skew(mesh: SheetMesh, major: FlowSamples) -> float:
    """Least skew (rad) of three quarters of the text lines against the sheet's top and bottom sides.

    It is measured in the flat view of `mesh`. Creases turn lines both ways; skewed print turns all of them alike.
    """
    J = mesh.jacobians(major.points)
    known = np.isfinite(J).all(axis=(1, 2))
    if not known.any():
        return 0.0
    way = np.stack([np.cos(major.angles), np.sin(major.angles)], axis=1)
    u, v = np.einsum("nij,nj->in", J[known], way[known])
    low, high = np.percentile((np.arctan2(v, u) + np.pi / 2) % np.pi - np.pi / 2, [25, 75])
    return float(max(low, 0.0) + min(high, 0.0))


def estimate_ridged_page(
    outline: SheetOutline,
    view: PhotoFrame,
    prior: FocalPrior,
    direction_rad: float,
    trace: Callable[[PageMap], LineObservations] | None,
    strokes: FlowSamples | None,
    major: FlowSamples | None = None,
) -> RidgedPage | NoShape:
    """The creased sheet with this `outline`, or why there is none.

    Parameters
    ----------
    direction_rad
        Direction of the text lines in the photo; which side is the top up to a half turn.
    trace
        Gives the text lines as they are seen in the flat view of a map; None where there is no text.
    strokes, major
        Minor and major flow in centred coordinates.
    """
    whole = complete_corners(outline)
    if whole is None:
        return NoShape("the sheet's outline is not seen clearly")
    if min(side.seen for side in outline.sides) < LEAST_SEEN:
        return NoShape("a side of the sheet is not seen")
    corners, order = turn_outline(whole, direction_rad)
    sides = tuple(
        SideObservations(
            view.to_centred(outline.sides[k].points),
            outline.sides[k].deviations / view.unit_px,
        )
        for k in order
    )
    centred = tuple(side.points for side in sides)
    cells = FIT.schedule[0].cells
    bent_one_way = None
    if trace is not None:
        # Any two bent sides are those of a cylinder for some camera: without text nothing would tell which are not.
        bent_one_way = cylinder_between_sides(
            view.to_centred(corners), centred, prior.log_focal, prior.deviation, cells
        )
    between = mesh_between_sides(view.to_centred(corners), centred, float(np.exp(prior.log_focal)), cells)
    if between is None:
        return NoShape("its corners are not those of a rectangle before a camera")
    if major is not None and abs(print_skew(between, major)) > MAX_SKEW_RAD:
        return NoShape("its print is askew on it")
    seen = SheetObservations(NO_LINES, strokes, sides, prior.log_focal, prior.deviation)
    steps = FOCAL_STEPS if prior.source == "assumed" else ()
    fits = [_fit_coarsely(start, trace, seen) for start in (bent_one_way, between) if start is not None]
    for coarse, found in sorted(fits, key=lambda fit: fit[0].cost):
        mesh, lines = _fit_finely(coarse.mesh, found, trace, seen, steps)
        reason = _implausibility(mesh, sides)
        if reason is None:
            break
    if reason is not None and trace is not None and major is not None:
        # Lines that cross a sharp crease are easily linked to their neighbours; their directions are not.
        turned = fit_mesh(between, replace(seen, flow=major), replace(FIT, schedule=FIT_TO_FLOW)).mesh
        coarse, found = _fit_coarsely(turned, trace, seen)
        mesh, lines = _fit_finely(coarse.mesh, found, trace, seen, ())
        reason = _implausibility(mesh, sides)
    if reason is not None:
        return NoShape(reason)
    page_map, lines = without_waves(mesh, lines, trace)
    return RidgedPage(
        mesh,
        page_map,
        prior.source,
        replace(seen, lines=lines),
        lines.count // 2,
        measure_straightness(page_map, lines),
        _side_deviation(mesh, sides),
        _stretch(mesh),
    )


def without_waves(
    mesh: SheetMesh, lines: LineObservations, trace: Callable[[PageMap], LineObservations] | None
) -> tuple[PageMap, LineObservations]:
    """The map of the mesh, lines that still wave drawn straight by a small field, and the lines; its border stays."""
    if trace is None or not measure_straightness(mesh, lines) > STRAIGHT:
        return mesh, lines
    seen = trace(mesh)
    return morph_to_lines(mesh, seen, mesh.border(), WAVES), seen


def _fit_coarsely(
    start: SheetMesh, trace: Callable[[PageMap], LineObservations] | None, seen: SheetObservations
) -> tuple[FittedMesh, LineObservations]:
    """The first stages of the fit to `seen` and to the lines that `trace` finds in the start's view; and the lines."""
    if trace is None:
        return fit_mesh(start, seen, replace(SIDES_ONLY, schedule=COARSE)), NO_LINES
    lines = trace(start)
    return fit_mesh(start, replace(seen, lines=lines), replace(FIT, schedule=COARSE)), lines


def _fit_finely(
    mesh: SheetMesh,
    lines: LineObservations,
    trace: Callable[[PageMap], LineObservations] | None,
    seen: SheetObservations,
    focal_steps: tuple[float, ...],
) -> tuple[SheetMesh, LineObservations]:
    """The mesh fitted to the `lines` of its start, and to those that `trace` finds in its view, round by round.

    Beside it the lines of the last round.
    """
    if trace is None:
        return fit_mesh(mesh, seen, replace(SIDES_ONLY, schedule=FINE)).mesh, lines
    observed = replace(seen, lines=lines)
    mesh = _search_focal(fit_mesh(mesh, observed, replace(FIT, schedule=FINE)), observed, focal_steps).mesh
    straightness = measure_straightness(mesh, lines)
    for _ in range(ROUNDS - 1):
        lines = trace(mesh)
        mesh = fit_mesh(mesh, replace(seen, lines=lines), replace(FIT, schedule=AGAIN)).mesh
        before, straightness = straightness, measure_straightness(mesh, lines)
        if not lines.count or straightness < STRAIGHT or not straightness <= IMPROVEMENT * before:
            break
    return mesh, lines


def _search_focal(fitted: FittedMesh, observed: SheetObservations, steps: tuple[float, ...]) -> FittedMesh:
    """The best fit of a search over the focal length.

    If depth and focal length grow by the same factor, the photo does not change. So a fit stays near the focal length
    of its start, even if another one explains the photo better.
    """
    last = replace(FIT, schedule=FINE, gain=FOCAL_ENDS)
    for step in steps:
        tried = fit_mesh(fitted.mesh.deepened(step), observed, last)
        off = abs(float(np.log(tried.mesh.focal)) - observed.log_focal)
        if tried.cost <= FOCAL_GAIN * fitted.cost and off <= BELIEVABLE_FOCAL * observed.focal_deviation:
            return tried
    return fitted


def _side_deviation(mesh: SheetMesh, sides: tuple[SideObservations, ...]) -> float:
    """RMS distance (photo units) of the seen sides from the mesh's border, the worst tenth left out."""
    borders = (0.0, mesh.columns - 1.0, mesh.rows - 1.0, 0.0)
    found: list[Vector] = []
    for k, (side, border) in enumerate(zip(sides, borders, strict=True)):
        grid = mesh.locate(side.points)
        known = np.isfinite(grid).all(axis=1)
        grid[~known] = 0.0
        on_border = grid.copy()
        on_border[:, 0 if k % 2 else 1] = border
        distance = np.linalg.norm(mesh.project(mesh.place(on_border).X) - side.points, axis=1)
        found.append(np.where(known, distance, np.inf))
    distances = np.sort(np.concatenate(found))
    return float(np.sqrt(np.mean(distances[: max(int(0.9 * len(distances)), 1)] ** 2)))


def _stretch(mesh: SheetMesh) -> float:
    """RMS relative change of the lengths of the mesh's edges along rows and columns."""
    across = np.linalg.norm(np.diff(mesh.nodes, axis=1), axis=2) / mesh.step - 1
    down = np.linalg.norm(np.diff(mesh.nodes, axis=0), axis=2) / (mesh.step * mesh.aspect) - 1
    return float(np.sqrt(np.mean(np.concatenate([across.ravel(), down.ravel()]) ** 2)))


def _implausibility(mesh: SheetMesh, sides: tuple[SideObservations, ...]) -> str | None:
    """Why no camera could see this mesh; None if one could."""
    if (mesh.nodes[:, :, 2] <= 1e-3).any():
        return "part of it would lie behind the camera"
    if _stretch(mesh) > MAX_STRETCH:
        return "the paper would have to stretch"
    if _side_deviation(mesh, sides) > MAX_SIDE:
        return "its sides are not those of a sheet of paper"
    seen = mesh.project(mesh.nodes.reshape(-1, 3)).reshape(mesh.rows, mesh.columns, 2)
    along, down = np.diff(seen, axis=1)[:-1], np.diff(seen, axis=0)[:, :-1]
    det = along[..., 0] * down[..., 1] - along[..., 1] * down[..., 0]
    if (det <= 0).mean() > 0.005:
        return "part of it would be folded over"
    low, high = np.percentile(np.sqrt(np.maximum(det, 1e-12)), [2, 98])
    if high > MAX_MAGNIFICATION_RATIO * low:
        return f"parts of it would be enlarged {high / low:.0f} times as much as others"
    return None

"""How flat a view is, by print and sides that it shows: figures, and the error of the mesh to expect.

Text lines are traced in the view anew, by the tracer that the shape was not fitted to. With the flows, the line
spacing, the margins and the sides of the sheet they ask for a smooth field of shifts (`correction`); its size is
calibrated on simulated pages, on right shapes and on wrong ones (`benchmarks flatness`).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from services.arrays import Points, Vector
from services.geometry.page_frame import Frame
from services.geometry.photo_frame import PhotoFrame
from services.notices import Notice
from services.rectify.shape_choice.shaped_page import ShapedPage
from services.rectify.view.correction import (
    Demand,
    SmoothField,
    asked_percent,
    demand,
    finite,
    without_means,
)
from services.rectify.view.print_kept import SCALE_POINTS
from services.sheet.developable.observations import FLOW_OVERLAP, STROKE_OVERLAP, LineObservations
from services.sheet.outline.results import BELIEVED_CONFIDENCE, LEAST_POINTS, SheetOutline, SheetSide
from services.sheet.shape import PageShape
from services.sheet.tracing.line_tracing import FEW_LINES, KEPT_SHARE, trace_by_characters
from services.sheet.tracing.profile_tracing import DEVIATION, trace_by_profiles
from services.texture_flow.field import FlowSamples

FLOOR_PERCENT = 0.10
"""Error of views that ask for nothing, ..."""
GAIN = 1.56
"""... and error by what is asked for: fitted to 300 views of 80 simulated sheets (`benchmarks flatness --fit`)."""
LINES_GAIN = 2.5
"""... and by what some points of text lines leave from level ones beyond the scatter of most: a smooth field takes the
kinks of folded paper for strays. Of 243 views of simulated sheets any gain from 1 to 4 judges none otherwise; by this
one the errors agree best."""
MOST_OF_NORMAL = 0.79
"""RMS of `KEPT_SHARE` of a normal distribution, in its deviations: the other points may lie beyond a kink."""
NOT_FLAT_PERCENT = 0.45
"""What a view may show of its error and still count as flat. Of 215 views of 57 simulated sheets, right and wrong on
purpose, 92 % of those that are off by more than 1 % show more, and none of 112 within 0.3 %. What is missed are mostly
wrong proportions by a wrong focal length, which no view shows."""


# Deviations of what a flat view shows. Lengths are in text heights, but those of sides in widths of the view.
GAP = 1.7
"""Steps between the points of a line at which it ends: beyond a gutter the next line is another one, ..."""
JUMP = 0.35
"""... as it is after a step up or down by this."""
SPACING = 0.05
"""Of the distance from line to line."""
FEWEST_SPACES = 3
MARGIN = 0.6
FEWEST_ENDS = 4
DIRECTION_RAD = float(np.deg2rad(1.2))
"""Of a sample of the lines' directions."""
STROKE_RAD = float(np.deg2rad(1.0))
MOST_LEAN_RAD = float(np.deg2rad(12.0))
"""Of a sample: what leans more in a view that is nearly flat is no stroke, and no line."""
SIDE = 0.0015
"""Of a side's points from its line, ..."""
SHARED_SIDE = 12.0
"""... on as many independent ones."""
FEWEST_FITTED = 3
"""Sides, of which one that contradicts the others is doubted."""
MOST_POINTS = 1000
"""Of the lines, ..."""
MOST_SAMPLES = 300
"""... and of each flow: more take time and tell little more. They are left out evenly."""


@dataclass(frozen=True, slots=True)
class Flatness:
    """What a view shows of its own flatness; None where it shows nothing of that kind.

    `line_straightness` is the RMS distance of text lines from level ones, in text heights, `asked_percent` the RMS
    shift that lines, strokes, margins and sides ask for, `lines_percent` the RMS distance of text lines from level ones
    beyond the scatter of most, in percent of the view's width. `proportions_percent` is the deviation that the shape
    itself states for the view's proportions: nothing in the view shows it.
    """

    line_straightness: float | None
    asked_percent: float
    proportions_percent: float = 0.0
    lines_percent: float = 0.0

    @property
    def shown_percent(self) -> float:
        """RMS error of the mesh that the view shows, after the best similarity, percent of the page's width."""
        lines = LINES_GAIN * self.lines_percent
        return float(np.linalg.norm([FLOOR_PERCENT, GAIN * self.asked_percent, lines]))

    @property
    def error_percent(self) -> float:
        """RMS error of the mesh to expect: what is shown, and the proportions."""
        return float(np.hypot(self.shown_percent, self.proportions_percent))

    @property
    def passes(self) -> bool:
        """Whether the view counts as flat: wrong proportions do not bend it, and have a warning of their own."""
        return self.shown_percent <= NOT_FLAT_PERCENT


def measure_flatness(page: ShapedPage, frame: Frame) -> Flatness | None:
    """How flat the view of `page` through `frame` is, its text lines level; None without lines and sides.

    Where the photo is the page, its print was measured with its noise before that was believed.
    """
    if page.departure is not None:
        return Flatness(None, 100 * page.departure)
    field = SmoothField(frame.width, frame.height)
    demands: list[Demand] = []
    straightness: float | None = None
    lines_percent = 0.0
    if page.analysis is not None:
        evidence = page.analysis.evidence(page.view)
        # The mesh of a creased sheet was fitted to lines that were traced by profiles, other shapes were not.
        trace = trace_by_characters if page.shape.ends_at_sides else trace_by_profiles
        lines = trace(evidence.text, page.view, page.shape.page_map)
        if lines.count:
            text = _text_lines(lines, page.view, frame)
            straightness = text.straightness()
            lines_percent = 100 / frame.width * text.unevenness_px(DEVIATION)
            demands += [_level(text, field), *_even_spacing(lines, text, field)]
            demands += _flush_margins(lines, page.view, frame, text.height_px, field)
        demands.append(_along_lines(evidence.major, page.view, frame, field))
        if evidence.strokes is not None:
            demands.append(_upright_strokes(evidence.strokes, page.view, frame, field))
    sides = _seen_sides(page.outline, frame)
    if sides and page.outline is not None:
        doubts = _doubts(sides, page.shape, frame)
        demands += [_straight_side(side, field, k * SIDE) for side, k in zip(sides, doubts, strict=True)]
    if straightness is None and not sides:
        return None
    proportions = _shift_by_proportions(page.shape.log_aspect_deviation, frame)
    asked = asked_percent(field, demands)
    return Flatness(straightness, asked, proportions, lines_percent)


def _shift_by_proportions(log_deviation: float, frame: Frame) -> float:
    """RMS shift over the view, percent of its width, by an error of its aspect's logarithm.

    The best similarity leaves of (x, y) -> (x (1 + d), y) the shifts d sqrt(v_x v_y / (v_x + v_y)), where v are the
    variances of places along the width w and the height h, w^2 / 12 and h^2 / 12.
    """
    return 100 * log_deviation * frame.height / float(np.hypot(frame.width, frame.height) * np.sqrt(12))


@dataclass(frozen=True, slots=True, eq=False)
class _TextLines:
    """Points (N, 2) of text lines in pixels of the view, of the traced `line` (N,) and of a `piece` (N,) of it without
    jumps."""

    pixels: Points
    line: NDArray[np.intp]
    piece: NDArray[np.intp]
    height_px: float

    def straightness(self) -> float:
        """RMS distance of the points from level pieces, in text heights, the worst tenth left out."""
        rest = np.sort(np.abs(self._rest()))
        return float(np.sqrt(np.mean(rest[: max(int(KEPT_SHARE * len(rest)), 1)] ** 2))) / self.height_px

    def unevenness_px(self, deviation: float) -> float:
        """RMS distance of all points from level pieces, beyond what the scatter of most explains.

        That is at least the `deviation` of letters, in text heights; handwriting scatters everywhere.
        """
        usual = self.height_px * max(deviation, self.straightness() / MOST_OF_NORMAL)
        return float(np.sqrt(max(float(np.mean(self._rest() ** 2)) - usual**2, 0.0)))

    def _rest(self) -> Vector:
        return np.asarray(without_means(self.pixels[:, 1:], self.piece)[:, 0])


def _text_lines(lines: LineObservations, view: PhotoFrame, frame: Frame) -> _TextLines:
    """The traced lines in pixels of the view, in pieces that are those of one line for certain."""
    seen = view.to_photo(lines.points)
    pixels = frame.to_flat(seen)
    thin = seen[:: max(len(seen) // SCALE_POINTS, 1)]
    height = float(np.nanmedian(_growth(thin, frame))) * lines.text_height * view.unit_px
    known = finite(pixels)
    pixels, line = pixels[known], lines.index[known]
    order = np.lexsort((pixels[:, 0], line))
    pixels, line = pixels[order], line[order]
    step, same = np.diff(pixels, axis=0), np.diff(line) == 0
    usual, slope = 1.0, 0.0
    if same.any():
        usual = float(np.median(step[same, 0]))
        slope = float(np.median(step[same, 1] / np.maximum(step[same, 0], 1e-6)))
    ends = ~same | (step[:, 0] > GAP * usual) | (np.abs(step[:, 1] - slope * step[:, 0]) > JUMP * height)
    piece = np.concatenate([[0], np.cumsum(ends)]) if len(line) else line
    return _TextLines(pixels, line, piece, height)


def _growth(photo: Points, frame: Frame) -> Vector:
    """Length in pixels of the view of an upright pixel at the `photo` points (N, 2)."""
    half = np.array([0.0, 0.5])
    return np.asarray(np.linalg.norm(frame.to_flat(photo + half) - frame.to_flat(photo - half), axis=1))


def _level(text: _TextLines, field: SmoothField) -> Demand:
    """Every piece of a line has one height."""
    thin = max(-(-len(text.piece) // MOST_POINTS), 1)
    pixels, piece = text.pixels[::thin], np.unique(text.piece[::thin], return_inverse=True)[1]
    y = pixels[:, 1:]
    level = y - without_means(y, piece)
    # At the line's height, not at the point's: the error of a point must not be in both sides of its equation.
    terms = without_means(field.values(np.column_stack([pixels[:, 0], level])), piece)
    deviation = DEVIATION * text.height_px / field.width / np.sqrt(thin)
    return demand((level - y)[:, 0] / field.width, deviation, y=terms)


def _even_spacing(lines: LineObservations, text: _TextLines, field: SmoothField) -> list[Demand]:
    """The lines of a paragraph, and of paragraphs alike, are equally far apart."""
    count = np.bincount(text.line, minlength=lines.count)
    values = np.column_stack([text.pixels[:, 1] / field.width, field.values(text.pixels)])
    sums = [np.bincount(text.line, column, lines.count) for column in values.T]
    means = np.stack(sums, axis=1) / np.maximum(count, 1)[:, None]
    alone = set(range(len(lines.runs))) - {int(k) for group in lines.alike for k in group}
    groups = [group.tolist() for group in lines.alike] + [[k] for k in sorted(alone)]
    found = []
    for group in groups:
        rows = [lines.runs[k].lines[count[lines.runs[k].lines] > 1] for k in group]
        orders = [lines.runs[k].order[count[lines.runs[k].lines] > 1] for k in group]
        steps = np.concatenate([np.diff(order) for order in orders])
        if len(steps) < FEWEST_SPACES:
            continue
        apart = np.concatenate([np.diff(means[row], axis=0) for row in rows])
        apart[:, 0] -= float(np.median(apart[:, 0] / steps)) * steps
        # The common spacing is free.
        free = apart - np.outer(steps, steps @ apart / (steps @ steps))
        found.append(demand(-free[:, 0], SPACING * text.height_px / field.width, y=free[:, 1:]))
    return found


def _flush_margins(
    lines: LineObservations,
    view: PhotoFrame,
    frame: Frame,
    height_px: float,
    field: SmoothField,
) -> list[Demand]:
    """Ends of lines that are flush lie at one place."""
    found = []
    for ends in lines.margins:
        pixels = frame.to_flat(view.to_photo(ends))
        pixels = pixels[finite(pixels)]
        if len(pixels) >= FEWEST_ENDS:
            together = np.zeros(len(pixels), np.intp)
            x = without_means(pixels[:, :1], together)[:, 0] / field.width
            terms = without_means(field.values(pixels), together)
            found.append(demand(-x, MARGIN * height_px / field.width, x=terms))
    return found


def _along_lines(major: FlowSamples, view: PhotoFrame, frame: Frame, field: SmoothField) -> Demand:
    """Directions of text lines are level."""
    pixels, way, weights = _directions(major, view, frame)
    turn = np.arctan(way[:, 1] / way[:, 0])
    near = np.abs(turn) < MOST_LEAN_RAD
    pixels, turn, weights = pixels[near], turn[near], weights[near]
    deviation = DIRECTION_RAD * np.sqrt(FLOW_OVERLAP / weights)
    return demand(-turn, deviation, y=field.slopes(pixels)[0])


def _upright_strokes(strokes: FlowSamples, view: PhotoFrame, frame: Frame, field: SmoothField) -> Demand:
    """Strokes are upright, but for the slant of the type."""
    pixels, way, weights = _directions(strokes, view, frame)
    lean = np.arctan(way[:, 0] / way[:, 1])
    near = np.abs(lean) < MOST_LEAN_RAD
    pixels, lean, weights = pixels[near], lean[near], weights[near]
    deviation = STROKE_RAD * np.sqrt(STROKE_OVERLAP / weights)
    return demand(-lean, deviation, x=field.slopes(pixels)[1], slant=-1.0)


def _directions(samples: FlowSamples, view: PhotoFrame, frame: Frame) -> tuple[Points, Points, Vector]:
    """Places (N, 2) of the samples in the view, their directions (N, 2) there, and their weights."""
    thin = max(-(-len(samples) // MOST_SAMPLES), 1)
    photo, angles = view.to_photo(samples.points[::thin]), samples.angles[::thin]
    step = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    before, after = frame.to_flat(photo - step), frame.to_flat(photo + step)
    known = finite(before) & finite(after)
    before, after = before[known], after[known]
    way = np.where(np.abs(after - before) < 1e-9, 1e-9, after - before)
    return 0.5 * (before + after), way, np.maximum(thin * samples.weights[::thin][known], 1e-3)


@dataclass(frozen=True, slots=True, eq=False)
class _Side:
    """A side of the sheet in the view: `points` (N, 2) in pixels, and the axis (0: x) that it is at right angles to."""

    points: Points
    axis: int
    bend_px: float


def _seen_sides(outline: SheetOutline | None, frame: Frame) -> list[_Side]:
    if outline is None or outline.confidence < BELIEVED_CONFIDENCE:
        return []
    sides = [_side_in_view(side, frame) for side in outline.seen_sides]
    return [side for side in sides if side is not None]


def _doubts(sides: list[_Side], shape: PageShape, frame: Frame) -> Vector:
    """Factors (N,) of the sides' deviations.

    A smooth sheet was fitted to all sides and lines together. A side of it that is more bent than all others was
    contradicted by them: it was followed along something else. On other shapes a bend of one side tells what it seems.
    """
    bends = np.array([side.bend_px for side in sides]) / frame.width
    fitted = shape.kind == "curved" and not shape.ends_at_sides and "outline" in shape.sources
    if not fitted or len(sides) < FEWEST_FITTED or shape.line_count < FEW_LINES:
        return np.ones(len(sides))
    others = np.array([np.delete(bends, k).max() for k in range(len(sides))])
    return np.asarray(np.maximum(bends / np.maximum(others, SIDE), 1.0))


def _side_in_view(side: SheetSide, frame: Frame) -> _Side | None:
    points = frame.to_flat(side.points)
    points = points[finite(points)]
    if len(points) < LEAST_POINTS:
        return None
    _, spread, axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)
    axis = 0 if abs(axes[0, 1]) > abs(axes[0, 0]) else 1
    return _Side(points, axis, float(spread[1]) / np.sqrt(len(points)))


def _straight_side(side: _Side, field: SmoothField, deviation: float) -> Demand:
    """A side is straight, and at right angles to the others; all of them may be turned against the print."""
    together = np.zeros(len(side.points), np.intp)
    place = without_means(side.points, together) / field.width
    terms = without_means(field.values(side.points), together)
    turned = place[:, 1 - side.axis] * (1.0 if side.axis == 1 else -1.0)
    shared = deviation * np.sqrt(max(len(side.points) / SHARED_SIDE, 1.0))
    x, y = (terms, None) if side.axis == 0 else (None, terms)
    return demand(-place[:, side.axis], shared, x=x, y=y, skew=-turned)


def not_flat(error_percent: float) -> Notice:
    """The warning of a view that shows that it is not flat, and for which no better shape was found."""
    return Notice(
        "not-flat",
        f"lines, strokes or sides in the view are not those of a flat page: expect places to be off by about "
        f"{error_percent:.1f} % of its width. Photograph the page flatter, from above, with all four sides in view.",
    )

"""The plane of a sheet from the sides of its outline, with its uncertainty."""

import math
from dataclasses import dataclass, replace

import numpy as np

from services.arrays import Floats, Points, Vector
from services.geometry.focal_prior import FOCAL, FocalPrior
from services.geometry.homographies import transform_points
from services.geometry.photo_frame import PhotoFrame
from services.geometry.planar import MAX_TILT_RAD, PagePlane
from services.geometry.sheet_aspect import SheetAspect
from services.robust import CAUCHY_WIDTH, REWEIGHTED_FITS, cauchy_weights, robust_scale
from services.sheet.outline.results import LEAST_POINTS, LEAST_SEEN, SheetOutline, SheetSide
from services.sheet.plane.known_formats import AspectBelief, weigh_formats
from services.sheet.plane.straight_lines import (
    HELD,
    OFF_CENTRE,
    LinePlane,
    StraightLines,
    along_axes,
    fit_line_plane,
    fit_principal_point,
    neighbouring_fits,
    sheet_aspect,
    start_plane,
)
from services.sheet.shape import NoShape

SQUARE_SIZE = 0.05
"""Half the side of the square by which scales are compared, centred units: small against the perspective."""


# Which sides are used, and when their plane is accepted. Lengths are shares of the side's length.
OVERLAP = 4.0
"""Neighbouring points of an edge share pixels and the paper's waves: this many count as one."""
BEND_SHARE = 0.5
"""Standard deviation of a side's ends from the line of a straight side, as a share of its bend."""
CUT_RAD = 1e-3
"""A sheet's corners are right angles to 0.06 degrees (0.3 mm on A4), and lenses bend lines as much."""
CROPPED_COST = 9.0
"""A photo counts as cropped when an off-centre principal point brings the sum of squares down by this."""
STRAIGHT_BEND = 0.01
"""Sides that are bent further show neither that the sheet is flat nor that the photo was cropped."""
MAX_ASPECT = 8.0
"""Longer sheets than receipts."""
CERTAIN_ASPECT = 0.004
"""Deviation of the logarithm of the aspect up to which the photo shows it, and no format is asked for."""


@dataclass(frozen=True, slots=True)
class OutlinePlaneParameters:
    """Which sides are used, and when their plane is accepted. Lengths are shares of the side's length."""

    max_bend: float = 0.03
    """RMS distance from the best line: a side that is bent further shows little of the plane."""
    max_misfit_rad: float = float(np.deg2rad(1.5))
    """RMS angle that the sides leave to the best rectangle."""
    max_off_centre: float = 0.35


@dataclass(frozen=True, slots=True, eq=False)
class OutlinePlane:
    """A rectangle's plane in centred unit coordinates, x along the sheet's top side as the photo shows it.

    `log_focal_deviation` is without the prior. `aspect` is the sheet's width over its height, None where a side is
    missing; `log_aspect_deviation` the standard deviation of its logarithm, or of the ratio of the plane's scales
    along both axes where a side is missing.
    """

    plane: PagePlane
    lines: StraightLines
    aspect: float | None
    log_aspect_deviation: float
    log_focal_deviation: float


@dataclass(frozen=True, slots=True, eq=False)
class SheetSides:
    """The straight `lines` of an outline, and the `plane` that they show without other evidence, if they do.

    Both are in centred unit coordinates of `view`. Its principal point is off the middle of the photo if the sides
    show that the photo was cropped.
    """

    view: PhotoFrame
    lines: StraightLines
    plane: "OutlinePlane | None"
    straight: bool
    """Whether all four sides are seen, and none is bent."""
    refusal: str = ""
    """Why the sides show no plane."""
    belief: AspectBelief | None = None
    """What known formats add, where the photo shows neither the focal length nor the aspect."""

    def under(self, prior: FocalPrior) -> "SheetSides":
        """The same sides under another prior of the focal length."""
        return _sides_of_lines(self.view, self.lines, prior, OutlinePlaneParameters(), straight=self.straight)

    def focal_prior(self, prior: FocalPrior) -> FocalPrior:
        """`prior`, or the focal length that a likely format needs."""
        return prior if self.belief is None or self.belief.prior is None else self.belief.prior

    def aspect_in(self, plane: PagePlane) -> SheetAspect | None:
        """How well the sheet's aspect is known if `plane` is its plane; None unless four straight sides are seen."""
        sides = along_axes(plane, self.lines)
        aspect = sheet_aspect(plane, sides) if self.straight else None
        if self.plane is None or aspect is None:
            return None
        if self.belief is None:
            return SheetAspect(aspect, self.plane.log_aspect_deviation)
        turned = not np.array_equal(sides.upright, self.lines.upright)
        deviation = self.belief.deviation_about((-1 if turned else 1) * math.log(aspect))
        return SheetAspect(aspect, deviation, self.belief.name, self.belief.probability)


def side_lines(
    outline: SheetOutline, view: PhotoFrame, parameters: OutlinePlaneParameters | None = None
) -> StraightLines:
    """The outline's sides (N <= 4) as straight lines: top and bottom along x, left and right along y."""
    p = parameters or OutlinePlaneParameters()
    rows: list[tuple[Points, Points, float]] = []
    upright: list[bool] = []
    for k, side in enumerate(outline.sides):
        found = _fit_side(side, p)
        if found is not None:
            rows.append(found)
            upright.append(k % 2 == 1)
    starts = np.array([row[0] for row in rows]).reshape(-1, 2)
    ends = np.array([row[1] for row in rows]).reshape(-1, 2)
    deviations = np.array([row[2] for row in rows])
    return StraightLines(
        view.to_centred(starts),
        view.to_centred(ends),
        deviations / view.unit_px,
        np.array(upright, bool),
    )


def _fit_side(side: SheetSide, p: OutlinePlaneParameters) -> tuple[Points, Points, float] | None:
    """Two points of the side's line with independent errors, and the deviation of these, all in pixels.

    At one standard deviation of the points' places along the line from their mean, before and after, the errors of
    a fitted line are independent, and each has twice the variance of its mean.
    """
    points, deviations = side.points, np.maximum(side.deviations, 1e-6)
    known = np.isfinite(points).all(axis=1) & np.isfinite(deviations)
    points, deviations = points[known], deviations[known]
    if len(points) < LEAST_POINTS or side.seen < LEAST_SEEN:
        return None
    weights = 1 / deviations**2
    middle, along, off = _weighted_line(points, weights)
    for _ in range(REWEIGHTED_FITS):
        scale = CAUCHY_WIDTH * np.maximum(deviations, robust_scale(off))
        weights = cauchy_weights(off, scale) / deviations**2
        middle, along, off = _weighted_line(points, weights)
    place = (points - middle) @ along
    reach = float(np.sqrt(np.average(place**2, weights=weights)))
    length = float(np.ptp(place))
    bend = float(np.sqrt(np.average(off**2, weights=weights)))
    if bend > p.max_bend * length or reach <= 0:
        return None
    count = max(float(weights.sum() ** 2 / (weights**2).sum()) / OVERLAP, 1.0)
    noise = max(float(np.sqrt(len(points) / (1 / deviations**2).sum())), bend) * np.sqrt(2 / count)
    cut = CUT_RAD * 2 * reach / np.sqrt(2)
    deviation = float(np.sqrt(noise**2 + (BEND_SHARE * bend) ** 2 + cut**2))
    return middle - reach * along, middle + reach * along, deviation


def _weighted_line(points: Points, weights: Vector) -> tuple[Points, Points, Vector]:
    """Mean (2,), direction (2,) from the first to the last point, and signed distances (N,) of the best line."""
    middle = np.average(points, axis=0, weights=weights)
    centred = points - middle
    along = np.linalg.svd(centred * np.sqrt(weights)[:, None], full_matrices=False)[2][0]
    along = along if (points[-1] - points[0]) @ along >= 0 else -along
    return middle, along, centred @ np.array([-along[1], along[0]])


def read_sides(
    outline: SheetOutline | None,
    view: PhotoFrame,
    prior: FocalPrior,
    parameters: OutlinePlaneParameters | None = None,
) -> SheetSides | None:
    """The sides of an outline as evidence for a plane; None if none of them can be used.

    Four sides fix rotation and focal length, unless two opposite ones are parallel in the photo; then, and with three
    sides, the focal length is the prior's. The sheet is not turned: its top side is at the top of the photo.
    """
    p = parameters or OutlinePlaneParameters()
    if outline is None:
        return None
    lines = side_lines(outline, view, p)
    if len(lines) == 0:
        return None
    straight = len(lines) == 4 and max(map(_bend, outline.sides)) < STRAIGHT_BEND
    off = None
    if straight and view.principal_point_px is None:
        off = _principal_point(lines, prior, p)
    if off is not None:
        x, y = view.centre + off * view.unit_px
        view, lines = replace(view, principal_point_px=(float(x), float(y))), lines.seen_from(off)
    return _sides_of_lines(view, lines, prior, p, straight=straight)


def _sides_of_lines(
    view: PhotoFrame, lines: StraightLines, prior: FocalPrior, p: OutlinePlaneParameters, *, straight: bool
) -> SheetSides:
    """The sides with the plane that they show, if need be that of a likely format."""
    plane = plane_from_lines(lines, prior, p)
    if isinstance(plane, NoShape):
        return SheetSides(view, lines, None, straight, plane.reason)
    unseen = straight and prior.source == "assumed" and plane.log_aspect_deviation > CERTAIN_ASPECT
    if not unseen:
        return SheetSides(view, lines, plane, straight)
    held = FocalPrior(math.log(plane.plane.focal), HELD, prior.source)
    noise = _aspect_deviation(fit_line_plane(lines, held, plane.plane), lines, held)
    belief = weigh_formats(lines, prior, plane.plane, noise)
    if belief is not None and belief.prior is not None:
        of_format = plane_from_lines(lines, belief.prior, p)
        plane = plane if isinstance(of_format, NoShape) else of_format
    return SheetSides(view, lines, plane, straight, belief=belief)


def _principal_point(lines: StraightLines, prior: FocalPrior, p: OutlinePlaneParameters) -> Floats | None:
    """Principal point (2,), if the four straight sides can be those of a rectangle only with one off the middle."""
    start = start_plane(lines, prior)
    if start is None:
        return None
    centred = fit_line_plane(lines, prior, start)
    if centred.cost < CROPPED_COST:
        return None
    usual = start_plane(lines, replace(prior, source="given"))
    point, cost = fit_principal_point(lines, prior, usual or start, OFF_CENTRE)
    if centred.cost - cost < CROPPED_COST or float(np.hypot(*point)) > p.max_off_centre:
        return None
    return point


def _bend(side: SheetSide) -> float:
    """RMS distance of a side's points from its line, over its length."""
    return side.straightness_px / max(float(np.linalg.norm(side.points[-1] - side.points[0])), 1.0)


def plane_from_lines(
    lines: StraightLines, prior: FocalPrior, parameters: OutlinePlaneParameters | None = None
) -> OutlinePlane | NoShape:
    """The plane in which `lines` are parallel and at right angles; three suffice."""
    p = parameters or OutlinePlaneParameters()
    start = start_plane(lines, prior)
    if start is None:
        return NoShape(f"only {len(lines)} straight sides are seen")
    fit = fit_line_plane(lines, prior, start)
    if abs(float(np.log(fit.plane.focal)) - prior.log_focal) > FOCAL.believable * prior.deviation:
        prior = FocalPrior(prior.log_focal, min(FOCAL.held_deviation, prior.deviation), prior.source)
        fit = fit_line_plane(lines, prior, start)
    misfit = float(np.sqrt(np.mean(fit.residuals_rad**2)))
    if misfit > p.max_misfit_rad:
        return NoShape("its sides are those of no rectangle that a usual camera sees")
    if float(np.arccos(np.clip(abs(fit.plane.rotation[2, 2]), 0.0, 1.0))) > MAX_TILT_RAD:
        return NoShape("it is seen from too low an angle")
    aspect = sheet_aspect(fit.plane, lines)
    if aspect is not None and not 1 / MAX_ASPECT < aspect < MAX_ASPECT:
        return NoShape("it is too narrow for a sheet")
    deviation = _aspect_deviation(fit, lines, prior)
    return OutlinePlane(fit.plane, lines, aspect, deviation, fit.log_focal_deviation)


def _aspect_deviation(fit: LinePlane, lines: StraightLines, prior: FocalPrior) -> float:
    """Standard deviation of the logarithm of the aspect ratio."""
    known = _log_aspect(fit.plane, fit.plane, lines)
    neighbours = neighbouring_fits(fit, lines, prior)
    return math.sqrt(sum((_log_aspect(plane, fit.plane, moved) - known) ** 2 for plane, moved in neighbours))


def _log_aspect(plane: PagePlane, reference: PagePlane, lines: StraightLines) -> float:
    """Log of the sheet's aspect; where a side is missing, of the aspect of what is a square in `reference`."""
    aspect = sheet_aspect(plane, lines)
    if aspect is not None:
        return float(np.log(aspect))
    H_reference = np.linalg.inv(reference.H_centred_plane)
    middle = transform_points(H_reference, 0.5 * (lines.starts + lines.ends)).mean(axis=0)
    size = SQUARE_SIZE
    square = middle + size * np.array([[-1.0, 0.0], [1.0, 0.0], [0.0, -1.0], [0.0, 1.0]])
    there = transform_points(np.linalg.inv(plane.H_centred_plane) @ reference.H_centred_plane, square)
    return float(np.log(np.linalg.norm(there[1] - there[0]) / np.linalg.norm(there[3] - there[2])))

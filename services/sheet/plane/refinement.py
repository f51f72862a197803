"""Refinement of a planar page's pose by the properties of its flat view.

The closed form of 3.2.3 trusts two vanishing points alone. In the flat view more is known: baselines are
horizontal, the lines of a paragraph are equally spaced, flush margins and strokes are vertical. Each of these is
one residual in units of its own deviation; rotation, focal length and the slant of the type are fitted to all of
them together, with a robust loss and a prior of the focal length that decides only where nothing else does.
Where sides of the sheet are seen, they also lie along two directions at right angles, turned against the text by a
usually small angle.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from services.arrays import Floats, Points, Vector
from services.geometry.camera import PrincipalPointPrior, rotation_from_vector
from services.geometry.focal_prior import FOCAL, MAX_FOCAL, MIN_FOCAL, FocalPrior
from services.geometry.homographies import directions, jacobians, transform_points, translation
from services.geometry.planar import PagePlane
from services.geometry.vanishing_points import FlowVanishingPoints
from services.robust import CAUCHY_WIDTH, cauchy, soft_l1
from services.sheet.developable.observations import FLOW_OVERLAP, SLANT_MEAN_RAD, STROKE_OVERLAP, TILT_RAD
from services.sheet.plane.flat_lines import (
    FLOW_FLOOR_RAD,
    SKEW_RAD,
    STROKE_FLOOR_RAD,
    FlatObservations,
    LineTerms,
    RefinementParameters,
)
from services.sheet.plane.straight_lines import StraightLines, side_directions, side_skew
from services.texture_flow.field import FlowSamples
from services.trust_region import least_squares

LEAST_GAIN = 1e-6
"""Relative decrease of the cost below which a fit ends: a thousandth of a deviation in the unknowns."""
DIFFERENCE_STEP = float(np.sqrt(np.finfo(np.float64).eps))
"""Of an unknown, relative: rounding and curvature weigh alike."""

TURN_STEP_RAD, FOCAL_STEP, SHIFT_STEP = 0.01, 0.05, 0.05
"""Typical steps of angles, of the logarithm of the focal length and of the principal point (centred units)."""
MOST_EVALUATIONS = 60
"""Of the residuals, in a fit; most end after ten."""
LEAST_WEIGHT = 0.05
"""Least weight of a sample of a flow, so that no deviation is infinite."""


@dataclass(frozen=True, slots=True, eq=False)
class RefinedPlane:
    """The refined page plane with its standard deviations.

    `log_focal_deviation` is without the prior; `log_aspect_deviation` that of the flat view's aspect ratio.
    `cost` is half the sum of the squared residuals under their losses, `cost_before` that of the start.
    """

    plane: PagePlane
    log_focal_deviation: float
    log_aspect_deviation: float
    slant_rad: float
    cost: float
    cost_before: float
    lines: int
    scales: tuple[float, float]
    """Of the baselines and of the spacings, in units of the deviations that were assumed."""
    skew_rad: float = 0.0
    """Turn from the text's directions to those of the sheet's sides, in the page's plane."""
    principal_point: tuple[float, float] = (0.0, 0.0)
    """In the coordinates of the observations; `plane` is relative to it."""


@dataclass(frozen=True, slots=True, eq=False)
class FlowObservations:
    """Both flows with their tangents (N, 2) and deviations (N,)."""

    major: FlowSamples
    minor: FlowSamples
    major_tangent: Points
    minor_tangent: Points
    major_deviation: Vector
    minor_deviation: Vector

    def residuals(self, H: Floats, slant_rad: float | Floats) -> Floats:
        """Text lines against horizontal, strokes against vertical but for `slant_rad`, in deviations (..., N).

        `H` (..., 3, 3) are the maps to flat views; of several, `slant_rad` has as many dimensions as the result.
        """
        x, y = directions(H, self.major.points, self.major_tangent)
        along = np.arctan(y / np.where(x == 0, 1e-12, x))
        x, y = directions(H, self.minor.points, self.minor_tangent)
        across = np.arctan(x / np.where(y == 0, 1e-12, y))
        found = [along / self.major_deviation, (across - slant_rad) / self.minor_deviation]
        return np.concatenate(found, axis=-1)


def observe_flows(major: FlowSamples, minor: FlowSamples, points: FlowVanishingPoints) -> FlowObservations:
    """Flow observations, with deviations by how well the tangents of each flow meet in its vanishing point."""
    major_spread = float(np.hypot(FLOW_FLOOR_RAD, points.horizontal.residual_rad))
    minor_spread = float(np.hypot(STROKE_FLOOR_RAD, points.vertical.residual_rad))
    return FlowObservations(
        major,
        minor,
        np.stack([np.cos(major.angles), np.sin(major.angles)], axis=1),
        np.stack([np.cos(minor.angles), np.sin(minor.angles)], axis=1),
        np.sqrt(FLOW_OVERLAP / np.maximum(major.weights, LEAST_WEIGHT)) * major_spread,
        np.sqrt(STROKE_OVERLAP / np.maximum(minor.weights, LEAST_WEIGHT)) * minor_spread,
    )


def side_residuals(plane: PagePlane, sides: StraightLines, skew_rad: float) -> Vector:
    """Residuals (N + 1,) under Cauchy's loss of the sheet's sides and of the skew."""
    off = side_directions(plane, sides, skew_rad) / sides.direction_deviations_rad
    skew = np.array([skew_rad / SKEW_RAD])
    return np.concatenate([CAUCHY_WIDTH * cauchy(off / CAUCHY_WIDTH)[0], cauchy(skew)[0]])


def joint_cost(
    refined: RefinedPlane,
    major: FlowSamples,
    minor: FlowSamples,
    points: FlowVanishingPoints,
    sides: StraightLines,
) -> float:
    """Half the sum of the residuals of flows and sides, squared under their losses; they need no traced text lines."""
    H = np.linalg.inv(refined.plane.H_centred_plane)
    flows = soft_l1(observe_flows(major, minor, points).residuals(H, refined.slant_rad))[0]
    edges = side_residuals(refined.plane, sides, refined.skew_rad)
    return 0.5 * float(flows @ flows + edges @ edges)


def refine_plane(
    start: PagePlane,
    prior: FocalPrior,
    major: FlowSamples,
    minor: FlowSamples,
    points: FlowVanishingPoints,
    observations: FlatObservations,
    parameters: RefinementParameters | None = None,
    sides: StraightLines | None = None,
    principal_point: PrincipalPointPrior | None = None,
) -> RefinedPlane:
    """Fit rotation (3), log focal length and slant by robust least squares, in centred unit coordinates.

    Parameters
    ----------
    start
        Plane from which the fit starts.
    prior
        Of the focal length.
    major, minor
        Texture flows. Their deviations depend on how well each meets in its vanishing point, so that the flows of a
        page that is not quite flat have less weight.
    points
        Vanishing points of both flows.
    observations
        Text lines of a flat view.
    parameters
        Standard deviations.
    sides
        Sides of the sheet; with them, the skew of the text against the sides is a sixth unknown.
    principal_point
        Prior of the principal point. With it, and without `sides`, its two coordinates are unknowns, and the plane is
        relative to it.

    Returns
    -------
    RefinedPlane
        The plane with its standard deviations.
    """
    p = parameters or RefinementParameters()
    has_sides = sides is not None and len(sides) > 0
    flows, terms = observe_flows(major, minor, points), LineTerms(observations, p)

    def plane_of(x: Vector) -> PagePlane:
        focal = min(max(math.exp(min(float(x[3]), 700.0)), MIN_FOCAL), MAX_FOCAL)
        return PagePlane(start.rotation @ rotation_from_vector(x[:3]), focal)

    def flatten(X: Floats) -> Floats:
        """The flat views (K, 3, 3; plane <- centred) of K vectors of unknowns."""
        H = np.linalg.inv(np.stack([plane_of(x).H_centred_plane for x in X]))
        if principal_point is None:
            return H
        return np.asarray(H @ np.stack([translation(-float(x[5]), -float(x[6])) for x in X]))

    def tilt(x: Vector) -> Vector:
        N = (start.rotation @ rotation_from_vector(x[:3]))[:, 2]
        angle = math.acos(min(max(float(N[2]), -1.0), 1.0))
        return np.asarray(N[:2] * (angle / max(math.hypot(N[0], N[1]), 1e-9)))

    def residuals_at(X: Floats) -> Floats:
        """Residuals (K, N) at K vectors of unknowns (K, P); together they take little longer than one."""
        H = flatten(X)
        lines = terms.at(H)
        # Observations may be outliers, so they have a robust loss; priors are squared.
        robust = [flows.residuals(H, X[:, 4:5]), lines.baselines, lines.spacings]
        own = np.stack([held_residuals(x) for x in X])
        return np.concatenate(
            [soft_l1(np.concatenate(robust, axis=1))[0], cauchy(lines.margins)[0], own], axis=1
        )

    def held_residuals(x: Vector) -> Vector:
        """Residuals of priors and sides, which few unknowns determine."""
        growth = 0.0 if principal_point is None else principal_point.log_growth(x[5:7])[0]
        focal_and_slant = [
            (x[3] - prior.log_focal - growth) / prior.deviation,
            (x[4] - SLANT_MEAN_RAD) / p.slant_rad,
        ]
        parts = [np.array(focal_and_slant), tilt(x) / TILT_RAD]
        if sides is not None and has_sides:
            parts.append(side_residuals(plane_of(x), sides, float(x[5])))
        if principal_point is not None:
            parts.append((x[5:7] - principal_point.mean) / np.array(principal_point.deviations))
        return np.concatenate(parts)

    def evaluate(x: Vector) -> tuple[Vector, Floats]:
        """Residuals (N,), and their derivatives (N, P) by forward differences."""
        steps = DIFFERENCE_STEP * np.where(x < 0, -1.0, 1.0) * np.maximum(np.abs(x), 1.0)
        found = residuals_at(np.concatenate([x[None], x + np.diag(steps)]))
        return found[0], np.asarray((found[1:] - found[0]).T / steps)

    x0 = np.array([0.0, 0.0, 0.0, np.log(start.focal), SLANT_MEAN_RAD])
    x_scale = [TURN_STEP_RAD, TURN_STEP_RAD, TURN_STEP_RAD, FOCAL_STEP, TURN_STEP_RAD]
    if sides is not None and has_sides:
        x0 = np.append(x0, side_skew(start, sides))
        x_scale.append(TURN_STEP_RAD)
    if principal_point is not None:
        x0 = np.append(x0, principal_point.start)
        x_scale += [SHIFT_STEP, SHIFT_STEP]
    fit = least_squares(evaluate, x0, np.array(x_scale), MOST_EVALUATIONS, LEAST_GAIN)
    drawn = abs(float(fit.x[3]) - prior.log_focal)
    if principal_point is None and prior.source == "assumed" and drawn > p.believable_focal * prior.deviation:
        held = FocalPrior(prior.log_focal, min(FOCAL.held_deviation, prior.deviation), "assumed")
        return refine_plane(
            PagePlane(start.rotation, float(np.exp(prior.log_focal))), held, major, minor, points, observations,
            replace(p, believable_focal=np.inf), sides,
        )  # fmt: skip
    before = 0.5 * float(np.sum(residuals_at(x0[None]) ** 2))
    information = fit.jac.T @ fit.jac
    refined = plane_of(fit.x)
    return RefinedPlane(
        refined,
        _focal_deviation(information, prior),
        _aspect_deviation(information, fit.x, plane_of, major.points.mean(axis=0)),
        float(fit.x[4]),
        float(fit.cost),
        before,
        len(observations.starts),
        terms.at(flatten(fit.x[None])[0]).scales(),
        float(fit.x[5]) if has_sides else 0.0,
        (0.0, 0.0) if principal_point is None else (float(fit.x[5]), float(fit.x[6])),
    )


def _focal_deviation(information: Floats, prior: FocalPrior) -> float:
    """Deviation of log f from the observations alone: without the prior's information."""
    without = information.copy()
    without[3, 3] -= 1 / prior.deviation**2
    without += 1e-9 * np.trace(information) * np.eye(len(without))
    variance = float(np.linalg.inv(without)[3, 3])
    return float(np.sqrt(variance)) if variance > 0 else float("inf")


def _aspect_deviation(
    information: Floats, x: Vector, plane_of: Callable[[Vector], PagePlane], at: Points
) -> float:
    """Deviation of the logarithm of the flat view's x-to-y ratio at the photo point `at` (2,)."""
    start = jacobians(
        plane_of(x).H_centred_plane, transform_points(np.linalg.inv(plane_of(x).H_centred_plane), at[None])
    )[0]

    def log_ratio(y: Vector) -> float:
        J = jacobians(np.linalg.inv(plane_of(y).H_centred_plane), at[None])[0]
        along, across = J @ start[:, 0], J @ start[:, 1]
        return float(np.log(np.linalg.norm(along) / np.linalg.norm(across)))

    step = 1e-4
    gradient = np.array(
        [(log_ratio(x + step * e) - log_ratio(x - step * e)) / (2 * step) for e in np.eye(len(x))]
    )
    covariance = np.linalg.inv(information + 1e-12 * np.trace(information) * np.eye(len(x)))
    return float(np.sqrt(max(gradient @ covariance @ gradient, 0.0)))

"""A page's plane from straight lines on it that lie along two directions at right angles.

The sheet's sides are such lines, and so are rules, frames and the lines of tables. A line along a direction of the
page passes through the vanishing point of that direction, so each line gives one residual: the angle between it and
the direction to its vanishing point. Rotation and focal length are four unknowns; two lines along each direction
determine them (Zhang & He 2007, "Whiteboard scanning and image enhancement", solve that case in closed form from
corners). If the lines do not show the focal length, its prior decides.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from services.arrays import Floats, Points, Vector
from services.geometry.camera import (
    focal_length_from_vanishing_points,
    rotation_from_flows,
    rotation_from_vector,
)
from services.geometry.focal_prior import MAX_FOCAL, MIN_FOCAL, FocalPrior
from services.geometry.homographies import transform_points
from services.geometry.planar import PagePlane

Upright = NDArray[np.bool_]
MAX_STEPS = 60
HELD = 1e-4
"""Deviation of an unknown that is held: the logarithm of a focal length, a coordinate of the principal point."""
OFF_CENTRE = 0.2
"""Deviation of the principal point of a cropped photo, in half diagonals: a quarter cut from one side moves it by
0.17."""
SMALL_STEP = 1e-10
FIRST_DAMPING, DAMPING_FALL, DAMPING_RISE = 1e-6, 0.2, 10.0
"""Levenberg-Marquardt: relative to the diagonal; after a step that helps, and after one that does not."""
STEPS = (0.01, 0.01, 0.01, 0.05, 0.05, 0.05)
"""Typical steps of the turn (3, rad), of the logarithm of the focal length and of the principal point (2)."""
MOST_EVALUATIONS = 100


@dataclass(frozen=True, slots=True, eq=False)
class StraightLines:
    """Straight lines in centred unit coordinates of the photo.

    `starts` and `ends` (N, 2) are two points of each whose errors across the line are independent, each with the
    standard deviation `deviations` (N,). `upright` (N,) marks the lines along the page's y axis; the others lie
    along its x axis.
    """

    starts: Points
    ends: Points
    deviations: Vector
    upright: Upright

    def __len__(self) -> int:
        return len(self.deviations)

    @property
    def lengths(self) -> Vector:
        """Distance (N,) of the two points."""
        return np.asarray(np.linalg.norm(self.ends - self.starts, axis=1))

    @property
    def direction_deviations_rad(self) -> Vector:
        """Standard deviation (N,) of the lines' directions."""
        return np.asarray(np.sqrt(2.0) * self.deviations / self.lengths)

    @property
    def homogeneous(self) -> Floats:
        """Lines (N, 3) through both points, unit length."""
        one = np.ones((len(self), 1))
        lines = np.cross(np.hstack([self.starts, one]), np.hstack([self.ends, one]))
        return np.asarray(lines / np.linalg.norm(lines, axis=1, keepdims=True))

    def moved(self, row: int, start: float, end: float) -> "StraightLines":
        """The same lines, but for line `row`, whose points are moved across it by `start` and `end`."""
        along = (self.ends[row] - self.starts[row]) / self.lengths[row]
        across = np.array([-along[1], along[0]])
        starts, ends = self.starts.copy(), self.ends.copy()
        starts[row] += start * across
        ends[row] += end * across
        return StraightLines(starts, ends, self.deviations, self.upright)

    def seen_from(self, principal_point: Floats) -> "StraightLines":
        """The same lines relative to `principal_point` (2,)."""
        return StraightLines(
            self.starts - principal_point, self.ends - principal_point, self.deviations, self.upright
        )

    def with_axes(self, upright: Upright) -> "StraightLines":
        """The same lines along other axes."""
        return StraightLines(self.starts, self.ends, self.deviations, upright)


@dataclass(frozen=True, slots=True, eq=False)
class LinePlane:
    """The plane that straight lines show, fitted with a prior of the focal length.

    `residuals_rad` (N,) are the angles between the lines and the directions to their vanishing points; `cost` is the
    sum of the squared residuals in deviations, including the prior.
    `log_focal_deviation` is without the prior.
    """

    plane: PagePlane
    residuals_rad: Vector
    log_focal_deviation: float
    cost: float


def line_directions(plane: PagePlane, lines: StraightLines) -> Vector:
    """Signed angle (N,), rad in (-pi/2, pi/2), from each line to the direction of the vanishing point of its axis."""
    return _angles(plane.rotation, plane.focal, lines)


def side_directions(plane: PagePlane, sides: StraightLines, skew_rad: float) -> Vector:
    """As `line_directions`, for lines along axes that are turned by `skew_rad` in the page's plane."""
    turn = rotation_from_vector(np.array([0.0, 0.0, skew_rad]))
    return _angles(plane.rotation @ turn, plane.focal, sides)


def side_skew(plane: PagePlane, sides: StraightLines) -> float:
    """Turn (rad, median) from the axes of `plane` to the directions that `sides` have in it."""
    H = np.linalg.inv(plane.H_centred_plane)
    way = transform_points(H, sides.ends) - transform_points(H, sides.starts)
    # Upright lines are turned back onto the x axis.
    turned = np.where(sides.upright[:, None], np.stack([way[:, 1], -way[:, 0]], axis=1), way)
    angles = np.arctan2(turned[:, 1], turned[:, 0])
    mean = 0.5 * np.angle(np.sum(np.exp(2j * angles)))
    return float(mean + np.median((angles - mean + np.pi / 2) % np.pi - np.pi / 2))


def sheet_aspect(plane: PagePlane, lines: StraightLines) -> float | None:
    """Width over height of the rectangle between the outermost lines; None where one of its sides is missing."""
    H = np.linalg.inv(plane.H_centred_plane)
    middle = 0.5 * (transform_points(H, lines.starts) + transform_points(H, lines.ends))
    x, y = middle[lines.upright, 0], middle[~lines.upright, 1]
    if len(x) < 2 or len(y) < 2 or not np.isfinite(middle).all() or np.ptp(y) == 0:
        return None
    return float(np.ptp(x) / np.ptp(y))


def along_axes(plane: PagePlane, sides: StraightLines) -> StraightLines:
    """The same lines, each along the axis of `plane` that it is nearer to on the whole.

    Text may run along either pair of the sheet's sides: axes are exchanged where the lines are turned by more than
    45 degrees.
    """
    return sides if abs(side_skew(plane, sides)) <= np.pi / 4 else sides.with_axes(~sides.upright)


_TURNED = np.stack([np.cross(turn, np.eye(3)[:2]) for turn in np.eye(3)])
"""How each of three small turns moves the page's axes (3, 2, 3)."""


def _angles(rotation: Floats, focal: float, lines: StraightLines) -> Vector:
    """Signed angles (N,) from the lines to the way to the vanishing points of their axes."""
    along = lines.ends - lines.starts
    middle = 0.5 * (lines.starts + lines.ends)
    vanishing = rotation.T[lines.upright.astype(int)]
    way = focal * vanishing[:, :2] - middle * vanishing[:, 2:]
    dot = along[:, 0] * way[:, 0] + along[:, 1] * way[:, 1]
    cross = along[:, 0] * way[:, 1] - along[:, 1] * way[:, 0]
    return np.asarray(np.arctan(cross / np.where(dot == 0, 1e-12, dot)))


def _directions(rotation: Floats, focal: float, lines: StraightLines) -> tuple[Vector, Floats]:
    """The angles (N,) and their derivatives (N, 4) by rotation vector (on the page's side) and log focal length."""
    along = (lines.ends - lines.starts) / lines.lengths[:, None]
    middle = 0.5 * (lines.starts + lines.ends)
    upright = lines.upright.astype(int)
    # Columns: the vanishing point, and its derivatives: d R exp([w]) e / dw_j = R (e_j x e).
    V = np.empty((len(lines), 3, 5))
    V[:, :, 0] = rotation.T[upright]
    for j in range(3):
        V[:, :, 1 + j] = _TURNED[j, upright] @ rotation.T
    V[:, :2, :4] *= focal
    V[:, :2, 4], V[:, 2, 4] = V[:, :2, 0], 0.0
    way = V[:, :2] - middle[:, :, None] * V[:, 2:]
    dot = np.einsum("ni,nik->nk", along, way)
    cross = along[:, :1] * way[:, 1] - along[:, 1:] * way[:, 0]
    straight = np.where(dot[:, 0] == 0, 1e-12, dot[:, 0])
    square = np.maximum(straight**2 + cross[:, 0] ** 2, 1e-24)[:, None]
    return np.arctan(cross[:, 0] / straight), (dot[:, :1] * cross[:, 1:] - cross[:, :1] * dot[:, 1:]) / square


def start_plane(lines: StraightLines, prior: FocalPrior) -> PagePlane | None:
    """Closed form: both vanishing points, f from them where the prior allows; None with fewer than three lines.

    With one line along an axis, that axis is the direction in the line's plane of sight at right angles to the other.
    """
    level, upright = (lines.homogeneous[lines.upright == side] for side in (False, True))
    if min(len(level), len(upright)) < 1 or len(lines) < 3:
        return None
    v_h = _meeting(level) if len(level) > 1 else None
    v_v = _meeting(upright) if len(upright) > 1 else None
    focal = float(np.exp(prior.log_focal))
    to_plane_of_sight = np.array([focal, focal, 1.0])
    if v_h is not None and v_v is not None:
        solved = focal_length_from_vanishing_points(v_h, v_v)
        if solved is not None:
            reach = np.exp(4 * prior.deviation)
            focal = float(np.clip(solved, focal / reach, focal * reach))
    elif v_h is not None:
        v_v = _at_right_angles(upright[0] * to_plane_of_sight, v_h, focal)
    elif v_v is not None:
        v_h = _at_right_angles(level[0] * to_plane_of_sight, v_v, focal)
    assert v_h is not None
    assert v_v is not None
    return PagePlane(rotation_from_flows(v_h, v_v, focal), focal)


def _meeting(lines: Floats) -> Floats:
    """Homogeneous point (3,) in which lines (N, 3) meet."""
    return np.asarray(np.linalg.svd(lines, full_matrices=True)[2][2])


def _at_right_angles(plane_of_sight: Floats, other: Floats, focal: float) -> Floats:
    """Vanishing point (3,) of the direction in `plane_of_sight` (its normal) at right angles to that of `other`."""
    direction = np.cross(plane_of_sight, other * np.array([1.0, 1.0, focal]))
    return np.asarray(direction * np.array([focal, focal, 1.0]))


def fit_line_plane(lines: StraightLines, prior: FocalPrior, start: PagePlane) -> LinePlane:
    """Fit rotation (3) and log focal length to straight lines by least squares (Levenberg-Marquardt).

    Parameters
    ----------
    lines
        Lines along both axes of the page.
    prior
        Of the focal length; always squared.
    start
        Plane from which the fit starts.

    Returns
    -------
    LinePlane
        The plane, its residuals and its cost.
    """
    deviations = lines.direction_deviations_rad

    def cost(plane: PagePlane) -> float:
        r = line_directions(plane, lines) / deviations
        pull = (np.log(plane.focal) - prior.log_focal) / prior.deviation
        return float(r @ r + pull**2)

    plane, least, damping = start, cost(start), FIRST_DAMPING
    A, r = _linearized(plane, lines, prior)
    for _ in range(MAX_STEPS):
        information = A[:, :4].T @ A[:, :4]
        damped = information + damping * np.diag(np.diag(information) + 1e-9)
        step = -np.linalg.solve(damped, A[:, :4].T @ A[:, 4])
        moved = _moved(plane, step)
        tried = cost(moved)
        if tried <= least:
            plane, least, damping = moved, tried, DAMPING_FALL * damping
            A, r = _linearized(plane, lines, prior)
        else:
            damping *= DAMPING_RISE
        if float(np.abs(step).max()) < SMALL_STEP:
            break
    information = A[:, :4].T @ A[:, :4]
    return LinePlane(plane, r, _focal_deviation(information, prior), least)


def _moved(plane: PagePlane, step: Vector) -> PagePlane:
    focal = float(np.clip(plane.focal * np.exp(np.clip(step[3], -1.0, 1.0)), MIN_FOCAL, MAX_FOCAL))
    return PagePlane(plane.rotation @ rotation_from_vector(step[:3]), focal)


def _linearized(plane: PagePlane, lines: StraightLines, prior: FocalPrior) -> tuple[Floats, Vector]:
    """Derivatives and residuals (N + 1, 5), in deviations, that of the prior in the last row; and the angles (N,)."""
    r, J = _directions(plane.rotation, plane.focal, lines)
    weights = 1 / lines.direction_deviations_rad
    rows = np.column_stack([J, r]) * weights[:, None]
    pull = (np.log(plane.focal) - prior.log_focal) / prior.deviation
    return np.vstack([rows, [[0.0, 0.0, 0.0, 1 / prior.deviation, pull]]]), r


def _focal_deviation(information: Floats, prior: FocalPrior) -> float:
    """Deviation of log f from the lines alone."""
    without = information.copy()
    without[3, 3] -= 1 / prior.deviation**2
    # What is left of log f when the rotation is free.
    left = without[3, 3] - without[3, :3] @ np.linalg.lstsq(without[:3, :3], without[:3, 3], rcond=1e-12)[0]
    return float(1 / np.sqrt(left)) if left > 1e-6 else float("inf")


def fit_principal_point(
    lines: StraightLines, prior: FocalPrior, start: PagePlane, deviation: float
) -> tuple[Floats, float]:
    """The principal point (2,) nearest to the middle that explains the lines, and the sum of squares that is left.

    `deviation` is that of each coordinate. If the lines fit a usual camera it stays in the middle.
    """

    def residuals(x: Vector) -> Vector:
        plane = _moved(start, x[:4])
        r = line_directions(plane, lines.seen_from(x[4:])) / lines.direction_deviations_rad
        pull = (np.log(plane.focal) - prior.log_focal) / prior.deviation
        return np.concatenate([r, [pull], x[4:] / deviation])

    fit = least_squares(residuals, np.zeros(len(STEPS)), x_scale=STEPS, max_nfev=MOST_EVALUATIONS)
    return np.asarray(fit.x[4:]), 2 * float(fit.cost)


def neighbouring_fits(
    fit: LinePlane, lines: StraightLines, prior: FocalPrior
) -> Iterator[tuple[PagePlane, StraightLines]]:
    """Plane and lines as each observation in turn is moved by its own deviation, to first order.

    The observations are both points of each line, and the prior. They are independent, so the standard deviation of a
    value that follows from the fit is the root of the sum of its squared changes.
    """
    A, r = _linearized(fit.plane, lines, prior)
    inverse = np.linalg.pinv(A[:, :4])
    for row in range(len(lines)):
        deviation = float(lines.deviations[row])
        for start, end in ((deviation, 0.0), (0.0, deviation)):
            moved = lines.moved(row, start, end)
            change = (line_directions(fit.plane, moved) - r) / lines.direction_deviations_rad
            yield _moved(fit.plane, -inverse[:, :-1] @ change), moved
    yield _moved(fit.plane, inverse[:, -1]), lines

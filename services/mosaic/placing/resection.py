"""The camera of a photo, from points of a sheet in space that it shows."""

from collections.abc import Callable

import cv2
import numpy as np
from scipy.optimize import least_squares

from services.arrays import Floats, Points, Vector
from services.geometry.focal_prior import FocalPrior
from services.robust import CAUCHY_WIDTH, MEDIAN_LENGTH
from services.sheet.ridged.views import CAMERA_UNKNOWNS, OtherCamera

FEWEST = 12
"""Points: a camera has seven unknowns, and four points in general place determine its pose."""
LEAST_DEVIATION = 1e-5
"""Of a point, centred units: a hundredth of a pixel."""
ROUNDS = 2
"""The scale of the loss is what the fit before it leaves."""


def resect_camera(X: Floats, seen: Points, prior: FocalPrior) -> OtherCamera | None:
    """The camera that shows points X (N, 3) in space at `seen` (N, 2), centred; None if they are too few.

    Robust least squares from a closed form for the prior's focal length (Terzakis and Lourakis 2020, SQPnP).
    """
    known = np.isfinite(X).all(axis=1) & np.isfinite(seen).all(axis=1)
    if np.count_nonzero(known) < FEWEST:
        return None
    X, seen = X[known], seen[known]
    focal = float(np.exp(prior.log_focal))
    ok, turn, shift = cv2.solvePnP(
        X, seen, np.diag([focal, focal, 1.0]), np.zeros(0), flags=cv2.SOLVEPNP_SQPNP
    )
    if not ok:
        return None
    start = OtherCamera(
        np.asarray(cv2.Rodrigues(turn)[0], np.float64), np.asarray(shift, np.float64).ravel(), focal
    )
    change = np.array([0.0] * (CAMERA_UNKNOWNS - 1) + [prior.log_focal])
    for _ in range(ROUNDS):
        left = np.linalg.norm(start.moved(change).project(X) - seen, axis=1)
        deviation = max(float(np.median(left)) / MEDIAN_LENGTH, LEAST_DEVIATION)
        residuals, derivatives = _residuals(start, X, seen, prior, deviation)
        change = least_squares(residuals, change, derivatives, loss="cauchy", f_scale=CAUCHY_WIDTH).x
    return start.moved(change)


def _residuals(
    start: OtherCamera, X: Floats, seen: Points, prior: FocalPrior, deviation: float
) -> tuple[Callable[[Vector], Vector], Callable[[Vector], Floats]]:
    """Functions of the change of `start`: distances of the points and of the focal length, in deviations, and their
    derivatives.
    """

    def residuals(change: Vector) -> Vector:
        off = (start.moved(change).project(X) - seen) / deviation
        return np.append(off.ravel(), (change[-1] - prior.log_focal) / prior.deviation)

    def derivatives(change: Vector) -> Floats:
        _, by_camera = start.moved(change).derivatives(X, change[:3])
        by_focal = np.zeros((1, CAMERA_UNKNOWNS))
        by_focal[0, -1] = 1 / prior.deviation
        return np.concatenate([by_camera.reshape(-1, CAMERA_UNKNOWNS) / deviation, by_focal])

    return residuals, derivatives

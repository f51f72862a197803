"""Fit of the developable surface to flows, text lines, line spacing and margins together, by a trust region."""

from dataclasses import dataclass, field, replace

import numpy as np

from services.arrays import Floats, Vector
from services.geometry.camera import rotation_from_vector
from services.robust import robust_scale
from services.sheet.developable.observations import PageObservations
from services.sheet.developable.print_residuals import FittingParameters
from services.sheet.developable.residuals import BENDS, SLANT, PageResiduals
from services.sheet.developable.surface import BendBasis, DevelopableSurface
from services.sheet.developable.variation import LOG_FOCAL, TURN
from services.trust_region import least_squares

LEAST_STEP = 1e-6
"""Relative change of the unknowns below which a fit ends."""

LEAST_SHOWN = 0.3
"""Of the deviations assumed: a fit may follow its observations."""


@dataclass(frozen=True, slots=True, eq=False)
class SurfaceStart:
    """Start of a fit.

    `rotation` (3, 3) has the text's axes at the `anchor` (centred photo point), `parameters` (5 + K,) log focal
    length, skew, slopes, slant and bends over `basis`.
    """

    rotation: Floats
    anchor: tuple[float, float]
    basis: BendBasis
    parameters: Vector


@dataclass(frozen=True, slots=True, eq=False)
class FittedSurface:
    """The fitted surface, its cost, and the deviations of its residuals.

    `cost` is half the sum of the squared residuals under their losses; the scales are robust deviations of the
    residuals, in units of those assumed; `log_focal_deviation` is that of the observations, without the prior.
    """

    surface: DevelopableSurface
    slant_rad: float
    cost: float
    line_scale: float
    spacing_scale: float
    side_scale: float
    major_scale: float
    log_focal_deviation: float
    start: SurfaceStart = field(repr=False)
    principal_point: tuple[float, float] = (0.0, 0.0)
    """In the coordinates of the observations; `surface` and `start` are relative to it."""


def fit_surface(
    start: SurfaceStart, observed: PageObservations, parameters: FittingParameters | None = None
) -> FittedSurface:
    """Fit the surface by robust least squares over turn, focal length, skew, slopes of the rulings, slant and bends.

    Parameters
    ----------
    start
        Pose, focal length and bends at which the fit starts.
    observed
        Flows, text lines and margins in centred unit coordinates.
    parameters
        Standard deviations of the observations, and priors.

    Returns
    -------
    FittedSurface
        The surface of least cost near `start`.
    """
    p = parameters or FittingParameters()
    free = observed.principal_point.start if observed.principal_point else ()
    x0 = np.concatenate([np.zeros(3), start.parameters, free])
    residuals = PageResiduals(start.rotation, start.anchor, start.basis, observed, x0, p)
    scale = np.concatenate([[0.05, 0.05, 0.05, 0.1, 0.1, 0.1, 0.1, 0.01], np.ones(len(x0) - BENDS)])
    scale[len(x0) - len(free) :] = 0.1
    fit = least_squares(residuals.evaluate, x0, scale, p.max_evaluations, p.least_gain, LEAST_STEP)
    parts = residuals.parts(fit.x)
    rotation = start.rotation @ rotation_from_vector(fit.x[TURN])
    surface = residuals.surface(fit.x)
    moved = replace(
        start,
        rotation=rotation,
        anchor=surface.anchor,
        parameters=np.asarray(fit.x[TURN.stop : residuals.principal]),
    )
    return FittedSurface(
        surface,
        float(fit.x[SLANT]),
        float(fit.cost),
        robust_scale(parts["straight"].value),
        robust_scale(parts["spacing"].value),
        robust_scale(parts["sides"].value),
        robust_scale(parts["major"].value),
        _focal_deviation(fit.jac, observed.focal_deviation),
        moved,
        residuals.principal_point(fit.x),
    )


def free_gain(
    at: SurfaceStart, observed: PageObservations, parameters: FittingParameters
) -> tuple[float, float]:
    """Gain in cost by a free principal point, along x and along y, to first order (Rao's score test).

    `at` is a surface that was fitted with the principal point at the origin; `observed` has a prior on it.
    """
    assert observed.principal_point is not None
    x = np.concatenate([np.zeros(3), at.parameters, (0.0, 0.0)])
    r, J = PageResiduals(at.rotation, at.anchor, at.basis, observed, x, parameters).evaluate(x)
    J = J / np.maximum(np.linalg.norm(J, axis=0), 1e-12)
    gains = []
    for axis in (-2, -1):
        # The part of the offset's effect that the other parameters cannot explain.
        effect = J[:, axis] - J[:, :-2] @ np.linalg.lstsq(J[:, :-2], J[:, axis], rcond=1e-9)[0]
        gains.append(0.5 * float(effect @ r) ** 2 / max(float(effect @ effect), 1e-12))
    return gains[0], gains[1]


def _focal_deviation(jacobian: Floats, prior_deviation: float) -> float:
    """Deviation of log f from the observations alone: without the prior's information."""
    information = jacobian.T @ jacobian
    information[LOG_FOCAL, LOG_FOCAL] -= 1 / prior_deviation**2
    information += 1e-9 * np.trace(information) * np.eye(len(information))
    variance = float(np.linalg.inv(information)[LOG_FOCAL, LOG_FOCAL])
    return float(np.sqrt(variance)) if variance > 0 else float("inf")


def rescale_deviations(parameters: FittingParameters, fitted: FittedSurface) -> FittingParameters:
    """Parameters with the deviations of lines, sides and spacings that a fit has shown, where they are larger."""
    spacing = max(1.0, fitted.spacing_scale)
    return replace(
        parameters,
        line_factor=parameters.line_factor * max(1.0, fitted.line_scale),
        side_factor=parameters.side_factor * max(1.0, fitted.side_scale),
        spacing=parameters.spacing * spacing,
    )


def shown_deviations(parameters: FittingParameters, fitted: FittedSurface) -> FittingParameters:
    """Parameters with the deviations of directions along the lines, and of spacings, that a fit has shown, if smaller.

    Those assumed are of photos of any kind; sharp ones have a sixth of them. Not those of strokes: what is wrong with
    the shape of a letter is so wherever it stands, and neighbours do not tell it.
    """
    major, spacing = np.clip((fitted.major_scale, fitted.spacing_scale), LEAST_SHOWN, 1.0).tolist()
    return replace(
        parameters,
        major_factor=parameters.major_factor * major,
        spacing=parameters.spacing * spacing,
    )

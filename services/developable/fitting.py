"""Fit of the developable surface to flows, text lines, line spacing and margins together, by a trust region."""

from dataclasses import dataclass, field, replace

import numpy as np
from scipy.optimize import least_squares

from services.arrays import Floats, Vector
from services.developable.observations import PageObservations
from services.developable.residuals import BENDS, FittingParameters, PageResiduals
from services.developable.surface import BendBasis, DevelopableSurface
from services.geometry.camera import rotation_from_vector


@dataclass(frozen=True, slots=True, eq=False)
class SurfaceStart:
    """Where a fit begins.

    `rotation` (3, 3) holds the text's axes at the `anchor` (centred photo point), `parameters` (5 + K,) log focal
    length, skew, slopes, slant and bends over `basis`.
    """

    rotation: Floats
    anchor: tuple[float, float]
    basis: BendBasis
    parameters: Vector


@dataclass(frozen=True, slots=True, eq=False)
class FittedSurface:
    """The fitted surface and how well it explains what was seen.

    `cost` is half the sum of the softened squared residuals; the spreads are robust deviations of the residuals (lines
    in units of those assumed); `log_focal_deviation` is what the observations leave, without the prior.
    """

    surface: DevelopableSurface
    slant_rad: float
    cost: float
    line_spread: float
    spacing_spread: float
    major_spread_rad: float
    minor_spread_rad: float
    log_focal_deviation: float
    start: SurfaceStart = field(repr=False)


def fit_surface(
    start: SurfaceStart, observed: PageObservations, parameters: FittingParameters | None = None
) -> FittedSurface:
    """Least squares from `start` over turn, focal length, skew, slopes of the rulings, slant and bends."""
    p = parameters or FittingParameters()
    x0 = np.concatenate([np.zeros(3), start.parameters])
    residuals = PageResiduals(start.rotation, start.anchor, start.basis, observed, x0, p)
    scale = np.concatenate([[0.05, 0.05, 0.05, 0.1, 0.1, 0.1, 0.1, 0.01], np.ones(len(x0) - BENDS)])
    fit = least_squares(
        lambda x: residuals.evaluate(x)[0],
        x0,
        jac=lambda x: residuals.evaluate(x)[1],
        method="trf",
        x_scale=scale,
        max_nfev=p.max_evaluations,
        ftol=1e-5,
        xtol=1e-6,
    )
    parts = residuals.parts(fit.x)
    rotation = start.rotation @ rotation_from_vector(fit.x[:3])
    return FittedSurface(
        residuals.surface(fit.x),
        float(fit.x[BENDS - 1]),
        float(fit.cost),
        _spread(parts["straight"].value),
        _spread(parts["spacing"].value),
        _spread(parts["major"].value * residuals.major_deviation),
        _spread(parts["minor"].value * residuals.minor_deviation),
        _focal_deviation(fit.jac, observed.focal_deviation),
        replace(start, rotation=rotation, parameters=np.asarray(fit.x[3:])),
    )


def _focal_deviation(jacobian: Floats, prior_deviation: float) -> float:
    """Deviation of log f from the observations alone: the prior's information is taken out again."""
    information = jacobian.T @ jacobian
    information[3, 3] -= 1 / prior_deviation**2
    information += 1e-9 * np.trace(information) * np.eye(len(information))
    variance = float(np.linalg.inv(information)[3, 3])
    return float(np.sqrt(variance)) if variance > 0 else float("inf")


def _spread(r: Vector) -> float:
    return 1.4826 * float(np.median(np.abs(r))) if len(r) else 0.0


def widen(parameters: FittingParameters, fitted: FittedSurface) -> FittingParameters:
    """Parameters whose deviations of lines and spacings are those that a fit has shown, where they are larger."""
    spacing = max(1.0, fitted.spacing_spread)
    return replace(
        parameters,
        line_factor=parameters.line_factor * max(1.0, fitted.line_spread),
        spacing=parameters.spacing * spacing,
        spacing_between=parameters.spacing_between * spacing,
    )

"""Robust estimation: scale of residuals, loss functions with their weights, reweighted least squares.

Losses are functions of a residual over its scale.

- Soft L1 (pseudo-Huber) is linear for large residuals: outliers keep some weight, and the minimum is easy to find.
- Cauchy's grows as a logarithm: outliers keep little weight, and groups of residuals may be wholly wrong.
- Geman and McClure's is bounded: outliers lose all weight.

`scipy.optimize.least_squares` has one loss for all residuals. Where groups of residuals have their own, `soft_l1` and
`cauchy` give residuals whose plain squares are the loss.

References
----------
Huber and Ronchetti, Robust Statistics, 2nd edition 2009, chapters 5 (scale) and 7 (regression).
Barron, A General and Adaptive Robust Loss Function, CVPR 2019: the losses here are its members 1, 0 and -2.
Triggs et al., Bundle Adjustment - A Modern Synthesis, 2000, section 3: residuals under a loss.
"""

from collections.abc import Callable

import numpy as np

from services.arrays import Floats, Vector
from services.order_statistics import median

MAD_TO_DEVIATION = 1.4826
"""Standard deviation of normal errors over their median absolute value."""
CAUCHY_WIDTH = 2.385
"""Scale of Cauchy's loss over the standard deviation of normal errors: 95 % efficiency (Holland and Welsch 1977)."""
REWEIGHTED_FITS = 8
"""Of reweighted least squares; the weights then change no more."""
MEDIAN_LENGTH = 1.1774
"""Median length of normal vectors of the plane over the deviation of one coordinate (Rayleigh)."""


Loss = Callable[[Vector, float | Vector], Vector]
"""Weights (N,) of residuals (N,) for their scale."""
Scale = Callable[[int, Vector], float]
"""Scale of residuals (N,) at an iteration, counted from 0."""


def robust_scale(residuals: Floats, empty: float = 0.0) -> float:
    """Standard deviation of normal errors with the median absolute value of `residuals` (N,); `empty` of none."""
    return MAD_TO_DEVIATION * median(np.abs(residuals).ravel()) if np.size(residuals) else empty


def cauchy_weights(residuals: Floats, scale: float | Floats = 1.0) -> Floats:
    """Weights 1 / (1 + (r / scale)^2) of residuals, of any shape."""
    return np.asarray(1 / (1 + (residuals / scale) ** 2))


def geman_mcclure_weights(residuals: Floats, scale: float | Floats = 1.0) -> Floats:
    """Weights 1 / (1 + (r / scale)^2)^2 of residuals, of any shape."""
    return np.asarray(1 / (1 + (residuals / scale) ** 2) ** 2)


def soft_l1(residuals: Vector) -> tuple[Vector, Vector]:
    """Residuals (N,) whose squares are the loss 2 (sqrt(1 + r^2) - 1), and their derivatives by r (N,)."""
    root = np.sqrt(1 + residuals**2)
    factor = np.sqrt(2 / (root + 1))
    return residuals * factor, 1 / (factor * root)


def cauchy(residuals: Vector) -> tuple[Vector, Vector]:
    """Residuals (N,) whose squares are Cauchy's loss log(1 + r^2), and their derivatives by r (N,)."""
    square = residuals**2
    factor = np.sqrt(np.where(square > 1e-12, np.log1p(square) / np.maximum(square, 1e-300), 1.0))
    return residuals * factor, 1 / (factor * (1 + square))


def narrowing(first: float, factor: float, last: float) -> Scale:
    """Scale that shrinks by `factor` an iteration from `first` to `last` (graduated non-convexity)."""
    return lambda k, _: max(first * factor**k, last)


def fit_reweighted(
    design: Floats,
    target: Vector,
    loss: Loss,
    scale: Scale,
    iterations: int,
    *,
    weights: Vector | None = None,
    start: Vector | None = None,
    damping: Floats | None = None,
    weigh_damping: bool = False,
) -> Vector:
    """Coefficients (M,) of a linear model by iteratively reweighted least squares.

    Parameters
    ----------
    design
        (N, M): the model predicts `design` @ coefficients for the `target` (N,).
    loss, scale
        What a residual's weight is, and the scale that it is divided by in each iteration.
    weights
        (N,) of the observations, which the loss is multiplied by.
    start
        (M,) coefficients whose residuals the first iteration is weighted by; without it, none lose weight there.
    damping
        (M, M) quadratic form of the coefficients that is added to the squares; with `weigh_damping` it is multiplied
        by the mean weight.
    """
    own = np.ones(len(target)) if weights is None else weights
    c, held = start, np.zeros((design.shape[1], design.shape[1])) if damping is None else damping
    for k in range(iterations):
        w = own
        if c is not None:
            residuals = np.asarray(target - design @ c)
            w = own * loss(residuals, scale(k, residuals))
        weighted = (design * w[:, None]).T
        c = np.linalg.solve(
            weighted @ design + held * (w.mean() if weigh_damping else 1.0), weighted @ target
        )
    return np.zeros(design.shape[1]) if c is None else c

"""Nonlinear least squares in a trust region, for few unknowns and many residuals.

The steps are those of Levenberg and Marquardt with the radius of More (The Levenberg-Marquardt algorithm, 1977), as
SciPy's `least_squares` takes them. But the normal equations are decomposed, not the Jacobian: of a thousand residuals
by thirty unknowns that takes a fifth of the time, and half of the digits are enough for a step.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from services.arrays import Floats, Vector

LEAST_GRADIENT = 1e-8
RADIUS_SLACK = 0.01
"""A step that ends at the radius may miss it by this share of it."""
MOST_DAMPINGS = 10


@dataclass(frozen=True, slots=True, eq=False)
class Minimum:
    """Where the search ended: unknowns (M,), half the sum of the squares there, and the derivatives (N, M) there."""

    x: Vector
    cost: float
    jac: Floats
    evaluations: int


def least_squares(
    evaluate: Callable[[Vector], tuple[Vector, Floats]],
    start: Vector,
    scale: Vector,
    most_evaluations: int,
    least_gain: float = 1e-8,
    least_step: float = 1e-8,
) -> Minimum:
    """Minimize the sum of the squared residuals (N,), which `evaluate` returns with their derivatives (N, M).

    Steps are measured in units of `scale` (M,). The search ends at a step that gains less than `least_gain` of the
    cost, or that is shorter than `least_step` of the unknowns.
    """
    x, (value, jac) = start, evaluate(start)
    cost, count, damping = 0.5 * float(value @ value), 1, 0.0
    radius = _length(start / scale) or 1.0
    ended = False
    while not ended and count < most_evaluations:
        gradient = value @ jac
        if np.abs(gradient).max() < LEAST_GRADIENT:
            break
        g, A = scale * gradient, (jac.T @ jac) * np.outer(scale, scale)
        squares, axes = np.linalg.eigh(A)
        # What rounding leaves of the least ones would be noise, or negative.
        squares = np.maximum(squares, np.finfo(float).eps * len(value) * squares[-1])
        along, better = g @ axes, False
        while not better and not ended and count < most_evaluations:
            parts, damping = _step_within(along, squares, radius, damping)
            step = axes @ parts
            new = x + scale * step
            new_value, new_jac = evaluate(new)
            count += 1
            length = _length(step)
            if not np.isfinite(new_value).all():
                radius = 0.25 * length
                continue
            new_cost = 0.5 * float(new_value @ new_value)
            gain, expected = cost - new_cost, -float(0.5 * squares @ (parts * parts) + along @ parts)
            ratio = gain / expected if expected > 0 else float(expected == gain == 0)
            ended = (gain < least_gain * cost and ratio > 0.25) or _length(scale * step) < least_step * (
                least_step + _length(x)
            )
            better = gain > 0
            if not ended:
                before = radius
                if ratio < 0.25:
                    radius = 0.25 * length
                elif ratio > 0.75 and length > 0.95 * radius:
                    radius *= 2.0
                damping *= before / radius
        if better:
            x, value, jac, cost = new, new_value, new_jac, new_cost
    return Minimum(x, cost, jac, count)


def _length(vector: Vector) -> float:
    """As `np.linalg.norm` of a vector (M,), whose call takes longer than its sum."""
    return math.sqrt(float(vector @ vector))


def _step_within(along: Vector, squares: Vector, radius: float, damping: float) -> tuple[Vector, float]:
    """The best step no longer than `radius`, along the axes (M,) of the normal equations, and its damping.

    `along` is the gradient along these axes and `squares` are their eigenvalues; the search for the damping starts at
    the last step's.
    """
    parts = -along / squares
    longer = _length(parts)
    if longer <= radius:
        return parts, 0.0
    upper = _length(along) / radius
    lower = (longer - radius) * longer / float(np.sum(along**2 / squares**3))
    for _ in range(MOST_DAMPINGS):
        if not lower <= damping <= upper:
            damping = max(0.001 * upper, (lower * upper) ** 0.5)
        held = squares + damping
        parts = -along / held
        longer = _length(parts)
        excess = longer - radius
        if excess < 0:
            upper = damping
        slope = -float(np.sum(along**2 / held**3)) / longer
        lower = max(lower, damping - excess / slope)
        damping -= longer * excess / (slope * radius)
        if abs(excess) < RADIUS_SLACK * radius:
            break
    parts = -along / (squares + damping)
    return parts * (radius / _length(parts)), damping

"""Fit of a creased sheet: reweighted least squares by Levenberg's and Marquardt's method, with steps that may fail."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import vstack

from services.arrays import Vector
from services.sheet.ridged.mesh import SheetMesh
from services.sheet.ridged.normal_equations import NormalEquations, normal_equations
from services.sheet.ridged.residuals import RidgedParameters, SheetObservations, SheetResiduals, robust


@dataclass(frozen=True, slots=True, eq=False)
class FittedMesh:
    """The fitted mesh, the cost it was found at, and the number of evaluations."""

    mesh: SheetMesh
    cost: float
    evaluations: int
    parts: tuple[float, ...]


def fit_mesh(
    start: SheetMesh, observed: SheetObservations, parameters: RidgedParameters | None = None
) -> FittedMesh:
    """The mesh near `start` that explains `observed` at the least cost."""
    p = parameters or RidgedParameters()
    residuals = SheetResiduals(start, observed, p)
    x, order, count = residuals.x0, residuals.order, 0
    for scale, slack, ridge in p.schedule:
        residuals.slack = slack
        x, cost, parts, used = _minimize(residuals, x, order, (scale, ridge), p)
        count += used
    return FittedMesh(residuals.mesh(x), cost, count, parts)


def _minimize(
    residuals: SheetResiduals,
    x: Vector,
    order: NDArray[np.intp],
    scale: tuple[float, float],
    p: RidgedParameters,
) -> tuple[Vector, float, tuple[float, ...], int]:
    """The unknowns at the least cost under losses of `scale`, that cost and its parts, and the evaluations it took."""
    cost, equations, parts = _linearize(residuals, x, order, scale)
    damping, growth, count = 1e-3, 4.0, 1
    while count < p.evaluations:
        diagonal = equations.diagonal
        step = equations.solve(damping * diagonal + 1e-9 * float(diagonal.max()))
        count += 1
        if step is None:
            damping *= 10
            continue
        tried = x + step
        new_cost, new_equations, new_parts = _linearize(residuals, tried, order, scale)
        if np.isfinite(new_cost) and new_cost < cost:
            gained = cost - new_cost
            x, cost, equations, parts = tried, new_cost, new_equations, new_parts
            damping, growth = max(damping / 5, 1e-9), 4.0
            if gained < p.gain * max(cost, 1.0):
                break
        else:
            damping, growth = damping * growth, 2 * growth
            if damping > 1e6:
                break
    return x, cost, parts, count


def _linearize(
    residuals: SheetResiduals, x: Vector, order: NDArray[np.intp], scale: tuple[float, float]
) -> tuple[float, NormalEquations, tuple[float, ...]]:
    """Cost at `x`, the normal equations of the reweighted residuals, and the costs of all kinds of residuals."""
    blocks = residuals.blocks(x)
    costs, values, jacobians = [], [], []
    for block in blocks:
        cost, weights = robust(block, *scale)
        root = np.sqrt(weights)
        scaled = block.jacobian.copy()
        scaled.data = scaled.data * np.repeat(root, np.diff(scaled.indptr))
        costs.append(cost)
        values.append(root * block.values)
        jacobians.append(scaled)
    equations = normal_equations(
        vstack(jacobians, format="csr"), np.concatenate(values), order, residuals.border
    )
    return sum(costs), equations, tuple(costs)

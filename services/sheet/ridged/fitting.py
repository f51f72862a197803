"""Fit of a creased sheet: reweighted least squares by Levenberg's and Marquardt's method, coarse to fine."""

from dataclasses import dataclass, replace

import numpy as np

from services.arrays import Vector
from services.sheet.ridged.blocks import SparseRows, robust
from services.sheet.ridged.mesh import SheetMesh
from services.sheet.ridged.normal_equations import normal_equations
from services.sheet.ridged.observations import SheetObservations
from services.sheet.ridged.parameters import MAX_DAMPING, RidgedParameters
from services.sheet.ridged.residuals import SheetResiduals
from services.sheet.ridged.views import OtherView


@dataclass(frozen=True, slots=True, eq=False)
class FittedMesh:
    """The fitted mesh, the cost it was found at, how often the residuals were computed, and the other views."""

    mesh: SheetMesh
    cost: float
    evaluations: int
    views: tuple[OtherView, ...] = ()


def fit_mesh(start: SheetMesh, observed: SheetObservations, p: RidgedParameters) -> FittedMesh:
    """The mesh near `start` that explains `observed` at the least cost."""
    mesh, cost, count = start, float("inf"), 0
    for stage in p.schedule:
        residuals = SheetResiduals(mesh.resampled(stage.cells + 1), observed, p, stage)
        x, cost, used = _minimize(residuals, p)
        mesh, count = residuals.mesh(x), count + used
        observed = replace(observed, views=residuals.views(x))
    return FittedMesh(mesh, cost, count, observed.views)


def _minimize(residuals: SheetResiduals, p: RidgedParameters) -> tuple[Vector, float, int]:
    """The unknowns at the least cost near the start, that cost, and the evaluations it took."""
    x, order, border = residuals.x0, residuals.order, residuals.border
    cost, values, jacobian = _linearize(residuals, x)
    equations = normal_equations(jacobian, values, order, border)
    damping, growth, count = 1e-3, 4.0, 1
    while count < p.evaluations and damping < MAX_DAMPING:
        diagonal = equations.diagonal
        step = equations.solve(damping * diagonal + 1e-9 * float(diagonal.max()))
        count += 1
        if step is not None:
            new_cost, values, jacobian = _linearize(residuals, x + step)
            if np.isfinite(new_cost) and new_cost < cost:
                gained = cost - new_cost
                x, cost = x + step, new_cost
                if gained < p.gain * max(cost, 1.0):
                    break
                equations = normal_equations(jacobian, values, order, border)
                damping, growth = max(damping / 5, 1e-9), 4.0
                continue
        damping, growth = damping * growth, 2 * growth
    return x, cost, count


def _linearize(residuals: SheetResiduals, x: Vector) -> tuple[float, Vector, list[SparseRows]]:
    """Cost at `x`, and the reweighted residuals with their Jacobian."""
    cost, values, jacobians = 0.0, [], []
    for block in residuals.blocks(x):
        part, weights = robust(block, residuals.stage)
        root = np.sqrt(weights)
        cost += part
        values.append(root * block.values)
        jacobians.append(block.jacobian.scaled(root))
    return cost, np.concatenate(values), jacobians

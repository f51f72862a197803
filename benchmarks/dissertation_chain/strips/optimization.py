"""Strip normals and focal length together, by a trust region on all constraints (3.3.5)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.sparse import csr_array

from benchmarks.dissertation_chain.strips import constraints
from benchmarks.dissertation_chain.strips.constraints import (
    Deviations,
    StripVectors,
    Term,
    strip_vectors,
    unit,
)
from benchmarks.dissertation_chain.strips.evidence import StripEvidence
from benchmarks.dissertation_chain.strips.initial import FocalKnowledge
from services.arrays import Floats, Vector

_FARTHEST_FOCAL = 3.0
"""The focal length stays within exp of this of one half diagonal (beyond, all lenses are alike)."""


@dataclass(frozen=True, slots=True)
class OptimizationParameters:
    """Bounds of the iteration."""

    evaluations: int = 40
    """At most; 4 to 8 are the rule."""
    tolerance: float = 1e-4
    """Relative change of the objective or of the unknowns that ends it: a hundredth of a degree."""
    unit_length: float = 0.01
    """Deviation of mu_6."""


@dataclass(frozen=True, slots=True, eq=False)
class OptimizedShape:
    """Unit normals (L, 3), focal length, the objective there, and how many evaluations it took."""

    normals: Floats
    focal: float
    objective: float
    evaluations: int
    converged: bool


class StripObjective:
    """Residuals of all constraints and their sparse Jacobian, as functions of x = (N_1, ..., N_L, log f).

    Normals are free 3-vectors that mu_6 keeps at unit length: on noisy strips this comes out as near the truth
    as two angles per normal, in fewer iterations. A row of the Jacobian has the columns of one normal or of two
    neighbouring ones, and that of f, which is missing when `knowledge` fixes f.
    """

    def __init__(
        self,
        evidence: StripEvidence,
        focal: float,
        knowledge: FocalKnowledge,
        deviations: Deviations,
        unit_length: float,
    ) -> None:
        self._evidence = evidence
        self._focal = focal
        self._knowledge = knowledge
        self._deviations = deviations
        self._unit_length = unit_length
        trust = evidence.major_weights.mean(axis=1)
        self._both_sides = np.minimum(trust[1:], trust[:-1])
        self._last: tuple[bytes, list[Term], int] | None = None

    def unpack(self, x: Vector) -> tuple[Floats, float]:
        """Normals (L, 3), not yet of unit length, and focal length."""
        normals = x[: 3 * self._evidence.count].reshape(-1, 3)
        if self._knowledge.fixed:
            return normals, self._focal
        return normals, float(np.exp(np.clip(x[-1], -_FARTHEST_FOCAL, _FARTHEST_FOCAL)))

    def pack(self, normals: Floats, focal: float) -> Vector:
        """Inverse of `unpack`."""
        x = np.asarray(normals).ravel()
        return x if self._knowledge.fixed else np.append(x, np.log(focal))

    def residuals(self, x: Vector) -> Vector:
        """All terms, those of `robust_count` first; last, what is known of the focal length."""
        terms, _ = self._terms(x)
        known = (
            [] if self._knowledge.fixed else [(x[-1] - self._knowledge.log_focal) / self._knowledge.deviation]
        )
        return np.concatenate([*(term.residuals for term in terms), known])

    def jacobian(self, x: Vector) -> csr_array:
        """Derivatives of `residuals`."""
        terms, _ = self._terms(x)
        count, size = sum(len(term.residuals) for term in terms), 3 * self._evidence.count
        entries, at_row, at_column, first = [], [], [], 0
        for term in terms:
            columns = 3 * term.strips[:, :, None] + np.arange(3)
            rows = np.arange(first, first + len(term.residuals))
            entries.append(term.by_normals.ravel())
            at_column.append(columns.ravel())
            at_row.append(np.broadcast_to(rows[:, None, None], columns.shape).ravel())
            first += len(rows)
        if not self._knowledge.fixed:
            by_log_focal = np.concatenate([term.by_focal for term in terms]) * self.unpack(x)[1]
            entries.append(np.append(by_log_focal, 1 / self._knowledge.deviation))
            at_row.append(np.arange(count + 1))
            at_column.append(np.full(count + 1, size))
            count, size = count + 1, size + 1
        parts = (np.concatenate(entries), (np.concatenate(at_row), np.concatenate(at_column)))
        return csr_array(parts, shape=(count, size))

    def robust_count(self, x: Vector) -> int:
        """How many residuals, the first ones, are measurements that may be wild."""
        return self._terms(x)[1]

    def _terms(self, x: Vector) -> tuple[list[Term], int]:
        key = x.tobytes()
        if self._last is None or self._last[0] != key:
            normals, focal = self.unpack(x)
            measured, modelled = self._evaluate(strip_vectors(self._evidence, normals, focal))
            self._last = (key, measured + modelled, sum(len(term.residuals) for term in measured))
        return self._last[1], self._last[2]

    def _evaluate(self, vectors: StripVectors) -> tuple[list[Term], list[Term]]:
        e, d = self._evidence, self._deviations
        measured = [
            constraints.parallelism(vectors, e.major_weights, d.parallelism),
            constraints.orthogonality(vectors, e.minor_weights, d.orthogonality),
            constraints.vanishing(vectors, e, d.vanishing),
        ]
        modelled = [
            constraints.developability(vectors, d.developability),
            constraints.geodesic(vectors, self._both_sides, d.geodesic),
            constraints.smoothness(vectors, d.smoothness),
            constraints.unit_length(vectors, self._unit_length),
        ]
        return measured, modelled


def soft_l1_of_first(count: int, squares: Vector) -> Floats:
    """Loss of `least_squares` and its two derivatives (3, M): soft L1 for the first `count`, squares for the others."""
    loss = np.stack([squares, np.ones_like(squares), np.zeros_like(squares)])
    t = 1 + squares[:count]
    loss[:, :count] = [2 * (np.sqrt(t) - 1), t**-0.5, -0.5 * t**-1.5]
    return loss


def optimize_shape(
    evidence: StripEvidence,
    normals: Floats,
    focal: float,
    knowledge: FocalKnowledge,
) -> OptimizedShape:
    """The normals and focal length near `normals` (L, 3) and `focal` that satisfy all constraints best."""
    p = OptimizationParameters()
    objective = StripObjective(evidence, focal, knowledge, Deviations(), p.unit_length)
    x = objective.pack(normals, focal)
    measured = objective.robust_count(x)

    def loss(squares: NDArray[np.float64]) -> Floats:
        return soft_l1_of_first(measured, squares)

    found = least_squares(
        objective.residuals,
        x,
        jac=objective.jacobian,
        method="trf",
        tr_solver="lsmr",
        loss=loss,
        ftol=p.tolerance,
        xtol=p.tolerance,
        gtol=1e-10,
        max_nfev=p.evaluations,
    )
    best, focal = objective.unpack(found.x)
    return OptimizedShape(unit(best), focal, 2 * float(found.cost), int(found.nfev), bool(found.status > 0))

"""Shape estimation, step by step (3.3.5): initial normals and focal length, then all constraints together."""

import numpy as np

from benchmarks.dissertation_chain.strips.constraints import tangents
from benchmarks.dissertation_chain.strips.evidence import StripEvidence, distrust_outliers
from benchmarks.dissertation_chain.strips.initial import FocalKnowledge, estimate_initial_shape
from benchmarks.dissertation_chain.strips.optimization import optimize_shape
from benchmarks.dissertation_chain.strips.results import StripShape
from benchmarks.dissertation_chain.strips.view import chain_strips
from services.arrays import Floats


def estimate_strip_shape(evidence: StripEvidence, knowledge: FocalKnowledge) -> StripShape:
    """Normals of all strips and the focal length; what is `knowledge` of it stays evidence, or fixes it."""
    evidence = distrust_outliers(evidence)
    initial = estimate_initial_shape(evidence, knowledge)
    found = optimize_shape(evidence, initial.normals, initial.focal, knowledge)
    return StripShape(
        normals=found.normals,
        focal=found.focal,
        initial_normals=initial.normals,
        initial_focal=initial.focal,
        objective=found.objective,
        evaluations=found.evaluations,
        converged=found.converged,
        reference_points=evidence.reference_points,
        ruling_angles=evidence.ruling_angles,
        vanishing_points=ruling_vanishing_points(evidence, found.normals, found.focal),
        reference_points_3d=chain_strips(evidence, found.normals, found.focal).points,
    )


def ruling_vanishing_points(evidence: StripEvidence, normals: Floats, focal: float) -> Floats:
    """Homogeneous unit vanishing points (L + 1, 3) of the rulings R_i of Equation 3.8."""
    around = np.concatenate([normals[:1], normals[:-1] + normals[1:], normals[-1:]])
    R = tangents(evidence.rulings, evidence.reference_points, around, focal)
    v = R / [1.0, 1.0, focal]
    return np.asarray(v / np.linalg.norm(v, axis=1, keepdims=True))

"""Strips of simulated photos: flows and rulings measured, vanishing points from the truth with an error."""

import numpy as np
import pytest

from benchmarks.dissertation_chain.flow_regression import regress_flow
from benchmarks.dissertation_chain.rulings.projected import detect_projected_rulings
from benchmarks.dissertation_chain.rulings.results import RulingVanishingPoints
from benchmarks.dissertation_chain.strips.constraints import unit
from benchmarks.dissertation_chain.strips.evidence import StripEvidence, gather_evidence
from benchmarks.dissertation_chain.strips.initial import FocalKnowledge
from benchmarks.dissertation_chain.strips.shape import estimate_strip_shape
from benchmarks.dissertation_chain.strips.view import unroll_strips
from services.geometry.homographies import transform_points
from tests.benchmarks.dissertation_chain.strips.bent_page import angles_between_deg, similarity_residual
from tests.services.scenes import Album, Shot

TYPICAL = FocalKnowledge(float(np.log(1.29)), 0.25)


def measured(shot: Shot) -> tuple[StripEvidence, np.ndarray]:
    """Evidence, and the characters (N, 2)."""
    frame = shot.frame
    characters = transform_points(np.linalg.inv(frame.H_photo_centred), shot.analysis.characters)
    height = shot.analysis.text_height_px / frame.unit_px
    major, minor = regress_flow(shot.major, 4 * height), regress_flow(shot.minor, 6 * height)
    rulings = detect_projected_rulings(major.at, characters, minor.at, major.trust_at)
    seen = (
        np.linalg.inv(frame.H_photo_centred)
        @ shot.truth.ruling_vanishing_points(transform_points(frame.H_photo_centred, rulings.points)).T
    )
    vanishing = np.where(np.isfinite(seen.T), seen.T, [0.0, 1.0, 0.0])
    error = np.random.default_rng(3).normal(0, 0.03, vanishing.shape)
    points = RulingVanishingPoints(unit(unit(vanishing) + error), np.full(len(rulings), 0.03))
    return gather_evidence(rulings, points, major, minor, characters), characters


@pytest.mark.parametrize("name", ["book", "wave"])
def test_shape_and_view_of_a_simulated_photo_are_near_the_truth(album: Album, name: str) -> None:
    shot = album[name]
    evidence, characters = measured(shot)
    shape = estimate_strip_shape(evidence, TYPICAL)
    H = shot.frame.H_photo_centred

    focal = shot.truth.focal_length_px / shot.frame.unit_px
    view_error = np.degrees(abs(np.arctan(1 / shape.focal) - np.arctan(1 / focal)))
    assert view_error < 3.0

    truth = shot.truth.normals(transform_points(H, evidence.points.mean(axis=1)))
    told = (evidence.major_weights.sum(axis=1) > 4) & np.isfinite(truth).all(axis=1)
    errors = angles_between_deg(shape.normals[told], truth[told])
    assert told.sum() > 10
    assert errors.mean() < 3.0

    view = unroll_strips(evidence, shape.normals, shape.focal, characters)
    assert view is not None
    found = view.to_page(characters)
    page = shot.truth.photo_to_page(transform_points(H, characters))
    known = np.isfinite(found).all(axis=1) & np.isfinite(page).all(axis=1)
    assert known.mean() > 0.99
    residual = similarity_residual(found[known], page[known] / shot.truth.page.width)
    assert residual < 0.012

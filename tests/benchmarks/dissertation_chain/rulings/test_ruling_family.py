"""The family of rulings: what exact flows tell of rulings in space and of the focal length."""

import numpy as np
import pytest

from benchmarks.dissertation_chain.rulings.reference_points import choose_reference_points
from benchmarks.dissertation_chain.rulings.ruling_family import (
    FamilyEvidence,
    FamilyParameters,
    FlowWitness,
    fit_ruling_family,
)
from benchmarks.dissertation_chain.rulings.text_density import measure_text_density
from services.geometry.hulls import text_hull
from tests.benchmarks.dissertation_chain.rulings.worlds import World, noisy

PLACES = np.linspace(-1.1, 1.1, 41)


def evidence_of(world, major=None, minor=None):
    density = measure_text_density(world.text, 0.03)
    centre = world.text.mean(axis=0)
    first = float(np.median(world.rulings(world.text)))
    points = choose_reference_points(text_hull(world.text), centre, first, 24)
    return FamilyEvidence(
        points,
        first,
        PLACES,
        density.at,
        FlowWitness(major or world.major, np.radians(0.35)),
        FlowWitness(minor or world.minor, np.radians(1.2)),
    )


def space_errors_deg(family, world, points):
    expected = world.rulings_3d(points)
    seen = np.isfinite(expected[:, 0])
    return np.degrees(np.linalg.norm(np.cross(family.directions, expected), axis=1))[seen]


@pytest.mark.parametrize(("shape", "skew_deg"), [("book", 0.0), ("book", 15.0), ("wave", -15.0)])
def test_flows_of_a_cylinder_tell_its_rulings_in_space_and_the_focal_length(shape, skew_deg):
    world = World(shape, 0, skew_deg)
    evidence = evidence_of(world)
    family = fit_ruling_family(evidence)
    assert space_errors_deg(family, world, evidence.points).mean() < 0.5
    assert abs(family.focal / world.focal - 1) < 0.03
    assert abs(family.apex_share) < 0.05
    assert family.cost < 2.0


@pytest.mark.parametrize("shape", ["cone", "hollow cone"])
def test_flows_of_a_cone_tell_it_from_a_cylinder(shape):
    world = World(shape, 2, 0.0)
    evidence = evidence_of(world)
    family = fit_ruling_family(evidence)
    assert space_errors_deg(family, world, evidence.points).mean() < 2.0
    cylinder = fit_ruling_family(evidence, FamilyParameters(apex_deviation=1e-3))
    assert family.cost < 0.5 * cylinder.cost
    # The common point of the rulings is the image of the apex.
    apex = world.truth.sheet_to_photo(np.array([world.truth.shape.apex]))[0]  # type: ignore[attr-defined]
    towards = world.to_unit(apex) - evidence.points.mean(axis=0)
    found = family.common_point[:2] - family.common_point[2] * evidence.points.mean(axis=0)
    cosine = abs(found @ towards) / np.linalg.norm(found) / np.linalg.norm(towards)
    assert np.degrees(np.arccos(min(cosine, 1.0))) < 1.0


def test_a_known_focal_length_stays():
    world = World("book", 0, 0.0)
    family = fit_ruling_family(evidence_of(world), FamilyParameters(focal=1.0, focal_deviation=1e-4))
    assert abs(family.focal - 1.0) < 0.01


def test_noise_raises_the_cost_and_the_error():
    world = World("book", 0, 15.0)
    clean, dirty = (
        evidence_of(world),
        evidence_of(world, noisy(world.major, 0.5, 1), noisy(world.minor, 1.0, 2)),
    )
    a, b = fit_ruling_family(clean), fit_ruling_family(dirty)
    assert a.cost < 0.1 * b.cost
    errors = space_errors_deg(b, world, dirty.points).mean()
    assert errors < 8.0


@pytest.mark.parametrize("flow", [lambda p: np.zeros(len(p)), lambda p: np.full(len(p), np.nan)])
def test_flows_that_tell_nothing_give_a_finite_family(flow):
    world = World("book", 0, 0.0)
    family = fit_ruling_family(evidence_of(world, flow, flow))
    for values in (family.angles, family.directions, family.common_point, family.focal, family.cost):
        assert np.all(np.isfinite(values))

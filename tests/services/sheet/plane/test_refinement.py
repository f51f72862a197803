"""Refinement recovers a pose from flows and lines of known noise, and heeds what is known beforehand."""

from dataclasses import replace

import numpy as np
import pytest

from services.geometry.camera import PrincipalPointPrior
from services.geometry.focal_prior import FocalPrior
from services.geometry.planar import PagePlane, estimate_plane
from services.rectify.analysis.focal_length import focal_prior
from services.sheet.plane.flat_lines import (
    BASELINE_FLOOR_RAD,
    FlatObservations,
    RefinementParameters,
    for_text,
    observe_lines,
    rescale_deviations,
)
from services.sheet.plane.refinement import RefinedPlane, refine_plane
from services.sheet.tracing.baselines import Baselines
from services.texture_flow.vanishing_points import estimate_vanishing_points
from simulation.scenes import POSES, View
from tests.services.sheet.plane.observations import SLANT_RAD, PrintedPlane, photograph_plane

TURN_DEG = np.array([2.0, -3.0, 1.5])
FRONTAL = View("frontal", 2300.0, 0.0, 0.0, 0.0)


def refine(
    plane: PrintedPlane,
    prior: FocalPrior,
    seed: int,
    *,
    noise: float = 1.0,
    start: PagePlane | None = None,
    lean_rad: float = SLANT_RAD,
    observations: FlatObservations | None = None,
    parameters: RefinementParameters | None = None,
) -> RefinedPlane:
    """Refined from flows with 0.2 and 0.5 degrees and lines with 0.4 px of noise, from a start 4 degrees off."""
    rng = np.random.default_rng(seed)
    major = plane.flow(0.0, noise * np.radians(0.2), rng)
    minor = plane.flow(np.pi / 2 - lean_rad, noise * np.radians(0.5), rng)
    lines = plane.lines(0.4 * noise, rng) if observations is None else observations
    points = estimate_vanishing_points(major, minor)
    wrong = plane.wrong(TURN_DEG, 1.2)
    return refine_plane(start or wrong, prior, major, minor, points, lines, parameters)


@pytest.mark.parametrize("view", POSES, ids=lambda view: f"pose{view.name}")
@pytest.mark.parametrize("skew_deg", [0.0, 15.0])
def test_exact_observations_give_the_pose(view: View, skew_deg: float) -> None:
    plane = photograph_plane(view, float(np.radians(skew_deg)))
    found = refine(plane, focal_prior(plane.frame, None, None), 0, noise=0.0)
    # Not exactly: the priors of focal length and tilt pull a little.
    assert plane.error_deg(found.plane) < 0.05
    assert found.plane.focal == pytest.approx(plane.focal, rel=0.003)
    assert found.slant_rad == pytest.approx(SLANT_RAD, abs=np.radians(0.01))
    assert found.cost < 1.5
    assert found.lines == 36


@pytest.mark.parametrize("view", POSES, ids=lambda view: f"pose{view.name}")
@pytest.mark.parametrize("seed", [1, 2])
def test_noise_leaves_an_error_within_bounds(view: View, seed: int) -> None:
    plane = photograph_plane(view, float(np.radians(-15.0)) if view.name in "34" else 0.0)
    found = refine(plane, focal_prior(plane.frame, None, None), seed)
    assert plane.error_deg(found.plane) < 0.5
    off = abs(float(np.log(found.plane.focal / plane.focal)))
    assert off < 0.02
    # It knows how well it knows: not better than it does, and not ten times worse.
    assert off < 3 * found.log_focal_deviation
    assert found.log_focal_deviation < 0.03
    assert found.cost < 0.2 * found.cost_before
    # Some 500 residuals of unit size, most of them shared by their neighbours, cost some dozens.
    assert found.cost < 120


@pytest.mark.pipeline
def test_refinement_is_better_than_the_closed_form() -> None:
    closed, refined = [], []
    for seed in range(4):
        for view in POSES:
            plane = photograph_plane(view)
            prior = focal_prior(plane.frame, None, None)
            rng = np.random.default_rng(seed)
            major, minor = plane.flow(0.0, np.radians(0.2), rng), plane.flow(np.pi / 2, np.radians(0.5), rng)
            start = estimate_plane(estimate_vanishing_points(major, minor), prior)
            closed.append(plane.error_deg(start))
            refined.append(plane.error_deg(refine(plane, prior, seed, start=start).plane))
    assert np.mean(refined) < 0.35 * np.mean(closed)
    assert np.mean(refined) > 0.005


@pytest.mark.parametrize(
    "start_turn", [[0.0, 0.0, 0.0], [8.0, 0.0, 0.0], [0.0, -8.0, 3.0], [-5.0, 5.0, -3.0]]
)
def test_the_start_does_not_matter(start_turn: list[float]) -> None:
    plane = photograph_plane(POSES[2])
    prior = focal_prior(plane.frame, None, None)
    start = plane.wrong(np.array(start_turn), 1.3)
    found, reference = refine(plane, prior, 3, start=start), refine(plane, prior, 3)
    assert abs(plane.error_deg(found.plane) - plane.error_deg(reference.plane)) < 0.01
    assert found.plane.focal == pytest.approx(reference.plane.focal, rel=0.002)


@pytest.mark.parametrize("factor", [0.9, 1.0, 1.1])
def test_a_given_focal_length_is_kept(factor: float) -> None:
    plane = photograph_plane(POSES[0])
    given_px = factor * plane.truth.focal_length_px
    found = refine(plane, focal_prior(plane.frame, given_px, None), 1)
    # What the page shows is worth a hundredth; a client's figure is worth three thousandths.
    assert found.plane.focal * plane.frame.unit_px == pytest.approx(given_px, rel=0.02)


def test_exif_is_weighed_against_what_the_page_shows() -> None:
    plane = photograph_plane(POSES[0])
    exif_px = 1.06 * plane.truth.focal_length_px
    found = refine(plane, focal_prior(plane.frame, None, exif_px), 1)
    assert plane.truth.focal_length_px < found.plane.focal * plane.frame.unit_px < exif_px
    # Where the page shows nothing of it, EXIF's is taken.
    frontal = photograph_plane(FRONTAL)
    found = refine(frontal, focal_prior(frontal.frame, None, exif_px), 1)
    assert found.plane.focal * frontal.frame.unit_px == pytest.approx(exif_px, rel=0.005)


@pytest.mark.parametrize("seed", range(3))
def test_the_prior_decides_where_the_page_is_frontal(seed: int) -> None:
    plane = photograph_plane(FRONTAL)
    prior = focal_prior(plane.frame, None, None)
    found = refine(plane, prior, seed, start=PagePlane(plane.rotation, 1.5))
    assert np.log(found.plane.focal) == pytest.approx(prior.log_focal, abs=0.02)
    assert found.log_focal_deviation > 1.0
    assert found.log_aspect_deviation < 0.005  # no tilt, so nothing depends on it
    assert plane.error_deg(found.plane) < 0.4


def test_a_page_that_shows_no_focal_length_says_so_in_its_aspect() -> None:
    # Leaning at its foot, lines level in the photo: f cannot be seen, and with it not how much the page leans.
    foot = photograph_plane(View("foot", 2300.0, 35.0, 90.0, 0.0))
    clear = photograph_plane(POSES[2])
    nothing = FlatObservations(
        np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0), np.zeros(0), [], [], []
    )  # flows only: equal spacing would show it
    prior = focal_prior(foot.frame, None, None)
    unseen, seen = refine(foot, prior, 1, observations=nothing), refine(clear, prior, 1)
    assert unseen.log_focal_deviation > 0.25
    assert unseen.log_aspect_deviation > 0.03
    assert seen.log_focal_deviation < 0.05
    assert seen.log_aspect_deviation < 0.01
    assert unseen.lines == 0


def test_an_unbelievable_focal_length_is_held_back_unless_it_is_known() -> None:
    # A lens six times as long as a phone's; more often a page that is not quite flat looks like that.
    plane = photograph_plane(View("tele", 13000.0, 35.0, 140.0, 5.0))
    prior = focal_prior(plane.frame, None, None)
    held = refine(plane, prior, 1)
    free = refine(plane, prior, 1, parameters=RefinementParameters(believable_focal=np.inf))
    assert np.exp(prior.log_focal) < held.plane.focal < 0.95 * free.plane.focal
    assert plane.error_deg(held.plane) < 4.0
    known = refine(plane, focal_prior(plane.frame, plane.truth.focal_length_px, None), 1)
    assert plane.error_deg(known.plane) < 0.3


@pytest.mark.parametrize("lean_deg", [0.0, 0.4])
def test_the_lean_of_type_is_told_from_the_pose(lean_deg: float) -> None:
    plane = photograph_plane(POSES[1])
    found = refine(plane, focal_prior(plane.frame, None, None), 1, noise=0.3, lean_rad=np.radians(lean_deg))
    assert plane.error_deg(found.plane) < 0.4
    assert np.degrees(found.slant_rad) == pytest.approx(lean_deg, abs=0.1)


def test_a_few_wrong_lines_do_little_harm() -> None:
    plane = photograph_plane(POSES[3])
    rng = np.random.default_rng(4)
    lines = plane.lines(0.4, rng)
    ends = lines.ends.copy()
    ends[[3, 11, 30]] += np.array([[0.0, 0.02], [0.01, -0.03], [0.0, 0.02]])
    wrong = FlatObservations(
        lines.starts,
        ends,
        lines.slope_deviations,
        lines.relative_heights,
        lines.paragraphs,
        lines.margins,
        lines.alike,
    )
    found = refine(plane, focal_prior(plane.frame, None, None), 4, observations=wrong)
    assert plane.error_deg(found.plane) < 0.8
    assert found.plane.focal == pytest.approx(plane.focal, rel=0.04)


def test_small_type_may_lean_more() -> None:
    assert for_text(40.0) == RefinementParameters()
    assert for_text(9.0).slant_rad == pytest.approx(4 * RefinementParameters().slant_rad)


def test_deviations_are_widened_and_never_narrowed() -> None:
    p = RefinementParameters()
    assert rescale_deviations(p, (0.3, 0.9)) == p
    wide = rescale_deviations(p, (2.0, 3.0))
    assert wide.baseline_factor == pytest.approx(2 * p.baseline_factor)
    assert wide.spacing == pytest.approx(3 * p.spacing)


@pytest.mark.parametrize("factor", [1.0, 4.0])
def test_scales_tell_how_rough_the_lines_are(factor: float) -> None:
    # Lines set by hand: each turned and moved at random, so much as assumed or four times as much.
    plane, rng, p = photograph_plane(POSES[2]), np.random.default_rng(5), RefinementParameters()
    y = 100 + 29.0 * np.arange(36) + rng.normal(0, factor * p.spacing * 29, 36)
    rise = rng.normal(0, factor * BASELINE_FLOOR_RAD * 670, 36)
    starts, ends = (
        np.stack([np.full(36, 65.0), y - rise / 2], axis=1),
        np.stack([np.full(36, 735.0), y + rise / 2], 1),
    )
    lines = observe_lines(
        Baselines(starts, ends, np.full(36, 12.0), np.full(36, 0.01)), plane.H_centred_page, p
    )
    found = refine(plane, focal_prior(plane.frame, None, None), 5, noise=0.3, observations=lines)
    for scale in found.scales:
        assert 0.5 * factor < scale < 1.6 * factor
    assert plane.error_deg(found.plane) < 1.0


def test_lines_are_observed_in_the_photo() -> None:
    plane = photograph_plane(POSES[0])
    lines = plane.lines(0.0, np.random.default_rng(0))
    page = np.array([[65.0, 100.0], [735.0, 100.0]])
    seen = (plane.truth.page_to_photo(page) - plane.frame.centre) / plane.frame.unit_px
    assert np.allclose([lines.starts[0], lines.ends[0]], seen)
    assert [len(p.lines) for p in lines.paragraphs] == [20, 16]
    assert [group.tolist() for group in lines.alike] == [[0, 1]]
    assert [(len(members), side) for members, side in lines.margins] == [(36, "left"), (34, "right")]
    assert (lines.slope_deviations >= BASELINE_FLOOR_RAD).all()
    assert np.allclose(lines.relative_heights[0], 12 / 670)


def test_spacings_are_alike_within_the_tolerance() -> None:
    plane = photograph_plane(POSES[0])
    y = np.concatenate([100 + 29.0 * np.arange(15), 560 + 40.0 * np.arange(12)])
    starts, ends = (np.stack([np.full(27, x), y], axis=1) for x in (65.0, 735.0))
    lines = Baselines(starts, ends, np.full(27, 12.0), np.full(27, 0.1))
    found = observe_lines(lines, plane.H_centred_page, RefinementParameters())
    assert len(found.paragraphs) == 2
    assert found.alike == []


@pytest.mark.parametrize("view", POSES, ids=lambda view: f"pose{view.name}")
@pytest.mark.parametrize("axis", [0, 1])
def test_a_known_focal_length_shows_how_far_a_photo_was_cropped_along_an_axis(view: View, axis: int) -> None:
    plane, rng = photograph_plane(view, float(np.radians(15))), np.random.default_rng(3)
    offset = 0.15 * np.eye(2)[axis]
    major, minor = plane.flow(0.0, 0.0, rng), plane.flow(np.pi / 2 - SLANT_RAD, 0.0, rng)
    major, minor = replace(major, points=major.points + offset), replace(minor, points=minor.points + offset)
    lines = plane.lines(0.05, rng)
    lines = replace(lines, starts=lines.starts + offset, ends=lines.ends + offset)
    points = estimate_vanishing_points(major, minor)
    prior = focal_prior(plane.frame, plane.truth.focal_length_px, None)
    deviations = (0.5, 1e-4) if axis == 0 else (1e-4, 0.5)
    start = PrincipalPointPrior(deviations, (0.1 * offset[0], 0.1 * offset[1]))
    found = refine_plane(
        plane.wrong(0.5 * TURN_DEG, 1.0), prior, major, minor, points, lines, principal_point=start
    )
    assert np.abs(found.principal_point - offset).max() < 0.02
    assert plane.error_deg(found.plane) < 0.4

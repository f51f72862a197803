"""The fit finds a known sheet again, as exactly as it is seen, and ends with a finite sheet whatever is seen."""

from dataclasses import replace

import numpy as np
import pytest

from services.arrays import Points, Vector
from services.geometry.camera import PrincipalPointPrior
from services.sheet.developable.fitting import (
    LEAST_SHOWN,
    FittedSurface,
    fit_surface,
    free_gain,
    rescale_deviations,
    shown_deviations,
)
from services.sheet.developable.observations import NO_LINES, LineObservations, PageObservations
from services.sheet.developable.print_residuals import FittingParameters, PrintResiduals
from services.sheet.developable.residuals import BENDS, PageResiduals, surface_of
from services.sheet.developable.surface import DevelopableSurface
from services.texture_flow.field import FlowSamples
from tests.services.sheet.developable.sheets import BASIS, FLAT, PAGE, SLANT_RAD, Bent, observe, page_error

CYLINDER = Bent(slopes=(0.0, 0.0), skew=0.0, bends=(-0.2, 0.1, 0.6, 1.0, 1.0, 0.6, 0.1, -0.2))
CONE = Bent(
    turn=(-0.3, 0.2, 0.1),
    slopes=(0.3, 0.0),
    skew=0.05,
    bends=(-0.5, -0.7, -0.9, -1.0, -1.0, -0.9, -0.7, -0.5),
)
ROLLED = Bent(skew=1.5, slopes=(0.0, 0.0), bends=(0.5, 0.5, 0.7, 0.9, 0.9, 0.7, 0.5, 0.5))
SHEETS = {"cylinder": CYLINDER, "cone": CONE, "bent along its lines": ROLLED, "flat": FLAT}
AWAY = np.array([0.05, -0.04, 0.03, 0.1, 0.08, 0.05, 0.02, 0.002, *[0.3, -0.3] * 4])
"""How far a start is from the truth."""


def normals_error_deg(found: FittedSurface, bent: Bent) -> float:
    """Mean angle of the normals over the page."""
    true = bent.surface()
    seen = true.to_photo(PAGE)
    cosine = np.einsum("ij,ij->i", found.surface.normals(seen), true.normals(seen))
    return float(np.degrees(np.arccos(np.clip(cosine, -1, 1))).mean())


def cost_at(bent: Bent, change: Vector, observed: PageObservations) -> float:
    """Half the sum under the losses at a fit's start."""
    start = bent.start(change)
    x = np.concatenate([np.zeros(3), start.parameters])
    residuals = PageResiduals(start.rotation, start.anchor, BASIS, observed, x, FittingParameters())
    return float(0.5 * (residuals.evaluate(x)[0] ** 2).sum())


@pytest.mark.parametrize("name", SHEETS)
def test_exact_observations_give_the_sheet_but_for_the_priors_pull(name: str) -> None:
    bent = SHEETS[name]
    observed = observe(bent.surface())
    fitted = fit_surface(bent.start(AWAY), observed)
    assert page_error(fitted.surface, bent.surface()) < 2e-4
    assert normals_error_deg(fitted, bent) < 0.1
    assert fitted.surface.focal == pytest.approx(bent.focal, rel=5e-3)
    assert fitted.slant_rad == pytest.approx(SLANT_RAD, abs=5e-4)
    assert fitted.cost < cost_at(bent, np.zeros(16), observed) + 1e-6
    assert fitted.line_scale < 0.05


@pytest.mark.parametrize("name", SHEETS)
def test_noise_leaves_errors_of_its_own_size(name: str) -> None:
    bent = SHEETS[name]
    observed = observe(bent.surface(), flow_noise_rad=np.radians(0.5), line_noise=6e-4, seed=5)
    fitted = fit_surface(bent.start(AWAY), observed)
    # 6e-4 is half a pixel of a photo of 1.4 megapixels; the page is 0.9 wide.
    assert page_error(fitted.surface, bent.surface()) < 1.5e-3
    assert page_error(fitted.surface, bent.surface()) > 1e-7  # noise went in: it has not seen the truth
    assert normals_error_deg(fitted, bent) < 0.8
    assert 5e-3 < fitted.log_focal_deviation < 0.05
    assert abs(np.log(fitted.surface.focal / bent.focal)) < 3 * fitted.log_focal_deviation
    assert 0.5 < fitted.line_scale < 1.5


def test_flows_alone_show_the_shape_a_little_less_well() -> None:
    seen = observe(CYLINDER.surface(), flow_noise_rad=np.radians(0.3), line_noise=3e-4, seed=6)
    with_lines = fit_surface(CYLINDER.start(AWAY), seen)
    without = fit_surface(CYLINDER.start(AWAY), replace(seen, lines=NO_LINES))
    assert (
        page_error(with_lines.surface, CYLINDER.surface())
        < page_error(without.surface, CYLINDER.surface())
        < 0.02
    )
    assert without.line_scale == 0.0


@pytest.mark.parametrize("seed", range(4))
def test_never_worse_than_the_start(seed: int) -> None:
    rng = np.random.default_rng(seed)
    bent = list(SHEETS.values())[seed]
    observed = observe(bent.surface(), flow_noise_rad=0.02, line_noise=2e-3, seed=seed)
    change = AWAY * rng.normal(0, 2, 16)
    few = FittingParameters(max_evaluations=1 + seed)
    fitted = fit_surface(bent.start(change), observed, few)
    assert fitted.cost <= cost_at(bent, change, observed) * (1 + 1e-9)


def test_a_known_focal_length_is_kept() -> None:
    for factor in (0.8, 1.25):
        observed = observe(CYLINDER.surface(), focal=factor * CYLINDER.focal, focal_deviation=0.003)
        change = AWAY.copy()
        change[3] = np.log(factor)
        fitted = fit_surface(CYLINDER.start(change), observed)
        assert fitted.surface.focal == pytest.approx(factor * CYLINDER.focal, rel=0.012)
        # What is left of the page is about right all the same.
        assert page_error(fitted.surface, CYLINDER.surface()) < 0.03


def test_the_observations_say_how_well_they_show_the_focal_length() -> None:
    tilted = replace(FLAT, turn=(0.5, -0.4, 0.1))
    frontal = replace(FLAT, turn=(0.0, 0.0, 0.0))
    deviations = []
    for bent in (tilted, frontal):
        observed = observe(bent.surface(), flow_noise_rad=0.003, line_noise=3e-4)
        loose, tight = (
            fit_surface(bent.start(), replace(observed, focal_deviation=d)).log_focal_deviation
            for d in (0.25, 0.01)
        )
        deviations.append(loose)
        # The prior's knowledge is not the observations'.
        assert tight == pytest.approx(loose, rel=0.25)
    assert 1e-3 < deviations[0] < 0.1
    assert deviations[1] > 5 * deviations[0]


def test_the_same_again() -> None:
    observed = observe(CONE.surface(), flow_noise_rad=0.005, line_noise=5e-4, seed=7)
    first, second = (fit_surface(CONE.start(AWAY), observed) for _ in range(2))
    assert first.cost == second.cost
    assert np.array_equal(first.surface.bends, second.surface.bends)
    assert np.array_equal(first.surface.rotation, second.surface.rotation)


def test_a_fit_goes_on_where_it_ended() -> None:
    observed = observe(CYLINDER.surface(), flow_noise_rad=0.005, line_noise=5e-4, seed=8)
    fitted = fit_surface(CYLINDER.start(AWAY), observed)
    start = fitted.start
    x = np.concatenate([np.zeros(3), start.parameters])
    again = surface_of(x, start.rotation, start.anchor, start.basis)
    assert np.allclose(again.to_photo(PAGE), fitted.surface.to_photo(PAGE), atol=1e-9)
    assert start.parameters[BENDS - 4] == fitted.slant_rad
    # And finds nothing better there; the unit of the lines is a little another.

    assert fit_surface(start, observed).cost == pytest.approx(fitted.cost, rel=0.02)


def test_outliers_do_not_draw_the_sheet() -> None:
    observed = observe(CYLINDER.surface(), flow_noise_rad=0.003, line_noise=3e-4, seed=9)
    angles = observed.major.angles.copy()
    angles[::12] += 0.5
    points = observed.lines.points.copy()
    points[::15, 1] += 0.02
    spoiled = replace(
        observed,
        major=replace(observed.major, angles=angles),
        lines=replace(observed.lines, points=points),
    )
    clean, dirty = (fit_surface(CYLINDER.start(AWAY), o) for o in (observed, spoiled))
    true = CYLINDER.surface()
    assert page_error(dirty.surface, true) < page_error(clean.surface, true) + 3e-3


def few(flow: FlowSamples, count: int) -> FlowSamples:
    """The first samples alone."""
    return flow.select(np.arange(len(flow)) < count)


def one_line(lines: LineObservations) -> LineObservations:
    """The first line alone."""
    chosen = lines.index == 0
    return LineObservations(
        lines.points[chosen], lines.index[chosen], lines.deviations[chosen], [], [], [], lines.text_height
    )


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    "case", ["few samples", "one sample", "no lines", "one line", "all alike", "crossed", "no weight"]
)
def test_whatever_is_seen_ends_finite(case: str) -> None:
    observed = observe(CYLINDER.surface(), flow_noise_rad=0.01, line_noise=1e-3, seed=10)
    major, minor, lines = observed.major, observed.minor, observed.lines
    ones = np.ones(len(major))
    seen = {
        "few samples": (few(major, 3), few(minor, 3), NO_LINES),
        "one sample": (few(major, 1), few(minor, 1), NO_LINES),
        "no lines": (major, minor, NO_LINES),
        "one line": (major, minor, one_line(lines)),
        "all alike": (replace(major, angles=0.3 * ones), replace(minor, angles=0.3 * ones), lines),
        "crossed": (replace(major, angles=minor.angles), replace(minor, angles=major.angles), lines),
        "no weight": (replace(major, weights=0 * ones), replace(minor, weights=0 * ones), lines),
    }[case]
    fitted = fit_surface(CYLINDER.start(AWAY), replace(observed, major=seen[0], minor=seen[1], lines=seen[2]))
    assert np.isfinite(fitted.cost)
    assert np.isfinite(fitted.start.parameters).all()
    assert np.isfinite(fitted.surface.P).all()
    assert np.allclose(fitted.surface.rotation.T @ fitted.surface.rotation, np.eye(3))
    assert fitted.log_focal_deviation > 0
    assert 0.3 < fitted.surface.focal < 13


def test_deviations_are_widened_never_narrowed() -> None:
    observed = observe(CYLINDER.surface(), line_noise=3e-4, seed=11)
    fitted = fit_surface(CYLINDER.start(), observed)
    p = FittingParameters(line_factor=1.5)
    assert rescale_deviations(p, replace(fitted, line_scale=0.4, spacing_scale=0.3)) == p
    wide = rescale_deviations(p, replace(fitted, line_scale=2.0, spacing_scale=4.0))
    assert wide.line_factor == pytest.approx(3.0)
    assert wide.spacing == pytest.approx(4 * p.spacing)
    only = rescale_deviations(p, replace(fitted, line_scale=2.0, spacing_scale=0.5))
    assert only == replace(p, line_factor=3.0)


def test_directions_and_spacings_are_trusted_as_far_as_a_fit_has_shown() -> None:
    fitted = fit_surface(CYLINDER.start(), observe(CYLINDER.surface()))
    p = FittingParameters(major_factor=2.0, line_factor=1.5)
    sharp = shown_deviations(p, replace(fitted, major_scale=0.5, spacing_scale=0.4, line_scale=0.2))
    assert sharp.major_factor == pytest.approx(1.0)
    assert sharp.spacing == pytest.approx(0.4 * p.spacing)
    assert sharp.line_factor == p.line_factor
    exact = shown_deviations(p, replace(fitted, major_scale=0.0, spacing_scale=0.0))
    assert exact.major_factor == pytest.approx(2.0 * LEAST_SHOWN)
    assert shown_deviations(p, replace(fitted, major_scale=3.0, spacing_scale=3.0)) == p


def test_directions_count_by_their_factor() -> None:
    observed = observe(CYLINDER.surface(), seed=3)
    start = CYLINDER.surface()
    plain, narrow = (PrintResiduals(observed, start, FittingParameters(major_factor=f)) for f in (1.0, 0.5))
    np.testing.assert_allclose(narrow.major_deviation, 0.5 * plain.major_deviation)
    np.testing.assert_allclose(narrow.minor_deviation, plain.minor_deviation)


@pytest.mark.parametrize("name", ["cylinder", "cone", "bent along its lines"])
@pytest.mark.parametrize("axis", [0, 1])
def test_a_bent_sheet_shows_the_principal_point_along_one_axis(name: str, axis: int) -> None:
    bent, offset = SHEETS[name], np.eye(2)[axis] * 0.15
    true = bent.surface()
    moved = shifted(observe(true, focal_deviation=0.02), offset)
    start = replace(bent.start(AWAY), anchor=(bent.anchor[0] + offset[0], bent.anchor[1] + offset[1]))
    deviations = (0.2, 1e-4) if axis == 0 else (1e-4, 0.2)
    free = fit_surface(start, replace(moved, principal_point=PrincipalPointPrior(deviations)))
    held = fit_surface(start, moved)
    assert np.abs(free.principal_point - offset).max() < 0.01
    assert page_error(free.surface, true) < 1e-3 < page_error_at(held, true, offset)
    gain = free_gain(
        held.start, replace(moved, principal_point=PrincipalPointPrior((0.2, 0.2))), FittingParameters()
    )
    assert gain[axis] > 2.5


@pytest.mark.parametrize("name", SHEETS)
def test_where_the_principal_point_is_the_origin_a_free_one_promises_nothing(name: str) -> None:
    observed = observe(SHEETS[name].surface(), line_noise=5e-4, flow_noise_rad=3e-3, focal_deviation=0.02)
    held = fit_surface(SHEETS[name].start(AWAY), observed)
    free = replace(observed, principal_point=PrincipalPointPrior((0.2, 0.2)))
    assert max(free_gain(held.start, free, FittingParameters())) < 2.5


def shifted(observed: PageObservations, offset: Points) -> PageObservations:
    """The same page in a photo whose middle lies at minus `offset` (2,) from the principal point."""
    lines = observed.lines
    return replace(
        observed,
        major=replace(observed.major, points=observed.major.points + offset),
        minor=replace(observed.minor, points=observed.minor.points + offset),
        lines=replace(lines, points=lines.points + offset, margins=[m + offset for m in lines.margins]),
        hull=observed.hull + offset,
    )


def page_error_at(found: FittedSurface, true: DevelopableSurface, offset: Points) -> float:
    """As `page_error`, for a surface in the coordinates of such a photo."""
    z, w = found.surface.to_page(true.to_photo(PAGE) + offset) @ [1, 1j], PAGE @ [1, 1j]
    z, w = z - z.mean(), w - w.mean()
    return float(np.sqrt(np.mean(np.abs(w - np.vdot(z, w) / np.vdot(z, z) * z) ** 2)))

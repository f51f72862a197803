"""The residuals vanish at the truth, say how far off everything else is, and their derivatives are exact."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import BSpline

from services.arrays import Floats, Points, Vector
from services.geometry.camera import PrincipalPointPrior, rotation_from_vector
from services.robust import cauchy, soft_l1
from services.sheet.developable.observations import (
    MARGIN_DEVIATION,
    NO_LINES,
    SLANT_MEAN_RAD,
    TILT_RAD,
    LineObservations,
    PageObservations,
    Run,
)
from services.sheet.developable.print_residuals import (
    MAJOR_RAD,
    MINOR_RAD,
    FittingParameters,
    Residual,
    under,
)
from services.sheet.developable.residuals import (
    BEND,
    BEND_CHANGE,
    BEND_DIFFERENCE,
    BENDS,
    GROWTH,
    GROWTH_DEVIATION,
    RIM_DIFFERENCE,
    SLANT,
    SLOPE,
    USUAL_SKEW_RAD,
    PageResiduals,
    bend_priors,
    surface_of,
)
from services.sheet.developable.surface import bend_basis
from services.texture_flow.field import FlowSamples
from tests.services.sheet.developable.sheets import (
    BASIS,
    FLAT,
    PAGE,
    SLANT_RAD,
    Bent,
    differences,
    observe,
    seen_edges,
)

pytestmark = pytest.mark.pipeline

P = FittingParameters()
SHEETS = {
    "sheet": Bent(),
    "sheet bent along its lines": Bent(skew=1.5, slopes=(-0.2, 0.1)),
    "flat": FLAT,
    "strong": Bent(turn=(-0.3, 0.2, -0.2), focal=2.0, bends=(2.0, 1.5, 1.0, 0.5, -0.5, -1.0, -1.5, -2.0)),
}
FRONTAL = replace(FLAT, turn=(0.0, 0.0, 0.0), anchor=(0.0, 0.0), skew=0.0)
"""The page is the photo."""


def residuals_of(bent: Bent, observed: PageObservations, p: FittingParameters = P) -> PageResiduals:
    """Residuals about a sheet."""
    start = bent.start()
    return PageResiduals(start.rotation, start.anchor, BASIS, observed, at(bent), p)


def at(bent: Bent) -> Vector:
    """The sheet's parameters, with no turn left."""
    return np.concatenate([np.zeros(3), bent.parameters[3:]])


def seen(points: Points = PAGE[:4], angle: float = 0.0, weight: float = 1.0) -> FlowSamples:
    """Flow samples of one direction."""
    return FlowSamples(points, np.full(len(points), angle), np.full(len(points), weight))


def frontal(lines: LineObservations = NO_LINES, major: float = 0.0, weight: float = 1.0) -> PageObservations:
    """What is seen of the frontal sheet: flows that lean by `major`, and lines."""
    upright = seen(angle=np.pi / 2 - SLANT_RAD, weight=weight)
    return PageObservations(seen(angle=major, weight=weight), upright, lines, PAGE, np.log(1.3), 0.25)


def printed(
    v: Vector, deviation: float = 0.001, ends: float = 0.4, runs: list[Run] | None = None
) -> LineObservations:
    """Level lines at heights `v` of three points each, and their flush ends."""
    u = np.array([-0.3, 0.0, 0.3])
    points = np.stack([np.tile(u, len(v)), np.repeat(v, 3)], axis=1)
    margin = np.stack([np.full(len(v), ends), v], axis=1)
    runs = runs or [Run(np.arange(len(v)), np.arange(float(len(v))))]
    index = np.repeat(np.arange(len(v)), 3)
    return LineObservations(points, index, np.full(len(index), deviation), runs, [], [margin], 0.02)


@pytest.mark.parametrize("name", SHEETS)
def test_all_residuals_vanish_at_the_truth(name: str) -> None:
    bent = SHEETS[name]
    observed = observe(bent.surface(), edges=True)
    parts = residuals_of(bent, observed).parts(at(bent))
    assert list(parts) == ["major", "minor", "straight", "spacing", "margins", "sides", "crossing"]
    sizes = {key: len(part.value) for key, part in parts.items()}
    assert sizes == {
        "major": len(PAGE),
        "minor": len(PAGE),
        "straight": 120,
        "spacing": 12 + 2,
        "margins": 24,
        "crossing": 4,
        "sides": 48,
    }
    for key, part in parts.items():
        assert np.abs(part.value).max() < 1e-3, key


@pytest.mark.parametrize("name", SHEETS)
def test_derivatives_are_those_of_the_values(name: str) -> None:
    bent = SHEETS[name]
    observed = observe(bent.surface(), flow_noise_rad=0.005, line_noise=5e-4, seed=1, edges=True)
    residuals = residuals_of(bent, observed)
    # Somewhere beside the truth, with a turn, so that nothing is zero by luck.
    x = at(bent) + np.random.default_rng(2).normal(0, 0.02, len(at(bent)))
    for key in residuals.parts(x):
        exact, value = residuals.parts(x)[key].slope, lambda y, key=key: residuals.parts(y)[key].value
        slow = differences(value, x, 1e-6)
        column, error = np.linalg.norm(slow, axis=0), np.linalg.norm(exact - slow, axis=0)
        # Both are tabulated; a bend at the text's rim, which moves hardly anything, is compared with the others.
        bends = np.arange(len(x)) >= BENDS
        least = np.where(bends, 0.1 * column[BENDS:].max(), 0.0)
        assert (error <= 0.015 * np.maximum(column, least) + 1e-5).all(), key


@pytest.mark.parametrize("name", SHEETS)
def test_derivatives_of_the_whole_under_its_losses(name: str) -> None:
    bent = SHEETS[name]
    observed = observe(bent.surface(), flow_noise_rad=0.01, line_noise=1e-3, seed=3, focal=1.5)
    residuals = residuals_of(bent, observed)
    x = at(bent) + np.random.default_rng(4).normal(0, 0.02, len(at(bent)))
    value, exact = residuals.evaluate(x)
    slow = differences(lambda y: residuals.evaluate(y)[0], x, 1e-6)
    assert exact.shape == slow.shape == (len(value), len(x))
    error, column = np.linalg.norm(exact - slow, axis=0), np.linalg.norm(slow, axis=0)
    assert (error < 0.01 * column).all()
    again = residuals.evaluate(x)
    assert np.array_equal(value, again[0])
    assert not np.array_equal(value, residuals.evaluate(x + 1e-3)[0])


def test_the_type_of_a_frontal_page_leans_as_it_is_seen() -> None:
    lean = 0.01
    parts = residuals_of(FRONTAL, frontal(major=lean, weight=0.5)).parts(at(FRONTAL))
    # Twelve windows share their ink; half the weight doubles the variance.
    assert np.allclose(parts["major"].value, lean / (MAJOR_RAD * np.sqrt(12 / 0.5)), rtol=1e-4)
    assert np.allclose(parts["minor"].value, 0, atol=1e-6)
    upright = replace(frontal(), minor=seen(angle=np.pi / 2 - lean))
    parts = residuals_of(FRONTAL, upright).parts(at(FRONTAL))
    assert np.allclose(parts["minor"].value, (lean - SLANT_RAD) / (MINOR_RAD * np.sqrt(4)), rtol=1e-4)
    # Directions have no sense: those that point back are the same.
    back = replace(frontal(), major=seen(angle=lean - np.pi), minor=seen(angle=-np.pi / 2 - SLANT_RAD))
    parts = residuals_of(FRONTAL, back).parts(at(FRONTAL))
    assert np.allclose(parts["major"].value, lean / (MAJOR_RAD * np.sqrt(12)), rtol=1e-4)
    assert np.allclose(parts["minor"].value, 0, atol=1e-6)


def test_samples_of_little_weight_are_not_thrown_away() -> None:
    parts = residuals_of(FRONTAL, frontal(major=0.01, weight=0.0)).parts(at(FRONTAL))
    assert np.allclose(parts["major"].value, 0.01 / (MAJOR_RAD * np.sqrt(12 / 0.05)), rtol=1e-4)


def test_lines_are_as_crooked_as_they_are_seen() -> None:
    lines = printed(np.array([-0.2, 0.0, 0.2]))
    points, deviations = lines.points.copy(), lines.deviations.copy()
    points[4, 1] += 0.006
    deviations[4] = 0.002
    lines = replace(lines, points=points, deviations=deviations)
    parts = residuals_of(FRONTAL, frontal(lines), replace(P, line_factor=2.0)).parts(at(FRONTAL))
    # The middle point counts a quarter of the others: it moves the line's level by a ninth of its error.
    expected = np.zeros(9)
    expected[[3, 5]] = -0.006 / 9 / 0.002
    expected[4] = 0.006 * 8 / 9 / 0.004
    assert np.allclose(parts["straight"].value, expected, atol=1e-6)


def test_a_line_out_of_step_is_told_in_shares_of_the_step() -> None:
    v = np.array([-0.3, -0.2, -0.1, 0.0, 0.1])
    v[1] += 0.01
    step, level = np.polyfit(np.arange(5), v, 1)
    expected = (v - level - step * np.arange(5)) / (step * P.spacing)
    found = residuals_of(FRONTAL, frontal(printed(v))).parts(at(FRONTAL))["spacing"].value
    assert np.allclose(found, expected, atol=1e-6)
    # A line that is missing leaves a gap in the order, and no residual.
    missing = printed(np.array([-0.3, -0.2, 0.0, 0.1]), runs=[Run(np.arange(4), np.array([0.0, 1, 3, 4]))])
    found = residuals_of(FRONTAL, frontal(missing)).parts(at(FRONTAL))["spacing"].value
    assert np.allclose(found, 0, atol=1e-9)


def test_paragraphs_that_are_alike_have_one_spacing() -> None:
    v = np.concatenate([-0.5 + 0.1 * np.arange(3), 0.05 + 0.11 * np.arange(5)])
    runs = [Run(np.arange(3), np.arange(3.0)), Run(np.arange(3, 8), np.arange(5.0))]
    lines = replace(printed(v, runs=runs), alike=[np.array([0, 1])])
    found = residuals_of(FRONTAL, frontal(lines)).parts(at(FRONTAL))["spacing"].value
    assert np.allclose(found[:8], 0, atol=1e-9)
    logs = np.log([0.1, 0.11])
    mean = (3 * logs[0] + 5 * logs[1]) / 8
    deviation = np.hypot(P.spacing, P.spacing * np.sqrt(12) / np.array([3, 5]) ** 1.5)
    assert np.allclose(found[8:], (logs - mean) / deviation, atol=1e-6)


def test_margins_are_flush_with_their_median_end() -> None:
    lines = printed(np.array([-0.2, -0.1, 0.0, 0.1, 0.2]))
    margin = lines.margins[0].copy()
    margin[:, 0] += [0.0, 0.01, -0.003, 0.004, 0.02]
    lines = replace(lines, margins=[margin, lines.margins[0]])
    found = residuals_of(FRONTAL, frontal(lines)).parts(at(FRONTAL))["margins"].value
    expected = np.array([-0.004, 0.006, -0.007, 0.0, 0.016]) / (MARGIN_DEVIATION * 0.02)
    assert np.allclose(found[:5], expected, atol=1e-6)
    assert np.allclose(found[5:], 0, atol=1e-9)


def test_rulings_keep_apart_within_the_hull() -> None:
    bent = replace(FRONTAL, slopes=(1.0, 0.1))
    hull = np.array([[0.0, -0.4], [0.0, -0.8], [0.05, -0.8]])
    observed = replace(frontal(), hull=hull)
    residuals = residuals_of(bent, observed)
    s, t = bent.surface().to_sheet(hull).T
    growth = 1 + t * (1.0 + 0.2 * s)
    expected = np.maximum(GROWTH - growth, 0) / GROWTH_DEVIATION
    assert expected[0] == 0 < expected[1]
    found = residuals.parts(at(bent))["crossing"]
    assert np.allclose(found.value, expected, atol=1e-6)
    # By the slopes at fixed places of the sheet.
    assert s[2] > 0.1
    assert np.allclose(found.slope[2, 5:7], -t[2] * np.array([1, 2 * s[2]]) / GROWTH_DEVIATION)
    assert not found.slope[0].any()


def test_a_bent_side_is_off_in_its_deviations_and_print_may_be_askew_on_its_sheet() -> None:
    straight = seen_edges(FRONTAL.surface(BASIS), 0.0, np.random.default_rng(0))
    points = straight.points.copy()
    points[5, 1] += 0.004
    for edges, worst in ((straight, 0.0), (replace(straight, points=points), 0.004 * 11 / 12 / 1e-3)):
        observed = replace(frontal(), edges=edges)
        off = residuals_of(FRONTAL, observed).parts(at(FRONTAL))["sides"].value
        assert np.abs(off).max() == pytest.approx(worst, rel=0.05, abs=0.02)
        assert int(np.argmax(np.abs(off))) == 5 or not worst


def test_priors_pull_to_what_is_usual() -> None:
    residuals = residuals_of(FRONTAL, replace(frontal(), log_focal=np.log(1.2), focal_deviation=0.1))
    x = at(FRONTAL)
    priors = -len(BASIS.values.T) * 3 + 3
    flat = residuals.evaluate(x)[0]
    k = np.array([1.0, 2.0, 0.0, 0.0, 3.0, 0.0, 0.0, -1.0])
    x = x.copy()
    x[[0, 3, 4, 5, 6, SLANT]] = [0.2, np.log(1.5), 0.3, 0.06, -0.03, 0.01]
    x[BENDS:] = k
    bent = residuals.evaluate(x)[0]
    # 21 of the bends, and log f, skew, two slopes, slant, and the two parts of the tilt before them.
    rim = RIM_DIFFERENCE
    differences = np.array([rim, rim, *[BEND_DIFFERENCE] * 3, rim, rim])
    assert np.allclose(bent[priors:-14], np.diff(k) / differences)
    assert np.allclose(bent[-14:-8], np.diff(k, 2) / BEND_CHANGE)
    assert np.allclose(bent[-8:], k / BEND)
    assert np.allclose(flat[priors:], 0)
    assert np.allclose(
        bent[priors - 7 : priors],
        [
            np.log(1.5 / 1.2) / 0.1,
            0.5 * np.sin(0.6) / USUAL_SKEW_RAD,
            0.06 / SLOPE,
            -0.03 / SLOPE,
            (0.01 - SLANT_MEAN_RAD) / P.slant_rad,
            0.0,
            -0.2 / TILT_RAD,
        ],
        atol=1e-9,
    )


def test_splines_twice_as_fine_have_the_same_priors() -> None:
    """Of a bend that ends within the sheet: at the ends the knots are closer."""

    def costs(count: int) -> list[float]:
        basis = bend_basis(-1.0, 1.0, count, 0.0, (23 - 3) / (count - 3))
        at = BSpline.construct_fast(_knots(count), np.eye(count), 3)
        means = np.array([_knots(count)[k + 1 : k + 4].mean() for k in range(count)])
        k = np.linalg.solve(at(means), 0.5 * np.sin(2 * means) * (1 - means**2) ** 2)
        priors = bend_priors(k, np.eye(count), basis.spacing, sides_seen=True).value
        groups = np.split(priors, np.cumsum([count - 1, count - 2]))
        return [float(group @ group) for group in groups]

    for one, other in zip(costs(23), costs(43), strict=True):
        assert 0 < one == pytest.approx(other, rel=0.12)


def _knots(count: int) -> Vector:
    return np.concatenate([np.full(3, -1.0), np.linspace(-1.0, 1.0, count - 2), np.full(3, 1.0)])


def test_a_crease_costs_little_more_than_a_smaller_one() -> None:
    def cost(k: float) -> float:
        bends = np.zeros(24)
        bends[12] = k
        changes = bend_priors(bends, np.eye(24), 9 / 21, sides_seen=True).value[23:45]
        return float(changes @ changes)

    # Three changes of the bend, each with the logarithm of its square: 4 times the crease adds 3 log 16 at most.
    assert cost(0.02) == pytest.approx(16 * cost(0.005), rel=0.02)
    for k in (2.0, 8.0):
        assert 0.8 * 3 * np.log(16) < cost(4 * k) - cost(k) < 3 * np.log(16)


def test_a_loss_is_applied_with_its_derivative() -> None:
    one = Residual(np.array([3.0, -0.2]), np.array([[2.0, 0.0], [0.0, -1.0]]))
    found = under(cauchy, one)
    value, slope = cauchy(one.value)
    assert np.array_equal(found.value, value)
    assert np.array_equal(found.slope, [[2.0 * slope[0], 0.0], [0.0, -slope[1]]])


def test_only_observations_are_under_a_loss() -> None:
    lines = printed(np.array([-0.2, 0.0, 0.2, 0.35, 0.45]))
    points = lines.points.copy()
    points[4, 1] += 0.05
    observed = frontal(replace(lines, points=points), major=0.3)
    residuals = residuals_of(FRONTAL, observed)
    x = at(FRONTAL)
    x[BENDS] = 200.0
    value, _ = residuals.evaluate(x)
    assert value[-8] == pytest.approx(200 / BEND)
    part = residuals.parts(x)
    n = len(part["major"].value)
    assert np.allclose(value[:n], soft_l1(part["major"].value)[0])
    count = [len(p.value) for p in part.values()]
    # Groups that may be wholly wrong are under Cauchy's.
    for name, number in (("spacing", 3), ("margins", 4)):
        group = slice(sum(count[:number]), sum(count[: number + 1]))
        assert np.allclose(value[group], cauchy(part[name].value)[0])
    crossing = slice(sum(count[:6]), sum(count[:7]))
    assert np.array_equal(value[crossing], part["crossing"].value)


@given(st.tuples(*[st.floats(-0.8, 0.8)] * 3), st.floats(-1.5, 1.5))
def test_the_texts_axes_do_not_depend_on_the_skew(turn: tuple[float, float, float], skew: float) -> None:
    start = rotation_from_vector(np.array([0.1, -0.2, 0.3]))
    x = np.concatenate([turn, [0.2, skew, 0.1, 0.0, SLANT_RAD], np.zeros(8)])
    surface = surface_of(x, start, (0.0, 0.0), BASIS)
    text: Floats = start @ rotation_from_vector(np.array(turn))
    c, d = np.cos(skew), np.sin(skew)
    A, B, N = surface.rotation.T
    # u goes `skew` from A towards B.
    assert np.allclose(c * A + d * B, text[:, 0])
    assert np.allclose(c * B - d * A, text[:, 1])
    assert np.allclose(N, text[:, 2])
    assert surface.focal == pytest.approx(np.exp(0.2))


@pytest.mark.parametrize("log_focal", [-5.0, 9.0])
def test_focal_lengths_are_bounded(log_focal: float) -> None:
    x = at(FRONTAL)
    x[3] = log_focal
    assert 0.3 < surface_of(x, np.eye(3), (0.0, 0.0), BASIS).focal < 13


@pytest.mark.parametrize("name", ["sheet", "sheet bent along its lines", "strong"])
@pytest.mark.parametrize("half_size", [None, (0.6, 0.8)])
def test_derivatives_by_the_principal_point_are_exact(
    name: str, half_size: tuple[float, float] | None
) -> None:
    bent = SHEETS[name]
    prior = PrincipalPointPrior((0.2, 0.1), half_size=half_size)
    observed = replace(observe(bent.surface(), line_noise=1e-3), principal_point=prior)
    start = bent.start()
    x = np.concatenate([at(bent), [0.07, -0.05]])
    residuals = PageResiduals(start.rotation, start.anchor, BASIS, observed, x, P)
    # Margins are measured from their median, which is some point's.
    found = differences(lambda y: residuals.evaluate(y)[0], x)[:, -2:]
    assert np.abs(residuals.evaluate(x)[1][:, -2:] - found).max() < 2e-3 * np.abs(found).max()


def test_the_sheet_keeps_its_place_in_the_photo_when_the_principal_point_moves() -> None:
    bent = SHEETS["sheet"]
    prior = PrincipalPointPrior((0.2, 0.1))
    observed = replace(observe(bent.surface()), principal_point=prior)
    start = bent.start()
    x = np.concatenate([at(bent), [0.07, -0.05]])
    surface = PageResiduals(start.rotation, start.anchor, BASIS, observed, x, P).surface(x)
    assert surface.anchor == pytest.approx(np.array(bent.anchor) - [0.07, -0.05])

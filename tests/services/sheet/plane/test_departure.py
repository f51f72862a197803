"""Convergence and bend of lines and strokes that are made by a homography or a parabola are found again."""

from dataclasses import replace

import numpy as np
import pytest

from services.geometry.photo_frame import PhotoFrame
from services.sheet.developable.observations import NO_LINES, LineObservations
from services.sheet.plane.departure import NARROW, Departure, measure_departure, perspective_by_flow
from services.texture_flow.field import FlowSamples

VIEW = PhotoFrame(1000, 1400)
HALF = 0.5 * VIEW.width / VIEW.unit_px
"""Half of the photo's width in centred units."""
GRID = np.stack(np.meshgrid(np.linspace(-0.8, 0.8, 12), np.linspace(-1.2, 1.2, 20)), axis=-1).reshape(-1, 2)
"""Characters, in halves of the photo's width."""
REACH = 0.5 * float(np.sqrt(np.mean((GRID[:, 0] * GRID[:, 1]) ** 2)))
"""RMS displacement of the print for a convergence of 1, as a share of the photo's width."""


def turned(at: np.ndarray, skew_rad: float) -> np.ndarray:
    """Places in halves of the width as centred points of a photo that is turned by `skew_rad`."""
    c, s = np.cos(skew_rad), np.sin(skew_rad)
    return np.asarray(HALF * at @ np.array([[c, s], [-s, c]]))


def measure(
    lines: LineObservations, strokes: FlowSamples | None = None, skew_rad: float = 0.0, px: float = 30.0
) -> Departure:
    return measure_departure(lines, strokes, turned(GRID, skew_rad), VIEW, skew_rad, px)


def seen_lines(a: float, b: float, bow: float, noise: float, skew_rad: float = 0.0) -> LineObservations:
    """Twenty lines through the homography of `departure`, bowed by `bow` x^2, all in halves of the width."""
    rng = np.random.default_rng(1)
    x, y = GRID.T
    depth = 1 + a * x + b * y
    at = np.column_stack([x / depth, (y + bow * x**2) / depth + rng.normal(0, noise, len(x))])
    points = turned(at, skew_rad)
    index = np.repeat(np.arange(20), 12)
    return LineObservations(points, index, np.full(len(points), 1e-3), [], [], [], 0.02)


def seen_strokes(a: float, b: float, skew_rad: float = 0.0, noise_rad: float = 0.0) -> FlowSamples:
    """Directions of upright strokes through the same homography."""
    rng = np.random.default_rng(2)
    at = rng.uniform([-0.8, -1.2], [0.8, 1.2], (200, 2))
    # Upright lines x / (1 + a x + b y): to first order they lean by b x.
    angles = np.pi / 2 + b * at[:, 0] + skew_rad + rng.normal(0, noise_rad, len(at))
    return FlowSamples(turned(at, skew_rad), angles, np.ones(len(at)))


@pytest.mark.parametrize("skew_rad", [0.0, 0.2, -1.5])
def test_perspective_is_found_again(skew_rad: float) -> None:
    a, b = 0.02, -0.03
    lines, strokes = seen_lines(a, b, 0.0, 0.0, skew_rad), seen_strokes(a, b, skew_rad)
    found = measure(lines, strokes, skew_rad)
    assert found.by_lines is not None
    assert found.by_strokes is not None
    assert found.by_lines.value == pytest.approx(a * REACH, rel=0.1)
    assert found.by_strokes.value == pytest.approx(b * REACH, abs=1e-6)
    # To first order: what is left of the homography is of the second.
    assert found.by_bend is not None
    assert found.by_bend.value < a * a + b * b


@pytest.mark.parametrize("share", [0.5, 0.25])
def test_print_on_a_narrow_page_is_measured_by_the_page(share: float) -> None:
    flow = seen_lines(0.02, -0.03, 0.0, 0.0)
    shares = []
    for size in (1.0, share):
        found = measure_departure(flow, None, turned(size * GRID, 0.0), VIEW, 0.0, 30.0)
        assert found.by_lines is not None
        shares.append(found.by_lines.value)
    # Displacements go with the square of the print's size, and the page's width with the size itself.
    width = 0.5 * float(np.ptp(size * GRID[:, 0]))
    assert shares[1] / shares[0] == pytest.approx(size**2 * NARROW / width, rel=0.01)


def test_a_turn_is_no_departure() -> None:
    found = measure(seen_lines(0.0, 0.0, 0.0, 0.0, 0.01))
    assert found.skew_rad == pytest.approx(0.01, rel=1e-3)
    assert found.by_lines is not None
    assert abs(found.by_lines.value) < 1e-9
    assert found.by_strokes is None


def test_a_bow_is_a_bend_and_no_perspective() -> None:
    bow = 0.02
    found = measure(seen_lines(0.0, 0.0, bow, 0.0))
    assert found.by_lines is not None
    assert found.by_bend is not None
    assert abs(found.by_lines.value) < 1e-9
    # RMS of the bow about its mean at the characters, halves of the width to shares of it.
    assert found.by_bend.value == pytest.approx(0.5 * bow * np.std(GRID[:, 0] ** 2), rel=1e-3)


def test_noise_is_no_bend() -> None:
    found = measure(seen_lines(0.0, 0.0, 0.0, 0.003))
    assert found.by_bend is not None
    assert found.by_bend.value < 2 * found.by_bend.deviation


def test_noise_of_lines_in_a_part_of_the_width_is_no_bend() -> None:
    rng = np.random.default_rng(1)
    at = np.stack(np.meshgrid(np.linspace(-0.75, 0.35, 9), np.linspace(-1.1, 0.3, 30)), axis=-1).reshape(
        -1, 2
    )
    seen = at + np.column_stack([np.zeros(len(at)), rng.normal(0, 0.001, len(at))])
    lines = LineObservations(
        turned(seen, 0.0), np.repeat(np.arange(30), 9), np.full(270, 1e-3), [], [], [], 0.02
    )
    found = measure_departure(lines, None, turned(at, 0.0), VIEW, 0.0, 30.0).by_bend
    assert found is not None
    # Curves are nearly straight there: what a convergence undoes is none.
    assert found.value + found.deviation < 0.0003


def test_few_points_show_neither_a_bend_nor_a_turn() -> None:
    """Of three short lines the bases are level, and capitals lift one end of each top."""
    level, lifted = np.array([-0.5, -0.5]), np.array([-0.57, -0.59])
    y = np.concatenate([row + k for k in (0.0, 0.1, 0.2) for row in (level, lifted[:: -1 if k else 1])])
    lines = LineObservations(
        turned(np.column_stack([np.tile([-0.7, -0.3], 6), y]), 0.0),
        np.repeat(np.arange(6), 2),
        np.full(12, 1e-3),
        [],
        [],
        [],
        0.02,
    )
    found = measure(lines)
    assert (found.by_bend, found.skew_rad) == (None, 0.0)


def test_deviations_are_those_of_the_noise() -> None:
    pulls = []
    for noise in (0.002, 0.004):
        found = measure(seen_lines(0.0, 0.0, 0.0, noise))
        assert found.by_lines is not None
        pulls.append(found.by_lines.value / found.by_lines.deviation)
        # The deviation of one coefficient of least squares.
        one = noise / np.sqrt(((GRID[:, 0] * GRID[:, 1]) ** 2).sum())
        assert found.by_lines.deviation == pytest.approx(one * REACH, rel=0.25)
    assert np.abs(pulls).max() < 3


def test_strokes_of_small_print_say_less() -> None:
    strokes = seen_strokes(0.0, 0.01, noise_rad=0.02)
    sharp, small = (measure(seen_lines(0, 0, 0, 0), strokes, px=px).by_strokes for px in (22.0, 11.0))
    assert sharp is not None
    assert small is not None
    assert small.deviation == pytest.approx(4 * sharp.deviation)


def test_a_paragraph_in_italics_at_the_foot_is_no_convergence() -> None:
    upright = seen_strokes(0.0, 0.0, noise_rad=np.deg2rad(1.0))
    lower = upright.points[:, 1] > np.quantile(upright.points[:, 1], 0.65)
    leaning = replace(upright, angles=upright.angles + np.where(lower, np.deg2rad(12.0), 0.0))
    found = measure(NO_LINES, leaning).by_strokes
    assert found is not None
    assert abs(found.value) < 4 * found.deviation
    converging = measure(NO_LINES, seen_strokes(0.0, 0.05, noise_rad=np.deg2rad(1.0))).by_strokes
    assert converging is not None
    assert abs(converging.value) > 10 * converging.deviation


def test_few_observations_say_nothing() -> None:
    none = LineObservations(np.zeros((0, 2)), np.zeros(0, np.intp), np.zeros(0), [], [], [], 0.02)
    few = FlowSamples(np.zeros((3, 2)), np.zeros(3), np.ones(3))
    found = measure(none, few, 0.1)
    assert (found.by_lines, found.by_strokes, found.by_bend) == (None, None, None)
    assert found.skew_rad == 0.1


def test_directions_of_lines_show_their_convergence_too() -> None:
    rng = np.random.default_rng(3)
    at = rng.uniform([-0.8, -1.2], [0.8, 1.2], (100, 2))
    flow = FlowSamples(HALF * at, -0.05 * at[:, 1], np.ones(100))
    found = perspective_by_flow(flow, turned(GRID, 0.0), VIEW, 0.0)
    assert found.value == pytest.approx(0.05 * REACH, abs=1e-9)
    assert found.deviation >= 0

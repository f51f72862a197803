"""Lines, their residuals and derivatives, and what sparse lines leave open."""

import numpy as np
import pytest

from services.geometry.camera import rotation_from_vector
from services.geometry.focal_prior import typical_focal_prior
from services.geometry.planar import PagePlane
from services.sheet.plane.outline_plane import OutlinePlane, plane_from_lines, side_lines
from services.sheet.plane.straight_lines import (
    StraightLines,
    _directions,
    along_axes,
    fit_line_plane,
    line_directions,
    side_directions,
    side_skew,
    start_plane,
)
from tests.services.sheet.sheet_sides import FRAME, leaning, outline_of, seen_rectangle

PRIOR = typical_focal_prior()
ROTATION = leaning(28.0, 35.0, 6.0)
TRUE = PagePlane(ROTATION, 1.4)


def sides() -> StraightLines:
    corners = seen_rectangle(0.7, ROTATION, 1.4)
    return side_lines(outline_of(corners, 0.0, np.random.default_rng(0)), FRAME)


def test_true_lines_meet_in_their_vanishing_points() -> None:
    assert np.abs(line_directions(TRUE, sides())).max() < 1e-7
    turned = PagePlane(ROTATION @ rotation_from_vector(np.array([0.0, 0.0, np.radians(-7.0)])), 1.4)
    assert np.abs(line_directions(turned, sides())).max() > np.radians(5)
    assert side_skew(turned, sides()) == pytest.approx(np.radians(7.0), abs=1e-7)
    assert np.abs(side_directions(turned, sides(), np.radians(7.0))).max() < 1e-7


def test_derivatives_are_those_of_the_angles() -> None:
    lines, plane = sides(), PagePlane(leaning(22.0, 50.0, 2.0), 1.2)
    _, J = _directions(plane.rotation, plane.focal, lines)
    step = 1e-6
    for j in range(4):
        w = np.zeros(3)
        w[j % 3] = step * (j < 3)
        ahead, behind = (
            PagePlane(
                plane.rotation @ rotation_from_vector(sign * w), plane.focal * np.exp(sign * step * (j == 3))
            )
            for sign in (1, -1)
        )
        difference = (line_directions(ahead, lines) - line_directions(behind, lines)) / (2 * step)
        assert np.allclose(J[:, j], difference, atol=1e-7)


def test_closed_form_is_exact_and_the_fit_stays() -> None:
    start = start_plane(sides(), PRIOR)
    assert start is not None
    assert np.allclose(start.rotation, ROTATION, atol=1e-9)
    assert start.focal == pytest.approx(1.4, rel=1e-7)
    wrong = PagePlane(leaning(15.0, 60.0, 0.0), 1.1)
    fit = fit_line_plane(sides(), PRIOR, wrong)
    assert np.allclose(fit.plane.rotation, ROTATION, atol=1e-4)  # the prior pulls a little


@pytest.mark.parametrize("rows", [(0,), (0, 1), (0, 2), (0, 2, 0)])
def test_lines_along_one_axis_and_two_lines_are_no_plane(rows: tuple[int, ...]) -> None:
    lines, chosen = sides(), list(rows)
    few = StraightLines(
        lines.starts[chosen], lines.ends[chosen], lines.deviations[chosen], lines.upright[chosen]
    )
    assert start_plane(few, PRIOR) is None
    assert not isinstance(plane_from_lines(few, PRIOR), OutlinePlane)


def test_axes_are_exchanged_where_the_text_runs_along_the_other_sides() -> None:
    sideways = PagePlane(ROTATION @ rotation_from_vector(np.array([0.0, 0.0, np.pi / 2 + 0.1])), 1.4)
    exchanged = along_axes(sideways, sides())
    assert (exchanged.upright == ~sides().upright).all()
    assert abs(side_skew(sideways, exchanged)) == pytest.approx(0.1, abs=1e-6)
    assert along_axes(TRUE, sides()) is not None
    assert (along_axes(TRUE, sides()).upright == sides().upright).all()

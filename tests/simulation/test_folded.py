"""Folded sheets against hand-made numbers."""

import numpy as np
import pytest

from simulation.camera import Camera, Pose
from simulation.flat_page import Page
from simulation.folded import Crease, Folded, folded_in_thirds
from simulation.truth import Truth

HALF_HEIGHT = 1.4


def _grid(half_height: float = HALF_HEIGHT) -> np.ndarray:
    s, t = np.linspace(-1, 1, 21), half_height * np.linspace(-1, 1, 29)
    return np.stack(np.meshgrid(s, t), axis=-1).reshape(-1, 2)


def test_a_sharp_crease_is_a_roof() -> None:
    # 30 degrees at t = 0.5: beyond it the sheet rises (z falls) by sin 30, and advances by cos 30.
    roof = Folded((Crease(0.5, np.radians(30.0)),))
    placed = roof.place(np.array([[0.3, 0.5], [0.3, 0.9], [0.3, -1.0]]))
    expected = [[0.3, 0.5, 0.0], [0.3, 0.5 + 0.4 * np.cos(np.pi / 6), -0.2], [0.3, -1.0, 0.0]]
    np.testing.assert_allclose(placed, expected, atol=1e-12)


def test_a_soft_crease_turns_by_its_angle_on_its_radius() -> None:
    crease = Folded((Crease(0.0, 0.6, 0.25),), across_rad=0.0, slope_rad=0.3)
    _, down = crease.tangents(np.array([[-0.5, 0.2], [0.0, 0.2], [0.5, 0.2]]))
    across, _ = crease.tangents(np.array([[-0.5, 0.2], [0.0, 0.2], [0.5, 0.2]]))
    np.testing.assert_allclose(np.arcsin(-across[:, 2]), [0.0, 0.3, 0.6], atol=1e-12)
    np.testing.assert_allclose(down, np.tile([0.0, 1.0, 0.0], (3, 1)), atol=1e-12)
    # The arc's chord: 2 r sin(angle / 2) over an arc of r angle.
    ends = crease.place(np.array([[-0.075, 0.0], [0.075, 0.0]]))
    assert np.linalg.norm(ends[1] - ends[0]) == pytest.approx(0.5 * np.sin(0.3))


@pytest.mark.parametrize("radius", [0.0, 0.03])
@pytest.mark.parametrize("upright", [False, True])
def test_a_letter_is_isometric_level_and_seen_whole(radius: float, upright: bool) -> None:
    shape = folded_in_thirds(
        HALF_HEIGHT, 35.0, -30.0, radius=radius, sags=(0.1, -0.1, 0.05), upright=upright, skew_deg=2.0
    )
    step = 1e-6
    sheet = _grid()
    for axis in np.eye(2):
        length = np.linalg.norm(shape.place(sheet + step * axis) - shape.place(sheet - step * axis), axis=1)
        np.testing.assert_allclose(length / (2 * step), 1.0, atol=1e-6)
    # Edge to edge across the creases is level.
    half = 1.0 if upright else HALF_HEIGHT
    along = np.array([np.cos(shape.across_rad), np.sin(shape.across_rad)])
    assert np.ptp(shape.place(np.outer([-half, half], along))[:, 2]) < 1e-12
    page = Page(np.full((280, 200), 255, np.uint8))
    truth = Truth(page, shape, 0.0, Pose(0.4, 0.9, 0.1, (0.0, 0.0, 4.0)), Camera(600.0, 420, 540))
    truth.check_visible()
    # One photo point for one sheet point: no part hides another.
    np.testing.assert_allclose(truth.photo_to_sheet(truth.sheet_to_photo(sheet)), sheet, atol=1e-9)


def test_what_does_not_fit_is_refused() -> None:
    with pytest.raises(ValueError, match="panel"):
        Folded((Crease(0.0, 0.3),), sags=(0.1,))
    with pytest.raises(ValueError, match="overlap"):
        Folded((Crease(0.0, 0.5, 0.5), Crease(0.1, 0.5, 0.5)))

"""Flat pixels -> mosaic pixels and back."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from services.geometry.homographies import scaling, translation
from services.mosaic.placing.placement import DisplacementField, Placement

GRID = np.stack(np.meshgrid(np.linspace(0, 799, 9), np.linspace(0, 599, 7)), axis=-1).reshape(-1, 2)


def bump(amplitude_px: float) -> DisplacementField:
    """A displacement that falls off from the middle of a view of 800 x 600."""
    x, y = np.meshgrid(np.linspace(-2, 2, 17), np.linspace(-2, 2, 13))
    hill = amplitude_px * np.exp(-(x**2 + y**2))
    return DisplacementField(np.stack([hill, -0.5 * hill], axis=-1), 800, 600)


def test_a_displacement_is_interpolated_between_its_nodes() -> None:
    nodes = np.array([[[0.0, 0.0], [2.0, 0.0]], [[0.0, 4.0], [2.0, 4.0]]])
    field = DisplacementField(nodes, 101, 51)
    at = np.array([[50.0, 25.0], [0.0, 0.0], [100.0, 50.0], [25.0, 0.0]])
    np.testing.assert_allclose(field.at(at), [[1.0, 2.0], [0.0, 0.0], [2.0, 4.0], [0.5, 0.0]])


def test_beyond_the_view_the_border_goes_on() -> None:
    field = DisplacementField(np.full((2, 2, 2), 3.0), 101, 51)
    np.testing.assert_allclose(field.at(np.array([[-500.0, 25.0], [1e6, 1e6]])), 3.0)


def test_points_that_are_not_known_stay_unknown() -> None:
    at = bump(10.0).at(np.array([[np.nan, 20.0], [399.5, 299.5], [np.nan, np.nan]]))
    assert np.isnan(at[0]).all()
    assert np.isnan(at[2]).all()
    np.testing.assert_allclose(at[1], [10.0, -5.0], atol=0.01)


@given(st.floats(-15.0, 15.0), st.floats(0.4, 2.5), st.floats(-1e-4, 1e-4))
def test_there_and_back(amplitude_px: float, scale: float, perspective: float) -> None:
    H = translation(30.0, -7.0) @ scaling(scale)
    H[2, 0] = perspective
    placement = Placement(H, bump(amplitude_px))
    back = placement.to_flat(placement.to_mosaic(GRID))
    assert np.abs(back - GRID).max() < 0.02


def test_a_displacement_moves_the_flat_pixels_before_the_homography() -> None:
    placement = Placement(scaling(2.0), bump(5.0))
    middle = np.array([[399.5, 299.5]])
    np.testing.assert_allclose(placement.to_mosaic(middle), 2 * (middle + np.array([5.0, -2.5])))


def test_within_another_frame() -> None:
    placement = Placement(translation(5.0, 6.0), bump(3.0))
    moved = placement.within(scaling(3.0))
    np.testing.assert_allclose(moved.to_mosaic(GRID), 3 * placement.to_mosaic(GRID))

"""Photo -> mosaic, node by node."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from services.arrays import Points
from services.geometry.homographies import scaling, transform_points, translation
from services.geometry.page_frame import turning
from services.mosaic.flattening import view_photo
from services.mosaic.patch_mesh import flat_points, mesh_of_patch, scale_of_patch, turn_as_in_patch
from services.mosaic.placing.placement import Placement
from services.sheet.plane.framing import FlatFrame
from tests.services.mosaic.views import page_image, photograph

TILTED = np.array([[1.1, 0.1, 20.0], [-0.05, 0.9, 10.0], [2e-4, -1e-4, 1.0]])


def tilted_view():
    photo = photograph(page_image(), TILTED, 700, 900)
    return view_photo(0, photo, FlatFrame(TILTED, 800, 1100), 12.0, 100.0)


def test_the_mesh_follows_the_photo_through_the_flat_view_to_the_mosaic() -> None:
    view = tilted_view()
    placement = Placement(translation(100.0, 50.0) @ scaling(0.5))
    mesh = mesh_of_patch(view, placement)
    assert mesh.shape == (65, 49, 2)
    x, y = np.meshgrid(np.linspace(0, 699, 49), np.linspace(0, 899, 65))
    photo = np.stack([x, y], axis=-1).reshape(-1, 2)
    # The frame was the page itself: where a photo's pixel shows the page, moved to the mosaic.
    expected = transform_points(placement.H_mosaic_flat @ np.linalg.inv(TILTED), photo)
    np.testing.assert_allclose(mesh.reshape(-1, 2), expected, atol=1e-6)


@dataclass(frozen=True)
class Turning:
    """A page of 800 x 1100 that turns away to the right: x of the photo is u - u^`power`, of its width."""

    power: float
    width: int = 800
    height: int = 1100
    H_photo_flat: None = None

    def to_flat(self, photo: Points) -> Points:
        u = np.linspace(0, 1, 4001)
        x = (u - (1 - 1e-3) * u**self.power / self.power) * self.power / (self.power - 1)
        return np.stack([799 * np.interp(photo[:, 0] / 699, x, u), 1099 * photo[:, 1] / 899], axis=1)


@pytest.mark.parametrize(("power", "shape"), [(40.0, (129, 97, 2)), (2.0, (129, 97, 2)), (1e6, (65, 49, 2))])
def test_a_page_that_turns_away_has_a_finer_mesh(power: float, shape: tuple[int, int, int]) -> None:
    view = replace(tilted_view(), frame=Turning(power))
    mesh = mesh_of_patch(view, Placement(np.eye(3)))
    assert mesh.shape == shape
    x, y = np.meshgrid(np.linspace(0, 699, shape[1]), np.linspace(0, 899, shape[0]))
    exact = Turning(power).to_flat(np.stack([x, y], axis=-1).reshape(-1, 2))
    np.testing.assert_allclose(mesh.reshape(-1, 2), exact, atol=1e-9)


@pytest.mark.parametrize("turn_deg", [0, 90, 180, 270])
def test_the_turn_against_a_photo_is_undone(turn_deg: int) -> None:
    view = tilted_view()
    # The page is drawn so that it must be turned by `turn_deg` to lie as in the photo, but for its tilt.
    turn, _, _ = turning(400, 550, turn_deg, False)
    assert turn_as_in_patch(view, Placement(scaling(0.5)), turn) == turn_deg


def test_points_beyond_the_horizon_take_their_neighbours_place() -> None:
    steep = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 2e-3, 1.0]])
    photo = photograph(page_image(), steep, 600, 700)
    view = view_photo(0, photo, FlatFrame(steep, 500, 500), 12.0, 100.0)
    flat = flat_points(view, np.array([[100.0, 100.0], [100.0, 650.0]]))
    np.testing.assert_allclose(transform_points(steep, flat[:1]), [[100.0, 100.0]], atol=1e-6)
    assert np.isnan(flat[1]).all()
    mesh = mesh_of_patch(view, Placement(np.eye(3)))
    assert np.isfinite(mesh).all()
    assert np.abs(mesh).max() < 5 * 500


def test_scale_is_mosaic_pixels_per_photo_pixel() -> None:
    photo = photograph(page_image(), scaling(0.5), 500, 780)
    view = view_photo(0, photo, FlatFrame(scaling(0.5), 1000, 1560), 6.0, 100.0)
    assert abs(scale_of_patch(view, Placement(scaling(1.5))) - 3.0) < 0.01

"""Pixels: the filter, the light, the edge of the page."""

import cv2
import numpy as np
import pytest

from simulation.camera import Camera, Pose
from simulation.flat_page import Page
from simulation.photo import Light, frontal_scene, lambertian, simulate_photo
from simulation.surfaces import Cylinder, Plane
from tests.simulation.scene import CAMERA, POSE, SHAPES, blank_page


def _noise_page(width: int = 160, height: int = 200, channels: int = 0) -> Page:
    shape = (height, width, channels) if channels else (height, width)
    return Page(np.random.default_rng(5).integers(0, 256, shape, dtype=np.uint8))


@pytest.mark.parametrize("channels", [0, 3])
def test_a_flat_frontal_view_at_full_size_is_the_page(channels: int) -> None:
    page = _noise_page(channels=channels)
    plane, pose, camera = frontal_scene(page)
    photo = simulate_photo(page, plane, 0.0, pose, camera)
    expected = page.image if channels else np.repeat(page.image[..., None], 3, axis=2)
    assert np.abs(photo.image.astype(int) - expected)[1:-1, 1:-1].max() <= 1


def test_reduced_stripes_turn_gray_not_moire() -> None:
    stripes = np.zeros((400, 400), np.uint8)
    stripes[:, ::2] = 255
    page = Page(stripes)
    plane, pose, _ = frontal_scene(page, Camera(500.0, 400, 400))
    far = Pose(translation=(0.0, 0.0, pose.translation[2] * 4.3))
    photo = simulate_photo(page, plane, 0.0, far, Camera(500.0, 100, 100))
    middle = photo.image[20:80, 20:80].astype(float)
    assert middle.mean() == pytest.approx(127.5, abs=3)
    assert middle.std() < 12


def test_reduced_view_agrees_with_an_area_average() -> None:
    page = Page(cv2.GaussianBlur(_noise_page(384, 384).image, (0, 0), 1.0))
    plane, pose, _ = frontal_scene(page, Camera(500.0, 384, 384))
    third = Pose(translation=(0.0, 0.0, pose.translation[2] * 3))
    photo = simulate_photo(page, plane, 0.0, third, Camera(500.0, 128, 128)).image[..., 0].astype(float)
    expected = page.image.reshape(128, 3, 128, 3).mean(axis=(1, 3))
    error = (photo - expected)[2:-2, 2:-2]
    assert np.sqrt((error**2).mean()) < 0.15 * expected.std()


def test_pixels_show_what_the_backward_map_says() -> None:
    ramp = np.add.outer(np.arange(440) * 0.3, np.arange(320) * 0.3).astype(np.uint8)
    photo = simulate_photo(Page(ramp), SHAPES["cylinder"], 0.15, POSE, CAMERA)
    shown = photo.truth.backward_map()
    whole = cv2.erode(photo.truth.page_mask().astype(np.uint8), np.ones((5, 5), np.uint8)).astype(bool)
    with np.errstate(invalid="ignore"):
        inside = whole & np.all((shown > 5) & (shown < [314, 434]), axis=2)
    expected = shown[inside].sum(axis=1) * 0.3
    light = lambertian(photo.truth.normals(np.argwhere(inside)[:, ::-1].astype(float)), (Light(),))
    assert np.abs(photo.image[inside][:, 0] - expected * light).max() < 2


def test_cropped_corners_are_paper_and_the_rest_is_background() -> None:
    page = Page(np.zeros((200, 160), np.uint8), paper=200)
    plane, pose, camera = frontal_scene(page, Camera(300.0, 240, 280))
    photo = simulate_photo(page, plane, 0.3, pose, camera, background=90)
    assert photo.image[0, 0, 0] == 90
    assert photo.image[140, 120, 0] == 0
    corner = np.round(photo.truth.outline(1)[0]).astype(int) + 5
    assert photo.image[corner[1], corner[0], 0] == 200


def test_the_outline_is_antialiased_at_its_place() -> None:
    page = Page(np.full((100, 100), 255, np.uint8))
    plane, pose, camera = frontal_scene(page, Camera(300.0, 140, 140))
    # A quarter of a pixel to the right: the left border pixel is covered by three quarters.
    shifted = Pose(translation=(0.25 / 50, 0.0, pose.translation[2]))
    row = simulate_photo(page, plane, 0.0, shifted, camera).image[70, :, 0]
    assert row[19] == 0
    assert row[20] == pytest.approx(0.75 * 255, abs=2)
    assert row[21] == 255


def test_lambert_by_hand() -> None:
    page = Page(np.full((120, 100), 160, np.uint8))
    tilted = Pose(np.radians(40.0), 0.0, 0.0, (0.0, 0.0, 4.0))
    photo = simulate_photo(page, Plane(), 0.0, tilted, Camera(200.0, 101, 121))
    assert photo.image[60, 50, 0] == pytest.approx(160 * np.cos(np.radians(40.0)), abs=1)
    two = (Light((0.0, 0.0, 2.0), 0.4), Light((1.0, 0.0, 0.0), 0.5), Light((0.0, 0.0, -1.0), 9.0))
    photo = simulate_photo(page, Plane(), 0.0, tilted, Camera(200.0, 101, 121), lights=two)
    # N = (-sin 40, 0, cos 40): the second light comes from behind the page, the third too.
    assert photo.image[60, 50, 0] == pytest.approx(160 * 0.4 * np.cos(np.radians(40.0)), abs=1)


def test_light_follows_the_curve() -> None:
    page = Page(np.full((300, 300), 200, np.uint8))
    shape = Cylinder((0.0, 0.0, 0.4))
    photo = simulate_photo(page, shape, 0.0, Pose(translation=(0.0, 0.0, 3.2)), Camera(480.0, 300, 300))
    points = np.array([[60.0, 150.0], [150.0, 150.0], [240.0, 150.0]])
    expected = 200 * photo.truth.normals(points)[:, 2]
    shown = photo.image[points[:, 1].astype(int), points[:, 0].astype(int), 0]
    np.testing.assert_allclose(shown, expected, atol=1.5)
    assert shown[1] > shown[0] + 20


def test_a_background_picture_is_kept_beside_the_page() -> None:
    desk = np.random.default_rng(2).integers(0, 255, (CAMERA.height, CAMERA.width, 3), dtype=np.uint8)
    kept = desk.copy()
    photo = simulate_photo(blank_page(), Plane(), 0.0, POSE, CAMERA, background=desk)
    away = ~cv2.dilate(photo.truth.page_mask().astype(np.uint8), np.ones((5, 5), np.uint8)).astype(bool)
    assert away.any()
    assert np.array_equal(photo.image[away], desk[away])
    assert np.array_equal(desk, kept)


def test_a_background_of_another_size_is_refused() -> None:
    with pytest.raises(ValueError, match="size"):
        simulate_photo(blank_page(), Plane(), 0.0, POSE, CAMERA, background=np.zeros((5, 5, 3), np.uint8))

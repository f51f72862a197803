"""Each kernel beside its plain version."""

from collections.abc import Callable

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.arrays import RgbImage
from services.imaging.bicubic import (
    bicubic_weights,
    draw_between_nodes,
    draw_between_nodes_plain,
    draw_by_homography,
    draw_by_homography_plain,
    draw_by_map,
    draw_by_map_plain,
)
from services.imaging.grid_paths import (
    accumulate_scores,
    accumulate_scores_plain,
    trace_back,
    trace_back_plain,
)
from services.imaging.node_grid import GRID_STEP_PX, node_grid
from services.imaging.reduction import average_areas, average_areas_plain
from services.kernels.library import FOLDER, find_kernels
from services.sheet.outline.edges import edge_profiles, edge_profiles_plain, steps_along, steps_along_plain

pytestmark = pytest.mark.skipif(find_kernels() is None, reason="needs kernels, which a C compiler makes")
SIZE = (61, 83)


@pytest.fixture(scope="module")
def photo() -> RgbImage:
    """Smooth enough that 1/1024 of a pixel is no gray level, but with edges."""
    noise = np.random.default_rng(1).integers(0, 256, (70, 90, 3), np.uint8)
    smooth = cv2.GaussianBlur(noise, (0, 0), 1.5)
    smooth[20:40, 30:50] = 255
    return smooth


Views = tuple[RgbImage, RgbImage]


def drawn(kernel: Callable[..., None], plain: Callable[..., None], *arguments: object) -> Views:
    """By the kernel and plain; into views that are parts of larger arrays, as bands are."""
    views = [np.full((SIZE[0] + 2, SIZE[1], 3), 7, np.uint8) for _ in range(2)]
    image, *others = arguments
    for draw, view in zip((kernel, plain), views, strict=True):
        draw(image, view[1:-1], *others)
        assert (view[[0, -1]] == 7).all()
    return views[0][1:-1], views[1][1:-1]


def assert_alike(ours: RgbImage, plain: RgbImage) -> None:
    difference = np.abs(ours.astype(int) - plain)
    assert difference.max() <= 1
    assert (difference > 0).mean() < 0.06


@pytest.mark.parametrize("beyond", [255, 0, None])
@pytest.mark.parametrize("shift", [(0.0, 0.0), (5.3, -4.7), (-20.2, 11.9), (500.0, 0.0)])
def test_maps(photo: RgbImage, beyond: int | None, shift: tuple[float, float]) -> None:
    y, x = np.mgrid[: SIZE[0], : SIZE[1]].astype(np.float32)
    at = np.stack([x + 3 * np.sin(y / 9) + shift[0], 0.9 * y + 2 * np.cos(x / 7) + shift[1]], axis=-1)
    at = at.astype(np.float32)
    together = drawn(draw_by_map, draw_by_map_plain, photo, at[..., 0], at[..., 1], beyond)
    assert_alike(*together)
    apart = drawn(draw_by_map, draw_by_map_plain, photo, at[..., 0].copy(), at[..., 1].copy(), beyond)
    assert np.array_equal(apart[0], together[0])


@pytest.mark.parametrize("size", [(61, 83), (61, 64), (16, 89), (1, 1), (17, 72), (48, 73)])
def test_nodes(photo: RgbImage, size: tuple[int, int]) -> None:
    grid, (rows, columns) = node_grid(0, 0, size[1], size[0])
    nodes = (
        (grid + 3 * np.sin(grid[:, ::-1] / 20) + [2.5, -7.25]).reshape(rows, columns, 2).astype(np.float32)
    )
    nodes[0, 1] = np.nan
    views = [np.full((*size, 3), 7, np.uint8) for _ in range(2)]
    draw_between_nodes(photo, views[0], nodes, 255)
    draw_between_nodes_plain(photo, views[1], nodes, 255)
    assert (views[0][:8] == 255).any()
    assert_alike(views[0], views[1])


def test_nodes_of_another_view_are_refused(photo: RgbImage) -> None:
    with pytest.raises(ValueError, match="round the view"):
        draw_between_nodes(photo, np.zeros((40, 40, 3), np.uint8), np.zeros((4, 5, 2), np.float32), 255)


def test_nodes_are_as_far_apart_as_the_kernel_takes_them() -> None:
    assert f"NODE_PX = {GRID_STEP_PX}," in (FOLDER / "bicubic.h").read_text()


@pytest.mark.parametrize("beyond", [255, None])
def test_homographies(photo: RgbImage, beyond: int | None) -> None:
    H_photo_view = np.array([[1.1, 0.1, -6.0], [-0.05, 0.9, 4.0], [1e-3, -2e-3, 1.0]])
    assert_alike(*drawn(draw_by_homography, draw_by_homography_plain, photo, H_photo_view, beyond))


def test_a_horizon_within_the_view_is_drawn(photo: RgbImage) -> None:
    H_photo_view = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 1 / 30, -1.0]])
    ours, plain = drawn(draw_by_homography, draw_by_homography_plain, photo, H_photo_view, 255)
    # On the horizon itself a place is infinite.
    assert (ours[30] == 255).all()
    assert_alike(np.delete(ours, 30, axis=0), np.delete(plain, 30, axis=0))


def test_places_that_are_no_numbers_are_beyond(photo: RgbImage) -> None:
    x, y = (np.full(SIZE, value, np.float32) for value in (np.nan, 5.0))
    x[1], x[2] = np.inf, -1e30
    view = np.zeros((*SIZE, 3), np.uint8)
    draw_by_map(photo, view, x, y, 255)
    assert (view == 255).all()


def test_whole_places_are_the_photo_itself(photo: RgbImage) -> None:
    y, x = np.mgrid[: SIZE[0], : SIZE[1]].astype(np.float32)
    assert np.array_equal(
        drawn(draw_by_map, draw_by_map_plain, photo, x, y, None)[0], photo[: SIZE[0], : SIZE[1]]
    )


def test_weights_add_up() -> None:
    sums = bicubic_weights().astype(int).sum(axis=1)
    assert np.abs(sums - (1 << 15)).max() <= 2


@pytest.mark.parametrize("width", [1, 3, 5, 6, 9])
def test_photos_that_are_narrower_than_what_is_loaded(width: int) -> None:
    photo = np.random.default_rng(width).integers(0, 256, (4, width, 3), np.uint8)
    y, x = np.mgrid[: SIZE[0], : SIZE[1]].astype(np.float32)
    ours, plain = drawn(draw_by_map, draw_by_map_plain, photo, x / 8, y / 16, 255)
    assert np.abs(ours.astype(int) - plain).max() <= 1


def test_profiles(photo: RgbImage) -> None:
    """Also beyond the photo, where its border is repeated; OpenCV rounds what is averaged."""
    rng = np.random.default_rng(6)
    points, angle = rng.uniform(-20, 110, (200, 2)), rng.uniform(0, 2 * np.pi, 200)
    points[:4] = [[0, 0], [89, 69], [89.0, -1e7], [np.nan, 5.0]]
    normals = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    tangential = rng.uniform(-2, 2, (200, 5))
    arguments = (photo, points, normals, np.arange(-7, 7.5, 0.7), tangential)
    ours, plain = edge_profiles(*arguments), edge_profiles_plain(*arguments)
    assert np.isfinite(ours).all()
    known = np.isfinite(points).all(axis=1)
    assert np.abs(ours[known] - plain[known]).max() <= 0.51


def test_steps_of_profiles() -> None:
    rng = np.random.default_rng(7)
    colors = np.cumsum(rng.normal(0, 20, (40, 31, 3)), axis=1).astype(np.float32)
    colors[5] = 0
    ours, plain = (find(colors, slice(7, 24), (2, 5)) for find in (steps_along, steps_along_plain))
    for mine, expected in zip(ours, plain, strict=True):
        assert np.abs(mine - expected).max() < 1e-3
    for sought in (slice(4, 24), slice(7, 27), slice(9, 9)):
        with pytest.raises(ValueError, match="beyond"):
            steps_along(colors, sought, (2, 5))


@given(
    st.integers(1, 60),
    st.integers(1, 60),
    st.integers(1, 60),
    st.integers(1, 60),
    st.sampled_from([1, 3]),
    st.integers(0, 2**32 - 1),
)
def test_areas(height: int, width: int, rows: int, columns: int, channels: int, seed: int) -> None:
    shape = (height, width + 2) if channels == 1 else (height, width + 2, channels)
    image = np.random.default_rng(seed).integers(0, 256, shape, np.uint8)[:, 1:-1]
    size = min(columns, width), min(rows, height)
    difference = np.abs(average_areas(image, *size).astype(int) - average_areas_plain(image, *size))
    # Halves between two levels are rounded by either.
    assert difference.max() <= 1


def test_areas_of_what_is_even_are_the_same() -> None:
    image = np.full((70, 90, 3), 255, np.uint8)
    assert (average_areas(image, 37, 41) == 255).all()
    assert (average_areas(image[..., 0], 37, 41) == 255).all()


@given(
    st.integers(1, 3), st.integers(1, 12), st.integers(1, 15), st.integers(0, 4), st.integers(0, 2**32 - 1)
)
def test_paths(grids: int, rows: int, columns: int, most: int, seed: int) -> None:
    """The same sums to the last bit, the same paths: also where no path leads, and where many are as good."""
    rng = np.random.default_rng(seed)
    score = rng.integers(0, 3, (grids, rows, columns)) / 2.0
    score[rng.random(score.shape) < 0.3] = -np.inf
    best = accumulate_scores(score, most, 0.25)
    assert np.array_equal(best, accumulate_scores_plain(score, most, 0.25))
    whose = np.repeat(np.arange(grids), columns)
    ends = np.tile(np.arange(columns), grids)
    paths = trace_back(best, whose, ends, most, 0.25)
    assert np.array_equal(paths, trace_back_plain(best, whose, ends, most, 0.25))
    assert np.array_equal(paths[:3], trace_back_plain(best, whose[:3], ends[:3], most, 0.25))


def test_what_kernels_cannot_take_is_refused(photo: RgbImage) -> None:
    """They check nothing themselves."""
    view, empty = np.zeros((4, 4, 3), np.uint8), np.zeros((0, 5, 3), np.uint8)
    single, double = (np.zeros((4, 4), kind) for kind in (np.float32, np.float64))
    shown = np.broadcast_to(view[:1], view.shape)
    ones, steps = np.ones((2, 2)), np.ones(3)
    profiles = np.zeros((2, 30, 3), np.float32)
    calls: list[Callable[[], object]] = [
        lambda: draw_by_homography(empty, view, np.eye(3), None),
        lambda: draw_by_homography(photo, shown, np.eye(3), None),
        lambda: draw_by_map(empty, view, single, single, None),
        lambda: draw_by_map(photo, view, double, double, None),
        lambda: average_areas(photo, 0, 3),
        lambda: average_areas(empty, 1, 1),
        lambda: edge_profiles(empty, ones, ones, steps, ones),
        lambda: edge_profiles(photo, ones, ones[:1], steps, ones),
        lambda: edge_profiles(photo, ones, ones, steps, ones[:1]),
        lambda: steps_along(profiles, slice(6, 20), (7, 5)),
    ]
    for call in calls:
        with pytest.raises(ValueError, match=r"pixels|precision|point|beyond|written"):
            call()


def test_very_many_white_pixels_are_white() -> None:
    assert (average_areas(np.full((1, 4_000_000), 255, np.uint8), 3, 1) == 255).all()


def test_ends_outside_of_the_grids_are_refused() -> None:
    best = np.zeros((1, 3, 4))
    for grids, ends in (([1], [0]), ([0], [4]), ([0], [-1])):
        with pytest.raises(IndexError):
            trace_back(best, np.array(grids), np.array(ends), 1, 0.1)
    with pytest.raises(IndexError):
        trace_back(best[:, :0], np.array([0]), np.array([0]), 1, 0.1)

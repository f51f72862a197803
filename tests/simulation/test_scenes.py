"""The experiments' scenes fit the photo and have the properties that the dissertation tells of."""

import numpy as np
import pytest

from simulation.degradation import PHONE
from simulation.flat_page import Page
from simulation.scenes import (
    CONE,
    CURVATURE_SERIES,
    CURVED_SHAPES,
    PAGE_SIZE,
    PHOTO_SIZE,
    PLANE,
    POSES,
    SKEWS_RAD,
    TILT_SERIES,
    View,
    photograph,
)
from simulation.surfaces import Shape
from simulation.truth import Truth

PAGE = Page(np.full((PAGE_SIZE[1], PAGE_SIZE[0]), 255, np.uint8))


def _truth(view: View, shape: Shape, skew_rad: float = 0.0) -> Truth:
    camera = view.camera()
    return Truth(PAGE, shape, skew_rad, view.pose(PAGE, shape, camera), camera)


@pytest.mark.parametrize("shape", [PLANE, *CURVED_SHAPES, CONE])
@pytest.mark.parametrize("view", POSES, ids=lambda view: view.name)
def test_the_page_is_seen_whole_and_fills_the_photo(view: View, shape: Shape) -> None:
    truth = _truth(view, shape)
    truth.check_visible()
    outline = truth.outline()
    size = outline.max(axis=0) - outline.min(axis=0)
    assert outline.min() > 0
    assert np.all(outline.max(axis=0) < np.array(PHOTO_SIZE) - 1)
    assert np.max(size / PHOTO_SIZE) == pytest.approx(0.96, abs=0.005)
    across = truth.page_to_photo(np.array([[799.0, 1249.5], [800.0, 1249.5]]))
    smallest = 0.75 if shape is PLANE else 0.55
    assert smallest < np.linalg.norm(across[1] - across[0]) < 1.25


@pytest.mark.parametrize("view", CURVATURE_SERIES)
def test_the_curvature_series_can_be_seen(view: Shape) -> None:
    _truth(POSES[0], view).check_visible()


@pytest.mark.parametrize("view", TILT_SERIES, ids=lambda view: view.name)
def test_the_tilt_series_can_be_seen(view: View) -> None:
    _truth(view, PLANE).check_visible()
    _truth(view, CURVATURE_SERIES[2]).check_visible()


def test_text_lines_are_almost_parallel_in_poses_1_and_2_at_minus_15_degrees() -> None:
    middle = np.array([[1049.5, 1349.5]])

    def depth(view: View, skew_rad: float) -> float:
        return abs(float(_truth(view, PLANE, skew_rad).major_flow_3d(middle)[0, 2]))

    assert [depth(view, SKEWS_RAD[2]) < 0.03 for view in POSES] == [True, True, False, False]
    assert min(depth(view, skew) for view in POSES for skew in SKEWS_RAD[:2]) > 0.1


def test_tilts_are_the_named_ones() -> None:
    middle = np.array([[1049.5, 1349.5]])
    for view in POSES:
        normal = _truth(view, PLANE).normals(middle)[0]
        assert np.degrees(np.arccos(normal[2])) == pytest.approx(view.tilt_deg)


def test_another_photo_size_keeps_the_field_of_view() -> None:
    large, small = POSES[0].camera(), POSES[0].camera(525, 675)
    assert small.half_field_of_view_rad == pytest.approx(large.half_field_of_view_rad)


def test_photograph_clean_and_dirty() -> None:
    page = Page(np.full((250, 160), 200, np.uint8))
    clean = photograph(page, POSES[1], 0.0, size=(210, 270))
    assert clean.image.shape == (270, 210, 3)
    assert clean.image[0, 0].max() == 0
    dirty = photograph(page, POSES[1], 0.0, dirt=PHONE, rng=np.random.default_rng(1), size=(210, 270))
    assert dirty.image[0, 0].max() > 10
    again = photograph(page, POSES[1], 0.0, dirt=PHONE, rng=np.random.default_rng(1), size=(210, 270))
    assert np.array_equal(dirty.image, again.image)
    with pytest.raises(ValueError, match="generator"):
        photograph(page, POSES[1], 0.0, dirt=PHONE, size=(210, 270))

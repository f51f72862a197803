"""Smaller pictures: within the limits, and with meshes that say what their pixels show."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.contract.answers.mosaic import Pair
from services.contract.images import Encoding
from services.mosaic.results import MosaicResult, Patch
from services.operations.reduced_views import reduce_mosaic, reduce_view, reduced_size
from services.rectify.results import CameraEstimate, Evidence, Orientation, RectifyResult
from services.sheet.surfaces import PlaneSurface

sides = st.integers(1, 5000)


@given(sides, sides, st.none() | sides, st.none() | sides)
def test_a_size_keeps_the_limits_and_is_never_larger(
    width: int, height: int, max_width: int | None, max_height: int | None
) -> None:
    found = reduced_size(width, height, max_width, max_height)
    assert 1 <= found[0] <= min(width, max_width or width)
    assert 1 <= found[1] <= min(height, max_height or height)
    if max_width is None and max_height is None:
        assert found == (width, height)


def to_photo(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Photo points (..., 2) of points of a page: a homography as strong as that of a photo from 45 degrees."""
    w = 1 + 4e-4 * x + 2e-4 * y
    return np.stack([(1.5 * x + 0.1 * y + 30) / w, (0.05 * x + 1.2 * y + 50) / w], axis=-1)


def view(width: int, height: int) -> RectifyResult:
    x, y = np.meshgrid(np.linspace(0, width - 1, 49), np.linspace(0, height - 1, 65))
    return RectifyResult(
        np.zeros((height, width, 3), np.uint8),
        "planar",
        Evidence(None, None, 0.4),
        CameraEstimate(None, None, "assumed"),
        PlaneSurface(None),
        Orientation(0, False, None),
        to_photo(x, y),
        corners=np.zeros((4, 2)),
    )


@pytest.mark.parametrize(("max_width", "max_height"), [(250, None), (None, 401), (333, 333), (1, 1)])
def test_the_mesh_is_that_of_the_smaller_picture(max_width: int | None, max_height: int | None) -> None:
    width, height = 1000, 1400
    result = reduce_view(view(width, height), Encoding(max_width=max_width, max_height=max_height))
    rows, columns = result.image.shape[:2]
    # Pixel (u, v) of the smaller picture is the mean of pixels about ((u + 0.5) s - 0.5, (v + 0.5) s - 0.5).
    u, v = np.meshgrid(np.linspace(0, columns - 1, 49), np.linspace(0, rows - 1, 65))
    truth = to_photo((u + 0.5) * width / columns - 0.5, (v + 0.5) * height / rows - 0.5)
    assert np.abs(result.mesh - truth).max() < 0.1, "a tenth of a photo pixel"
    assert np.array_equal(result.corners, np.zeros((4, 2)))  # type: ignore[arg-type]  # of the photo


def test_a_picture_within_the_limits_is_left_alone() -> None:
    result = view(100, 140)
    assert reduce_view(result, Encoding()) is result
    assert reduce_view(result, Encoding(max_width=100, max_height=141)) is result


def test_pixels_are_means_of_those_that_they_cover() -> None:
    stripes = np.zeros((8, 8, 3), np.uint8)
    stripes[:, ::2] = 200
    result = reduce_view(replace(view(8, 8), image=stripes), Encoding(max_width=4))
    assert result.image.shape == (4, 4, 3)
    assert (result.image == 100).all()


def test_a_mosaic_has_its_points_in_the_smaller_picture() -> None:
    corners = np.array([[[-0.5, -0.5], [999.5, -0.5]], [[-0.5, 1999.5], [999.5, 1999.5]]])
    patches = (Patch(True, corners, 2.0, 1.0), Patch(False))
    pair = Pair(a=0, b=1, matches=9, votes=8, runner_up_votes=1, overlap_fraction=0.2, residual_px=0.5)
    mosaic = MosaicResult(
        np.zeros((2000, 1000, 3), np.uint8), 0, patches, (pair,), (1,), Orientation(0, False, None)
    )
    smaller = reduce_mosaic(mosaic, Encoding(max_height=500))
    assert smaller.image.shape == (500, 250, 3)
    placed, missing = smaller.patches
    assert placed.mesh is not None
    assert placed.mesh.tolist() == [[[-0.5, -0.5], [249.5, -0.5]], [[-0.5, 499.5], [249.5, 499.5]]]
    assert (placed.scale, smaller.pairs[0].residual_px) == (0.5, 0.125)
    assert missing == patches[1]
    assert reduce_mosaic(mosaic, Encoding()) is mosaic

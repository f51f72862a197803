"""Where values between nodes become negative, tile by tile."""

import numpy as np
import pytest

from services.imaging.node_grid import (
    GRID_STEP_PX,
    between_nodes,
    negative_tiles,
    node_grid,
    positive_between,
)


@pytest.mark.parametrize("radius", [0.0, 150.0, 330.0, 2000.0])
def test_tiles_tell_what_values_at_all_pixels_do(radius: float) -> None:
    width, height = 700, 530
    nodes, shape = node_grid(0, 0, width, height)
    inside = (radius - np.linalg.norm(nodes - [300, 260], axis=1)).reshape(shape)
    dense = between_nodes(inside.astype(np.float32), width, height) >= 0
    assert np.array_equal(positive_between(inside[..., None], width, height), dense)
    right = (400.25 - nodes[:, 0]).reshape(shape)
    both = positive_between(np.dstack([inside, right]), width, height)
    assert np.array_equal(both, dense & (np.arange(width) <= 400))


def test_tiles_without_a_border_need_no_values() -> None:
    nodes = np.full((40, 40), -1.0, np.float32)
    assert all(where is None for _, where in negative_tiles(nodes, 38 * GRID_STEP_PX, 38 * GRID_STEP_PX))
    assert not list(negative_tiles(-nodes, 38 * GRID_STEP_PX, 38 * GRID_STEP_PX))

"""Errors of views that are made wrong by a known amount."""

import numpy as np
import pytest

from benchmarks.common.sheet_errors import measure_sheet
from simulation.camera import Camera, Pose
from simulation.flat_page import Page
from simulation.folded import folded_in_thirds
from simulation.truth import Truth

PAGE = Page(np.full((280, 200), 255, np.uint8))
POSE = Pose(0.3, 0.9, 0.1, (0.0, 0.0, 4.5))
TRUTH = Truth(PAGE, folded_in_thirds(1.4, 20, -15), 0.0, POSE, Camera(1200.0, 840, 1080))


def _mesh(low: tuple[float, float], high: tuple[float, float]) -> np.ndarray:
    """A view from page pixel edges `low` to `high`, of one pixel a page pixel: nodes are centres of pixels."""
    x = np.linspace(low[0], high[0] - 1.0, 21)
    y = np.linspace(low[1], high[1] - 1.0, 29)
    return TRUTH.page_to_photo(np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)).reshape(29, 21, 2)


def test_the_true_sheet_has_no_errors() -> None:
    errors = measure_sheet(_mesh((0, 0), (200, 280)), 200, 280, TRUTH)
    assert errors.mesh_median_percent < 1e-6
    assert abs(errors.cut_percent) < 1e-6
    assert errors.cut_worst_percent < 1e-6
    assert errors.area_ratio == pytest.approx(1.0)
    assert abs(errors.aspect_percent) < 1e-6
    # The photo shows the page at about 266 pixels across: 1200 * 2 / 4.5 / 2.
    assert errors.density == pytest.approx(200 / 533, rel=0.08)


@pytest.mark.parametrize("turn", [0, 1, 2, 3])
def test_ground_beside_the_sheet_and_lost_paper_are_told_apart(turn: int) -> None:
    shown = np.rot90(_mesh((0, -4), (200, 280)), turn)
    size = (200, 284) if turn % 2 == 0 else (284, 200)
    errors = measure_sheet(shown, *size, TRUTH)
    assert errors.cut_percent == pytest.approx(-2.0, abs=0.02)
    assert errors.cut_worst_percent == pytest.approx(2.0, abs=0.02)
    assert errors.area_ratio == pytest.approx(284 / 280)
    lost = measure_sheet(_mesh((3, 0), (200, 280)), 197, 280, TRUTH)
    assert lost.cut_percent == pytest.approx(1.5, abs=0.02)


def test_a_view_that_is_too_wide() -> None:
    errors = measure_sheet(_mesh((0, 0), (200, 280)), 210, 280, TRUTH)
    assert errors.aspect_percent == pytest.approx(5.0, abs=0.2)
    assert errors.mesh_median_percent > 0.3


def test_a_sheet_that_is_not_whole_in_the_photo_has_no_cut() -> None:
    close = Truth(PAGE, TRUTH.shape, 0.0, Pose(0.3, 0.9, 0.1, (0.0, 0.0, 2.0)), TRUTH.camera)
    mesh = close.page_to_photo(
        np.stack(np.meshgrid(np.linspace(40, 160, 9), np.linspace(60, 220, 9)), axis=-1).reshape(-1, 2)
    ).reshape(9, 9, 2)
    errors = measure_sheet(mesh, 121, 161, close)
    assert np.isnan(errors.cut_percent)
    assert errors.mesh_median_percent < 1e-6
    beside = measure_sheet(np.full((3, 3, 2), -500.0), 100, 100, TRUTH)
    assert np.isnan(beside.area_ratio)

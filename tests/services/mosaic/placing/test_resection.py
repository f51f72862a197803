"""The camera of a photo, from points in space that it shows."""

import numpy as np
import pytest

from services.geometry.focal_prior import FocalPrior
from services.mosaic.placing.resection import FEWEST, _residuals, resect_camera
from tests.services.sheet.ridged.sheets import CURVED, FLAT, HEIGHT, PIXEL, WIDTH
from tests.services.sheet.ridged.test_views import second_camera

PRIOR = FocalPrior(float(np.log(1.7)), 0.25, "assumed")


def page_points(count: int = 200) -> np.ndarray:
    rng = np.random.default_rng(0)
    return rng.uniform(-0.48, 0.48, (count, 2)) * [WIDTH, HEIGHT]


def test_the_camera_is_found_among_false_matches() -> None:
    true, rng = second_camera(), np.random.default_rng(1)
    X = CURVED.place(page_points())
    seen = true.project(X) + rng.normal(0, 0.1 * PIXEL, (len(X), 2))
    seen[:20] += rng.uniform(-0.1, 0.1, (20, 2))
    found = resect_camera(X, seen, PRIOR)
    assert found is not None
    off = np.linalg.norm(found.project(X) - true.project(X), axis=1)
    assert np.median(off) < 0.05 * PIXEL
    assert np.degrees(np.arccos((np.trace(found.rotation @ true.rotation.T) - 1) / 2)) < 0.3
    assert abs(np.log(found.focal / true.focal)) < 0.02


def test_derivatives_are_those_of_the_residuals() -> None:
    camera, X = second_camera(), CURVED.place(page_points(20))
    change = np.array([0.02, -0.03, 0.01, 0.1, 0.05, -0.08, np.log(camera.focal) + 0.1])
    residuals, derivatives = _residuals(camera, X, camera.project(X), PRIOR, PIXEL)
    steps = 1e-6 * np.eye(len(change))
    expected = [(residuals(change + step) - residuals(change - step)) / 2e-6 for step in steps]
    found = derivatives(change)
    assert found == pytest.approx(np.stack(expected, axis=1), abs=2e-3 * np.abs(found).max())


def test_a_wrong_sheet_leaves_what_no_camera_explains() -> None:
    true = second_camera()
    seen = true.project(CURVED.place(page_points()))
    found = resect_camera(FLAT.place(page_points()), seen, PRIOR)
    assert found is not None
    off = np.linalg.norm(found.project(FLAT.place(page_points())) - seen, axis=1)
    assert np.median(off) > 10 * PIXEL


def test_few_points_show_no_camera() -> None:
    X = CURVED.place(page_points(FEWEST + 1))
    seen = second_camera().project(X)
    assert resect_camera(X, seen, PRIOR) is not None
    X[:2] = np.nan
    assert resect_camera(X, seen, PRIOR) is None

"""Photos that are parts of one photo differ by similarities, and no others do."""

import numpy as np
import pytest

from services.arrays import Homography, Points
from services.geometry.homographies import transform_points, translation
from services.mosaic.flat_photo import FlatPhoto
from services.mosaic.placing.similarities import fit_similarities
from services.mosaic.registration.pair_registration import PairRegistration
from tests.services.mosaic.cuttings import place
from tests.services.mosaic.views import look_at

SIZE = (900, 700)
LOWER = 400
"""Rows from the first photo to the second."""
NOISE_PX = 0.05
OVERLAP = (20.0, 420.0, 880.0, 680.0)
"""Columns and rows of the first photo whose points the second shows too."""


def photo(index: int) -> FlatPhoto:
    return place(np.zeros((SIZE[1], SIZE[0], 3), np.uint8), np.eye(3), index).flat


def pair(
    H_b_a: Homography, box: tuple[float, float, float, float] = OVERLAP, a: int = 0, b: int = 1
) -> PairRegistration:
    """Matches in a `box` of photo a, a few hundredths of a pixel off."""
    random = np.random.default_rng(a + 10 * b)
    on_a: Points = random.uniform(box[:2], box[2:], (150, 2))
    on_b = transform_points(H_b_a, on_a) + random.normal(0, NOISE_PX, on_a.shape)
    return PairRegistration(a, b, np.linalg.inv(H_b_a), on_a, on_b, np.ones(len(on_a)), 300, 150, 9, 1.0)


def turned(angle_deg: float, scale: float, x: float, y: float) -> Homography:
    c, s = scale * np.cos(np.radians(angle_deg)), scale * np.sin(np.radians(angle_deg))
    return np.array([[c, -s, x], [s, c, y], [0.0, 0.0, 1.0]])


def test_crops_are_laid_in_the_pixels_of_the_finest() -> None:
    H_b_a = turned(7.0, 0.8, 30.0, -300.0)
    found = fit_similarities({0: photo(0), 1: photo(1)}, [pair(H_b_a)])
    assert found is not None
    assert np.hypot(*found[0][:2, 0]) == pytest.approx(1.0)
    apart = np.linalg.inv(found[1]) @ found[0] - H_b_a
    assert np.abs(apart[:2, :2]).max() < 2e-4
    assert np.abs(apart[:2, 2]).max() < 0.1
    assert np.array_equal(found[0][2], [0.0, 0.0, 1.0])


def test_wrong_matches_do_not_matter() -> None:
    known = pair(translation(0, -LOWER))
    known.points_b[:10] += 40.0
    found = fit_similarities({0: photo(0), 1: photo(1)}, [known])
    assert found is not None
    assert np.abs(np.linalg.inv(found[1]) @ found[0] - translation(0, -LOWER)).max() < 0.1


def test_a_camera_that_leaned_by_two_degrees_took_another_photo() -> None:
    seen = [look_at((500.0, row), tilt, 60.0, 0.9, *SIZE) for row, tilt in ((400.0, 10.0), (850.0, 12.0))]
    H_b_a = seen[1] @ np.linalg.inv(seen[0])
    assert fit_similarities({0: photo(0), 1: photo(1)}, [pair(H_b_a)]) is None


def test_an_overlap_that_shows_no_perspective_is_not_believed_alone() -> None:
    corner = (20.0, 640.0, 60.0, 680.0)
    photos = {k: photo(k) for k in range(3)}
    shift = translation(0, -LOWER)
    assert fit_similarities({k: photos[k] for k in (0, 1)}, [pair(shift, corner)]) is None
    # It does not speak against what others show either.
    others = [pair(translation(-300, -LOWER), a=0, b=2), pair(translation(-300, 0), a=1, b=2)]
    assert fit_similarities(photos, [pair(shift, corner), *others]) is not None


def test_few_matches_show_nothing() -> None:
    few = pair(translation(0, -LOWER))
    few = PairRegistration(0, 1, few.H_a_b, few.points_a[:8], few.points_b[:8], few.weights[:8], 8, 8, 1, 1.0)
    assert fit_similarities({0: photo(0), 1: photo(1)}, [few]) is None

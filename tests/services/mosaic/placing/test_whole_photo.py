"""Parts of one photo share its page; other photos of a page do not."""

from collections.abc import Sequence

import numpy as np
import pytest

from services.arrays import Homography, RgbImage
from services.contract.mosaic import MosaicParameters
from services.geometry.homographies import translation
from services.mosaic import pipeline
from services.mosaic.flat_photo import FlatPhoto
from services.mosaic.flattening import flatten_photo
from services.mosaic.pipeline import mosaic
from services.mosaic.placing import whole_photo
from services.mosaic.placing.whole_photo import find_whole_photo
from services.mosaic.registration.photo_pairs import register_photos
from services.mosaic.results import MosaicResult
from services.rectify.stage_clock import StageClock
from tests.services.mosaic.test_pipeline import laid_points
from tests.services.mosaic.views import look_at, page_image, photograph

pytestmark = pytest.mark.pipeline

WIDTH, HEIGHT = 900, 1400
CAMERA = look_at((500.0, 780.0), 24.0, 65.0, 0.8, WIDTH, HEIGHT)
WHOLE = photograph(page_image(), CAMERA, WIDTH, HEIGHT)
LOWER = 560
PARTS = (WHOLE[:840], WHOLE[LOWER:])
CAMERAS = (CAMERA, np.asarray(translation(0, -LOWER) @ CAMERA))
AS_LAID = MosaicParameters(upright=False)


def of_page(result: MosaicResult, cameras: Sequence[Homography], photos: Sequence[RgbImage]) -> float:
    """Largest distance of a page's points that two photos show by the meshes of both, mosaic pixels."""
    laid = []
    for patch, H, photo in zip(result.patches, cameras, photos, strict=True):
        only = MosaicResult(result.image, 0, (patch,), (), (), result.orientation)
        on_mosaic, page = laid_points(only, [H], (photo.shape[1], photo.shape[0]))
        laid.append({tuple(at): place for at, place in zip(page.tolist(), on_mosaic, strict=True)})
    both = set(laid[0]) & set(laid[1])
    assert len(both) > 50
    return max(float(np.linalg.norm(laid[0][at] - laid[1][at])) for at in both)


@pytest.fixture(scope="module")
def flats() -> dict[int, FlatPhoto]:
    """The parts, and the photo, in flat views of their own."""
    photos = (*PARTS, WHOLE)
    return {index: flatten_photo(index, photo, None, StageClock()) for index, photo in enumerate(photos)}


def test_crops_of_a_photo_lie_on_the_page_that_it_shows(
    flats: dict[int, FlatPhoto], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pipeline, "flatten_photo", lambda index, *_: flats[index])
    result = mosaic(PARTS, AS_LAID)
    assert result.surface is None
    assert not result.warnings
    assert of_page(result, CAMERAS, PARTS) < 0.1


def test_the_page_is_that_of_a_photo_that_shows_all(
    flats: dict[int, FlatPhoto], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(whole_photo, "paste_photos", None)
    some = {index: flats[index] for index in (1, 2)}
    found = find_whole_photo(some, register_photos(list(some.values())), None, StageClock())
    assert found is not None
    assert found.photos[1].page is found.photos[2].page is flats[2].page
    # The part's view is no larger than its part of the page.
    assert found.photos[1].frame.height < 0.8 * found.photos[2].frame.height


def test_parts_that_do_not_connect_by_their_views_are_compared_as_they_are(
    flats: dict[int, FlatPhoto],
) -> None:
    found = find_whole_photo({index: flats[index] for index in (0, 1)}, (), None, StageClock())
    assert found is not None
    assert [(pair.a, pair.b) for pair in found.pairs] == [(0, 1)]
    assert len(found.pairs[0].points_a) > 50


def test_the_views_decide_where_photos_as_they_are_connect_no_more(
    flats: dict[int, FlatPhoto], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(whole_photo, "register_photos", lambda *_: ())
    assert find_whole_photo({index: flats[index] for index in (0, 1)}, (), None, StageClock()) is None

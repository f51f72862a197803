"""Photos in, the page out."""

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import pytest
from scipy.interpolate import RectBivariateSpline

from services.arrays import Homography, Points, RgbImage
from services.contract.mosaic import MosaicParameters
from services.errors import InvalidOption, NoText, NotOverlapping
from services.geometry.homographies import translation
from services.mosaic import pipeline
from services.mosaic.flat_photo import FlatPhoto
from services.mosaic.flattening import flatten_photo
from services.mosaic.pipeline import mosaic
from services.mosaic.registration import photo_pairs
from services.mosaic.registration.pair_registration import PairRegistration
from services.mosaic.registration.photo_pairs import PairCandidate
from services.mosaic.results import MosaicResult
from services.progress import progress_to
from services.rectify.stage_clock import StageClock
from tests.counts import some
from tests.services.mosaic.views import look_at, page_image, photograph

pytestmark = pytest.mark.pipeline

AS_LAID = MosaicParameters(upright=False)
SCANS = MosaicParameters(upright=False, rectify=False)
SIZE = (820, 900)
"""Of the photos."""
CAMERAS: tuple[Homography, ...] = (
    look_at((400.0, 430.0), 15.0, 30.0, 0.95, *SIZE),
    look_at((600.0, 780.0), 20.0, 200.0, 0.9, *SIZE),
    look_at((480.0, 1120.0), 12.0, 110.0, 0.85, *SIZE),
)
"""Three photos down the page, each overlapping the next by more than a third."""


@cache
def photo(number: int, page: int = 0) -> RgbImage:
    return photograph(page_image(page), CAMERAS[number], *SIZE)


def photos() -> list[RgbImage]:
    """Copies, which a test may draw on."""
    return [photo(number).copy() for number in range(len(CAMERAS))]


def other_page() -> RgbImage:
    return photo(1, page=1)


def on_mosaic(mesh: Points, photo_points: Points, size: tuple[int, int]) -> Points:
    """Mosaic points (N, 2) of photo pixels (N, 2), by the mesh alone."""
    rows, columns = mesh.shape[:2]
    x, y = np.linspace(0, size[0] - 1, columns), np.linspace(0, size[1] - 1, rows)
    splines = [RectBivariateSpline(y, x, mesh[..., k]) for k in (0, 1)]
    return np.stack([spline.ev(photo_points[:, 1], photo_points[:, 0]) for spline in splines], axis=1)


def seen_points(H_photo_page: Homography, size: tuple[int, int] = SIZE) -> tuple[Points, Points]:
    """Page points that a photo shows, and where: (N, 2) each."""
    page = np.stack(np.meshgrid(np.linspace(60, 940, 23), np.linspace(60, 1500, 37)), axis=-1).reshape(-1, 2)
    seen = cv2.perspectiveTransform(page[None], H_photo_page)[0]
    inside = (seen > 5).all(axis=1) & (seen < np.array(size) - 6).all(axis=1)
    return page[inside], seen[inside]


def laid_points(
    result: MosaicResult, cameras: Sequence[Homography], size: tuple[int, int] = SIZE
) -> tuple[Points, Points]:
    """Mosaic points by the meshes, and the page points that belong there, (N, 2) each, over all photos."""
    page, laid = [], []
    for patch, H in zip(result.patches, cameras, strict=True):
        assert patch.mesh is not None
        shown, seen = seen_points(H, size)
        page.append(shown)
        laid.append(on_mosaic(patch.mesh, seen, size))
    return np.concatenate(laid), np.concatenate(page)


def registration_error_px(
    result: MosaicResult, cameras: Sequence[Homography], size: tuple[int, int] = SIZE
) -> float:
    """RMS distance in page pixels after the best homography mosaic -> page."""
    laid, page = laid_points(result, cameras, size)
    fitted, _ = cv2.findHomography(laid, page)
    apart = cv2.perspectiveTransform(laid[None], fitted)[0] - page
    return float(np.sqrt((apart**2).sum(axis=1).mean()))


def frontal_error_px(result: MosaicResult, cameras: Sequence[Homography]) -> float:
    """The same after the best similarity: a frontal page needs no more."""
    laid, page = (points @ [1, 1j] for points in laid_points(result, cameras))
    laid, page = laid - laid.mean(), page - page.mean()
    ratio = np.vdot(laid, page) / np.vdot(laid, laid)
    return float(np.sqrt(np.mean(np.abs(page - ratio * laid) ** 2)))


@pytest.fixture(scope="module", autouse=True)
def _flatten_each_photo_once() -> Iterator[None]:
    """A photo's flat view depends on the photo alone, and takes a third of the time of a mosaic."""
    known: dict[bytes, FlatPhoto] = {}

    def flatten(
        index: int, photo: RgbImage, focal_length_px: float | None, clock: StageClock, memory: None
    ) -> FlatPhoto:
        assert memory is None, "no test of this module names a camera"
        key = hashlib.sha256(photo.tobytes() + repr((photo.shape, focal_length_px)).encode()).digest()
        if key not in known:
            known[key] = flatten_photo(index, photo, focal_length_px, clock)
        return replace(known[key], index=index)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pipeline, "flatten_photo", flatten)
        yield


@pytest.fixture(scope="module", autouse=True)
def _register_each_pair_once() -> Iterator[None]:
    """Two flat views in one order of upload are registered once; that this order plays no part is a test of pairs."""
    known: dict[tuple[object, ...], PairRegistration | None] = {}
    register = photo_pairs._register

    def register_once(candidate: PairCandidate) -> PairRegistration | None:
        a, b = candidate.a, candidate.b
        first, second = a.photo.index, b.photo.index
        key = (a.key, b.key, candidate.turns, candidate.features[0].reduction, first < second)
        if key not in known:
            known[key] = register(candidate)
        found = known[key]
        if found is None:
            return None
        return replace(found, a=min(first, second), b=max(first, second))

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(photo_pairs, "_register", register_once)
        yield


@pytest.fixture(scope="module")
def reports() -> list[tuple[str, float]]:
    """What `three` tells of its progress."""
    return []


@pytest.fixture(scope="module")
def three(reports: list[tuple[str, float]]) -> MosaicResult:
    with progress_to(lambda *report: reports.append(report)):
        return mosaic(photos(), AS_LAID)


@pytest.mark.usefixtures("three")
def test_its_stages_are_told_as_they_begin(reports: list[tuple[str, float]]) -> None:
    assert [stage for stage, _ in reports] == [
        "flattening", "flattening", "flattening", "registration", "adjustment", "illumination", "composition",
    ]  # fmt: skip
    fractions = [fraction for _, fraction in reports]
    assert fractions == sorted(set(fractions))
    assert fractions[0] == 0.0 < fractions[-1] < 1.0


def test_three_photos_become_the_page(three: MosaicResult) -> None:
    assert three.unplaced == ()
    assert all(patch.placed for patch in three.patches)
    assert registration_error_px(three, CAMERAS) < 0.3
    assert frontal_error_px(three, CAMERAS) < 4.0
    assert {"text", "registration", "adjustment", "illumination", "composition"} <= set(three.timings_ms)


def test_pairs_carry_their_evidence(three: MosaicResult) -> None:
    found = {(pair.a, pair.b): pair for pair in three.pairs}
    assert {(0, 1), (1, 2)} <= set(found)
    for pair in found.values():
        assert pair.a < pair.b
        assert pair.runner_up_votes < pair.votes <= pair.matches
        assert 0.0 < pair.overlap_fraction <= 1.0
        assert pair.residual_px < 0.5
    assert found[(0, 1)].overlap_fraction > found.get((0, 2), found[(0, 1)]).overlap_fraction - 1e-9


def test_the_page_is_white_and_its_ink_is_dark(three: MosaicResult) -> None:
    height, width = three.image.shape[:2]
    middle = three.image[height // 10 : -height // 10, width // 5 : -width // 5]
    assert np.percentile(middle, 60) > 250
    assert np.percentile(middle, 2) < 60


def test_scale_and_sharpness_of_every_patch(three: MosaicResult) -> None:
    scales = [patch.scale for patch in three.patches]
    assert all(scale is not None and 0.8 < scale < 1.6 for scale in scales)
    assert max(patch.sharpness or 0.0 for patch in three.patches) == 1.0


def test_a_fingertip_on_one_photo_is_told_and_not_on_the_page(three: MosaicResult) -> None:
    taken = photos()
    x, y = cv2.perspectiveTransform(np.array([[[550.0, 700.0]]]), CAMERAS[0])[0, 0]
    cv2.circle(taken[0], (round(x), round(y)), 45, (196, 120, 90), -1)
    found = mosaic(taken, AS_LAID)
    covered = [patch.covered_fraction or 0.0 for patch in found.patches]
    assert 0.004 < covered[0] < 0.02
    assert covered[1:] == [0.0, 0.0]
    red = found.image.astype(int)[..., 0] - found.image[..., 2]
    assert (red > 60).mean() < 1e-4
    assert [patch.covered_fraction for patch in three.patches] == [0.0, 0.0, 0.0]


def assert_same_page(one: MosaicResult, other: MosaicResult, order: Sequence[int]) -> None:
    """Photo k of `other` is photo order.index(k) of `one`."""
    assert one.image.shape == other.image.shape
    for patch, k in zip(one.patches, order, strict=True):
        expected = other.patches[k].mesh
        assert patch.mesh is not None
        assert expected is not None
        assert np.abs(patch.mesh - expected).max() < 0.05
    difference = np.abs(one.image.astype(np.int16) - other.image)
    assert (difference > 40).mean() < 1e-3


@pytest.mark.long
@pytest.mark.parametrize(("order", "base"), some(1, [((2, 0, 1), 2), ((2, 0, 1), None), ((0, 1, 2), 2)]))
def test_order_of_upload_and_base_do_not_change_the_page(
    three: MosaicResult, order: tuple[int, ...], base: int | None
) -> None:
    result = mosaic([photos()[k] for k in order], MosaicParameters(upright=False, base=base))
    assert base is None or result.base == base
    assert_same_page(result, three, order)


@pytest.fixture(scope="module")
def mixed() -> MosaicResult:
    """A blank photo and one of another page among those of the page."""
    first, second, third = photos()
    blank = np.full((900, 820, 3), 225, np.uint8)
    return mosaic([first, blank, second, third, other_page()], AS_LAID)


def test_photos_that_do_not_belong_are_named(three: MosaicResult, mixed: MosaicResult) -> None:
    assert mixed.unplaced == (1, 4)
    assert mixed.patches[1].mesh is None
    for index in mixed.unplaced:
        assert any(
            notice.code == "unplaced" and f"images[{index}]" in notice.detail for notice in mixed.warnings
        )
    assert mixed.image.shape == three.image.shape


def test_a_photo_from_the_other_side_of_the_table_is_turned() -> None:
    turned = photos()[:2]
    turned[1] = np.ascontiguousarray(turned[1][::-1, ::-1])
    result = mosaic(turned, AS_LAID)
    assert result.unplaced == ()
    half_turn = np.array([[-1.0, 0.0, SIZE[0] - 1], [0.0, -1.0, SIZE[1] - 1], [0.0, 0.0, 1.0]])
    assert registration_error_px(result, [CAMERAS[0], half_turn @ CAMERAS[1]]) < 0.3


def test_scans_are_joined_as_they_are() -> None:
    cuts = [translation(0.0, 0.0), translation(-20.0, -500.0)]
    scans = [photograph(page_image(), H, 950, 800) for H in cuts]
    result = mosaic(scans, SCANS)
    assert registration_error_px(result, cuts, (950, 800)) < 0.1
    assert result.image.shape[0] > 1200
    for patch in result.patches:
        assert patch.scale == pytest.approx(1.0, abs=0.01)


def test_the_same_photo_twice_is_one_page() -> None:
    result = mosaic([photos()[0]] * 2, AS_LAID)
    assert result.unplaced == ()
    assert registration_error_px(result, [CAMERAS[0]] * 2) < 0.1


def test_photos_that_are_repeated_are_told_and_left_out(three: MosaicResult) -> None:
    first, second, third = photos()
    encoded = cv2.imdecode(cv2.imencode(".jpg", second, [cv2.IMWRITE_JPEG_QUALITY, 50])[1], cv2.IMREAD_COLOR)
    result = mosaic([first, second, first, np.asarray(encoded, np.uint8), third], AS_LAID)
    assert [patch.placed for patch in result.patches] == [True, True, False, False, True]
    assert result.unplaced == (2, 3)
    told = [notice.detail for notice in result.warnings if notice.code == "duplicate-photo"]
    assert [detail[:27] for detail in told] == ["images[2] repeats images[0]", "images[3] repeats images[1]"]
    assert not [notice for notice in result.warnings if notice.code == "unplaced"]
    assert result.image.shape == three.image.shape


def test_a_base_is_no_duplicate() -> None:
    first, second, _ = photos()
    result = mosaic([first, second, first], replace(AS_LAID, base=2))
    assert (result.base, result.unplaced) == (2, (0,))


def test_the_same_photo_many_times_takes_no_longer_than_twice(monkeypatch: pytest.MonkeyPatch) -> None:
    flattened: list[int] = []
    flatten = vars(pipeline)["flatten_photo"]

    def count(index: int, *arguments: object) -> FlatPhoto:
        flattened.append(index)
        return flatten(index, *arguments)

    monkeypatch.setattr(pipeline, "flatten_photo", count)
    result = mosaic([photos()[1]] * 16, AS_LAID)
    assert flattened == [0, 1]
    assert result.unplaced == tuple(range(2, 16))
    assert [notice.code for notice in result.warnings].count("duplicate-photo") == 15


def test_photos_of_two_pages_do_not_become_one() -> None:
    with pytest.raises(NotOverlapping, match=r"no two of images\[0\], images\[1\] show"):
        mosaic([photos()[0], other_page()], AS_LAID)


def test_a_base_beside_the_page_is_a_problem() -> None:
    with pytest.raises(NotOverlapping, match=r"images\[2\]"):
        mosaic([*photos()[:2], other_page()], MosaicParameters(upright=False, base=2))


def test_blank_photos_are_named() -> None:
    blank = np.full((300, 400, 3), 225, np.uint8)
    with pytest.raises(NoText, match=r"images\[0\].*images\[1\]"):
        mosaic([blank, blank], AS_LAID)


@pytest.mark.parametrize("count", [1, 17])
def test_too_few_and_too_many_photos(count: int) -> None:
    with pytest.raises(InvalidOption, match="images: expected 2 to 16") as caught:
        mosaic([np.zeros((8, 8, 3), np.uint8)] * count, AS_LAID)
    assert caught.value.field == "images"


def test_a_base_that_does_not_exist() -> None:
    with pytest.raises(InvalidOption, match="base") as caught:
        mosaic(photos(), MosaicParameters(base=3))
    assert caught.value.field == "base"


def screenshots(*boxes: tuple[int, int, int, int]) -> list[RgbImage]:
    """Parts (left, top, right, bottom) of a page in dark mode, with a bar of one colour at the top of each."""
    page = 255 - page_image()
    parts = [np.array(page[top:bottom, left:right]) for left, top, right, bottom in boxes]
    for part in parts[1:]:
        part[:14] = (40, 60, 90)
    return parts


def test_screenshots_some_whole_pixels_apart_keep_their_pixels() -> None:
    boxes = ((0, 0, 780, 640), (0, 405, 780, 1045), (0, 811, 780, 1451))
    shots = screenshots(*boxes)
    found = mosaic(shots, SCANS)
    assert found.unplaced == ()
    expected = 255 - page_image()[:1451, :780]
    assert np.array_equal(found.image, expected)
    for patch, (left, top, right, bottom) in zip(found.patches, boxes, strict=True):
        assert patch.mesh is not None
        assert patch.mesh[0, 0] == pytest.approx((left, top), abs=1e-6)
        assert patch.mesh[-1, -1] == pytest.approx((right - 1, bottom - 1), abs=1e-6)
        assert (patch.scale, patch.sharpness) == pytest.approx((1.0, 1.0))


def test_scans_that_are_parts_of_a_pixel_apart_are_not_joined_as_they_are() -> None:
    page = page_image()
    moved = cv2.warpAffine(
        page, np.array([[1.0, 0.0, 0.4], [0.0, 1.0, -405.4]]), (780, 640), flags=cv2.INTER_CUBIC
    )
    found = mosaic([np.array(page[:640, :780]), np.asarray(moved, np.uint8)], SCANS)
    assert found.unplaced == ()
    assert all(patch.mesh is not None for patch in found.patches)
    assert not np.array_equal(found.image[:640, :780], page[:640, :780])

"""Sets of photos of one page: each with its truth, together all of the page, overlapping by what was asked."""

import functools
import itertools
from collections.abc import Iterator

import cv2
import numpy as np
import pytest

from simulation.flat_page import Page
from simulation.letter_pages import letter_pages
from simulation.mosaic_sets import (
    GENTLE_CURVE,
    GRIDS,
    OVERLAPS,
    PHOTO_SIZES,
    MosaicSet,
    neighbours,
    photograph_set,
    printed_box,
)
from simulation.surfaces import Plane

pytestmark = pytest.mark.pipeline


@pytest.fixture(autouse=True, scope="module")
def _small_photos() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        for count, (width, height) in PHOTO_SIZES.items():
            patch.setitem(PHOTO_SIZES, count, (width // 4, height // 4))
        yield
        _set.cache_clear()


@pytest.fixture(scope="module")
def page() -> Page:
    return letter_pages(638, 825)[0]


@functools.cache
def _set(page: Page, count: int, overlap: float, seed: int = 3, **options: object) -> MosaicSet:
    return _set_anew(page, count, overlap, seed, **options)


def _set_anew(page: Page, count: int, overlap: float, seed: int = 3, **options: object) -> MosaicSet:
    return photograph_set(page, count, overlap, np.random.default_rng(seed), **options)  # type: ignore[arg-type]


@pytest.mark.parametrize(("count", "overlap"), [*((2, overlap) for overlap in OVERLAPS), (4, OVERLAPS[-1])])
def test_neighbours_overlap_by_the_wanted_share(page: Page, count: int, overlap: float) -> None:
    made = _set(page, count, overlap)
    assert made.mean_overlap == pytest.approx(overlap, rel=0.1)
    # The same share of area by filled outlines of what each photo shows of the page.
    size = np.array([page.width, page.height])
    shown = []
    for photo in made.photos:
        width, height = photo.image.shape[1], photo.image.shape[0]
        corners = np.array([[0, 0], [width, 0], [width, height], [0, height]]) - 0.5
        mask = np.zeros(size[::-1], np.uint8)
        cv2.fillPoly(mask, [np.round(photo.truth.photo_to_page(corners)).astype(np.int32)], 1)
        shown.append(mask > 0)
    shares = [
        (shown[a] & shown[b]).sum() / min(shown[a].sum(), shown[b].sum()) for a, b in neighbours(made.cells)
    ]
    assert len(shares) == {2: 1, 4: 4}[count]
    assert np.mean(shares) == pytest.approx(made.mean_overlap, abs=0.01)
    x0, y0, x1, y1 = map(int, printed_box(page))
    assert np.any(shown, axis=0)[y0:y1, x0:x1].mean() > 0.99


@pytest.mark.parametrize(("count", "pairs"), [(2, 1), (4, 4), (8, 10)])
def test_cells_side_by_side_are_neighbours(count: int, pairs: int) -> None:
    rows, columns = GRIDS[count]
    cells = tuple((row, column) for row in range(rows) for column in range(columns))
    assert len(cells) == count
    assert len(neighbours(cells)) == pairs


def test_photos_hang_together_by_print_that_they_share(page: Page) -> None:
    y, x = np.nonzero(page.image < 128)
    ink = np.stack([x, y], axis=1)[::50].astype(float)
    seen = []
    for photo in _set(page, 4, 0.2).photos:
        there = photo.truth.page_to_photo(ink)
        with np.errstate(invalid="ignore"):
            seen.append(np.all((there > -0.5) & (there < np.array(photo.image.shape[1::-1]) - 0.5), axis=1))
    reached = {0}
    for _ in seen:
        for one, other in itertools.permutations(range(4), 2):
            if one in reached and _ink_share(seen[one], seen[other]) >= 0.03:
                reached.add(other)
    assert len(reached) == 4


def test_bare_paper_in_common_does_not_hold_a_set_together(
    page: Page, monkeypatch: pytest.MonkeyPatch
) -> None:
    image = page.image.copy()
    image[page.height * 3 // 10 : page.height * 7 // 10] = 255
    monkeypatch.setattr("simulation.mosaic_sets._LEVELS", 1)
    with pytest.raises(ValueError, match="no poses"):
        _set_anew(Page(image), 2, 0.1)
    assert _set_anew(page, 2, 0.1).mean_overlap == pytest.approx(0.1, rel=0.1)


def _ink_share(one: np.ndarray, other: np.ndarray) -> float:
    return float((one & other).sum() / max(min(one.sum(), other.sum()), 1))


@pytest.mark.parametrize("shape", [Plane(), GENTLE_CURVE])
def test_truth_forwards_and_backwards(page: Page, shape: Plane) -> None:
    rng = np.random.default_rng(8)
    for photo in _set(page, 4, 0.2, shape=shape).photos:
        height, width = photo.image.shape[:2]
        points = rng.random((200, 2)) * [width - 1, height - 1]
        on_page = points[photo.truth.on_page(points)]
        assert len(on_page) > 50
        back = photo.truth.page_to_photo(photo.truth.photo_to_page(on_page))
        assert np.abs(back - on_page).max() < 1e-6


def test_a_flat_photo_is_the_page_through_its_homography(page: Page) -> None:
    made = _set(page, 4, 0.2)
    for photo in made.photos:
        height, width = photo.image.shape[:2]
        flat = cv2.warpPerspective(
            photo.image,
            np.linalg.inv(photo.truth.H_photo_page()),
            (page.width, page.height),
            borderValue=(1, 1, 1),
        ).mean(axis=2)
        seen = cv2.warpPerspective(
            np.ones((height, width), np.uint8),
            np.linalg.inv(photo.truth.H_photo_page()),
            (page.width, page.height),
        )
        seen = cv2.erode(seen, np.ones((15, 15), np.uint8)) > 0
        # Light is taken out by comparing what is darker than its surroundings.
        local = flat - cv2.GaussianBlur(flat, (0, 0), 12)
        soft = cv2.GaussianBlur(page.image.astype(np.float32), (0, 0), 1.0)
        expected = soft - cv2.GaussianBlur(soft, (0, 0), 12)
        assert np.corrcoef(local[seen], expected[seen])[0, 1] > 0.85


def test_the_same_seed_gives_the_same_photos(page: Page) -> None:
    one, again = (_set_anew(page, 2, 0.2) for _ in range(2))
    other = _set_anew(page, 2, 0.2, seed=4)
    assert all(np.array_equal(a, b) for a, b in zip(one.images, again.images, strict=True))
    assert not any(np.array_equal(a, b) for a, b in zip(one.images, other.images, strict=True))
    assert (one.overlaps, one.cells) == (again.overlaps, again.cells)


def test_as_many_are_upside_down_as_asked_for(page: Page) -> None:
    for turned in (0, 2):
        upward = []
        for photo in _set(page, 4, 0.2, turned=turned).photos:
            height, width = photo.image.shape[:2]
            middle = photo.truth.photo_to_page(np.array([[(width - 1) / 2, (height - 1) / 2]]))
            below = photo.truth.page_to_photo(middle + np.array([0.0, 10.0]))
            upward.append(below[0, 1] < (height - 1) / 2)
        assert sum(upward) == turned


def test_poses_and_sizes_stay_within_their_bounds(page: Page) -> None:
    widths = []
    for seed in range(3):
        for photo in _set(page, 4, 0.4, seed).photos:
            pose = photo.truth.pose
            assert np.radians(2) < pose.tilt_rad <= np.radians(35)
            assert abs(pose.roll_rad) <= np.radians(15)
            widths.append(photo.image.shape[1])
    assert max(widths) / min(widths) <= 1.51
    assert max(widths) / min(widths) > 1.15


def test_what_cannot_be_is_refused(page: Page) -> None:
    for count, overlap in ((3, 0.2), (4, 0.9)):
        with pytest.raises(ValueError, match="2, 4 or 8"):
            _set(page, count, overlap)


def test_letter_pages_never_repeat_themselves() -> None:
    for sheet in letter_pages(638, 825):
        lines = [" ".join(word.text for word in line) for line in sheet.lines]
        assert len(lines) > 20
        assert len(set(lines)) == len(lines)
    assert sheet.image.ndim == 3
    spread = sheet.image.max(axis=2).astype(int) - sheet.image.min(axis=2)
    assert (spread > 40).mean() > 0.02

"""Print in cells of the page by kernels beside their plain versions: the same bits."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.imaging.print_counts import count_ink, count_ink_plain, mark_print, mark_print_plain
from services.kernels.library import find_kernels
from services.mosaic.composition.patch_drawing import Rectangle
from services.mosaic.composition.related_cells import (
    masked_means,
    masked_means_plain,
    masked_medians,
    masked_medians_plain,
    raise_strength,
    raise_strength_plain,
    relate_cells,
    relate_cells_plain,
    remove_noise,
)
from services.mosaic.composition.sharpness import PatchMaps
from services.mosaic.composition.word_counts import (
    count_votes,
    count_votes_plain,
    take_words,
    take_words_plain,
)
from services.mosaic.light.canvas import BLOCK_PX, Canvas, CanvasView
from services.mosaic.light.canvas_sums import CanvasSums, compare_cells, compare_cells_plain

pytestmark = pytest.mark.skipif(find_kernels() is None, reason="needs kernels, which a C compiler makes")
SIDES, SEEDS = st.integers(1, 70), st.integers(0, 2**32 - 1)


@given(SIDES, SIDES, SEEDS)
def test_cells_relative_to_paper(rows: int, columns: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    gray = rng.integers(0, 256, (rows, columns), np.uint8)
    energy = rng.exponential(20.0, (rows, columns, 2)).astype(np.float32)
    shown = rng.random((rows, columns)) > 0.3
    weight = np.maximum(rng.normal(0.5, 0.4, (rows, columns)), 0).astype(np.float32)
    light = (weight * rng.uniform(0, 255, (rows, columns))).astype(np.float32)
    found = relate_cells(gray, energy, shown, light, weight, 0.95)
    plain = relate_cells_plain(gray, energy, shown, light, weight, 0.95)
    for name in ("darkness", "slope", "energy", "bare"):
        assert np.array_equal(getattr(found, name), getattr(plain, name)), name
    noise = np.array([0.01, 0.3], np.float32)
    quiet = np.maximum(plain.energy - noise, 0)
    remove_noise(found.energy, noise)
    assert np.array_equal(found.energy, quiet)


@given(SIDES, SIDES, SEEDS)
def test_strength(rows: int, columns: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    values = rng.normal(0.3, 0.5, (rows, columns)).astype(np.float32)
    largest = (values + rng.exponential(0.2, (rows, columns))).astype(np.float32)
    strength = rng.integers(0, 200, (rows, columns), np.uint8)
    plain = strength.copy()
    raise_strength(values, largest, 0.1, 0.25, strength)
    raise_strength_plain(values, largest, 0.1, 0.25, plain)
    assert np.array_equal(strength, plain)


@given(SIDES, SIDES, SEEDS, st.sampled_from([0.0, 0.1, 0.9, 1.0]), st.booleans())
def test_medians_and_means(rows: int, columns: int, seed: int, share: float, equal: bool) -> None:
    rng = np.random.default_rng(seed)
    values = rng.exponential(1.0, (rows, columns, 2)).astype(np.float32)
    if equal:
        values = np.round(values * 2) / 2
    mask = rng.random((rows, columns)) < share
    assert np.array_equal(masked_medians(values, mask), masked_medians_plain(values, mask))
    assert np.array_equal(masked_means(values, mask), masked_means_plain(values, mask))


def test_other_cells_are_refused() -> None:
    cells = np.zeros((4, 5), np.float32)
    with pytest.raises(ValueError, match="same cells"):
        masked_medians(np.zeros((4, 5, 2), np.float32), np.zeros((5, 4), bool))
    with pytest.raises(ValueError, match="same cells"):
        relate_cells(
            np.zeros((4, 4), np.uint8), np.zeros((4, 5, 2), np.float32), cells > 0, cells, cells, 0.9
        )
    with pytest.raises(ValueError, match="same cells"):
        raise_strength(cells, cells, 0.1, 0.2, np.zeros((5, 5), np.uint8))


@given(SIDES, SIDES, SEEDS)
def test_ink_is_counted(rows: int, columns: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    image = rng.integers(0, 256, (rows, columns, 3), np.uint8)
    if seed % 2:
        image[..., 1:] = image[..., :1] // 4 * 4
    ground = rng.integers(1, 256, (rows, columns), np.uint8)
    grid = int(rng.integers(1, rows + 1)), int(rng.integers(1, columns + 1))
    marks = mark_print(image[..., 0], ground, 0.8, 0.08)
    for found, plain in zip(marks, mark_print_plain(image[..., 0], ground, 0.8, 0.08), strict=True):
        assert np.array_equal(found, plain)
    found = count_ink(image, ground, marks[0], 0.25, grid, 32)
    assert np.array_equal(found, count_ink_plain(image, ground, marks[0], 0.25, grid, 32))


def test_all_shares_are_those_of_opencv() -> None:
    gray, ground = (np.ascontiguousarray(each) for each in np.indices((256, 255)).astype(np.uint8))
    ground += 1
    for found, plain in zip(
        mark_print(gray, ground, 0.8, 0.08), mark_print_plain(gray, ground, 0.8, 0.08), strict=True
    ):
        assert np.array_equal(found, plain)


@given(st.integers(1, 4), st.integers(1, 4), SEEDS)
def test_light_on_the_canvas(rows: int, columns: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    height, width = BLOCK_PX * rows, BLOCK_PX * columns
    canvas = Canvas(1.0, (0.0, 0.0), width + 2 * BLOCK_PX, height + BLOCK_PX)
    image = rng.uniform(0, 255, (height, width, 3)).astype(np.float32)
    shown = rng.random((height, width)) > 0.2
    feather = np.where(shown, rng.exponential(20, (height, width)), 0).astype(np.float32)
    view = CanvasView(BLOCK_PX, BLOCK_PX, image, shown, feather)
    gain = rng.uniform(0.5, 2, image.shape).astype(np.float32)
    sums, plain = CanvasSums.nothing(canvas), CanvasSums.nothing(canvas)
    for _ in range(2):
        sums.add(view, gain)
        plain.add_plain(view, gain)
    assert np.array_equal(sums.end(), plain.end_plain())
    assert np.array_equal(sums.page, plain.page)
    assert np.array_equal(sums.weight, plain.weight)
    bright = (rng.random(sums.weight.shape) > 0.4).astype(np.float32)
    for found, expected in zip(
        compare_cells(sums.page, bright, view, gain),
        compare_cells_plain(sums.page, bright, view, gain),
        strict=True,
    ):
        assert np.array_equal(found, expected)


def maps_of(rng: np.random.Generator, rows: int, columns: int) -> PatchMaps:
    """A photo that shows a part of the page."""
    left, top = int(rng.integers(columns)), int(rng.integers(rows))
    box = Rectangle(left, top, int(rng.integers(columns - left + 1)), int(rng.integers(rows - top + 1)))
    covered = rng.choice([0, 1, 255], (box.height, box.width)).astype(np.uint8)
    numbers = np.zeros(covered.shape, np.float32)
    return PatchMaps(box, covered, covered, np.dstack([numbers, numbers]), numbers)


@given(SIDES, SIDES, SEEDS)
def test_votes_of_words(rows: int, columns: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    maps = [maps_of(rng, rows, columns) for _ in range(3)]
    words = rng.integers(0, 9, (rows, columns)).astype(np.int32)
    cells = rng.integers(-1, 3, (rows, columns)).astype(np.int16)
    found, plain = count_votes(maps, words, 9, cells), count_votes_plain(maps, words, 9, cells)
    assert np.array_equal(found, plain)
    photos = rng.integers(-1, 3, 9).astype(np.int16)
    whole, todo = rng.random((2, rows, columns)) > 0.5
    taken = [cells.copy(), whole.copy(), todo.copy()]
    take_words(words, photos, *taken)
    take_words_plain(words, photos, cells, whole, todo)
    assert all(map(np.array_equal, taken, (cells, whole, todo)))


def test_words_and_views_beyond_are_refused() -> None:
    words, cells = np.full((3, 4), 2, np.int32), np.zeros((3, 4), np.int16)
    mask = np.zeros((3, 4), bool)
    for wrong in (words, -words):
        with pytest.raises(ValueError, match="numbered"):
            count_votes([], wrong, 2, cells)
        with pytest.raises(ValueError, match="has a photo"):
            take_words(wrong, np.zeros(2, np.int16), cells, mask, mask)
    with pytest.raises(ValueError, match="one of the photos"):
        count_votes([], words, 3, cells)
    view = CanvasView(
        24, 0, np.zeros((24, 24, 3), np.float32), np.ones((24, 24), bool), np.ones((24, 24), np.float32)
    )
    with pytest.raises(ValueError, match="within the canvas"):
        CanvasSums.nothing(Canvas(1.0, (0.0, 0.0), 24, 24)).add(view, view.image)

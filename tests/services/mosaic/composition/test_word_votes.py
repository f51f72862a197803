"""Components decide as a whole, for a photo that shows them whole."""

import cv2
import numpy as np
import pytest

from services.arrays import GrayImage
from services.mosaic.composition.patch_drawing import Rectangle
from services.mosaic.composition.sharpness import PatchMaps
from services.mosaic.composition.word_votes import (
    Decisions,
    Labels,
    decide_cells,
    decide_words,
    fade_weights,
    unite_ink,
)

ROWS, COLUMNS, TEXT_HEIGHT = 80, 160, 7.0


def drawn(*words: tuple[int, int, int, int]) -> GrayImage:
    """Print in boxes (left, top, width, height)."""
    ink = np.zeros((ROWS, COLUMNS), np.uint8)
    for left, top, width, height in words:
        ink[top : top + height, left : left + width] = 255
    return ink


def patch(box: Rectangle, ink: GrayImage, sharpness: float = 0.2) -> PatchMaps:
    """A photo that shows all of `box`, equally sharp everywhere."""
    own = np.ascontiguousarray(ink[box.within(Rectangle(0, 0, COLUMNS, ROWS))])
    covered = np.full(own.shape, 255, np.uint8)
    inset = cv2.distanceTransform(np.pad(np.ones(own.shape, np.uint8), 1), cv2.DIST_L2, 3)[1:-1, 1:-1]
    energy = np.where(own[..., None] > 0, np.full(2, sharpness**2, np.float32), np.float32(0))
    return PatchMaps(box, covered, own, energy, np.asarray(inset, np.float32))


def decide(maps: list[PatchMaps]) -> tuple[Labels, Decisions, GrayImage]:
    ink = unite_ink(maps, ROWS, COLUMNS)
    cells = decide_cells(maps, ink, TEXT_HEIGHT)
    return cells, decide_words(maps, ink, cells, TEXT_HEIGHT), ink


WHOLE = Rectangle(0, 0, COLUMNS, ROWS)
LEFT, RIGHT = Rectangle(0, 0, 100, ROWS), Rectangle(60, 0, 100, ROWS)


def test_a_cell_takes_the_sharpest_photo() -> None:
    ink = drawn(*((left, 30, 10, 6) for left in range(5, 150, 14)))
    cells, _, _ = decide([patch(LEFT, ink, 0.2), patch(RIGHT, ink, 0.3)])
    assert (cells[25:40, :60] == 0).all()
    assert (cells[25:40, 60:] == 1).all()
    cells, _, _ = decide([patch(LEFT, ink, 0.3), patch(RIGHT, ink, 0.2)])
    assert (cells[25:40, :100] == 0).all()


def test_among_equals_the_border_decides() -> None:
    """Without any print, and with print equally sharp: half way, in one piece."""
    for ink in (drawn(), drawn(*((left, 30, 10, 6) for left in range(5, 150, 14)))):
        cells, _, _ = decide([patch(LEFT, ink), patch(RIGHT, ink)])
        change = np.argmax(cells[20:60] == 1, axis=1)
        assert change.min() >= 74
        assert change.max() <= 86
        assert (np.diff(cells[20:60].astype(int), axis=1) >= 0).all()


def test_the_majority_takes_the_word() -> None:
    ink = drawn((70, 30, 25, 6))
    cells = np.zeros((ROWS, COLUMNS), np.int16)
    cells[:, 80:] = 1
    maps = [patch(WHOLE, ink), patch(WHOLE, ink)]
    decisions = decide_words(maps, ink, cells, TEXT_HEIGHT)
    # With its margin, and nothing beyond.
    assert (decisions.labels[29:37, 69:96] == 1).all()
    assert (decisions.labels[:20] == cells[:20]).all()
    assert decisions.whole[29:37, 68:97].all()
    assert not decisions.broken.any()
    assert not decisions.whole[:25].any()


@pytest.mark.parametrize("sharp", [0.2, 0.6])
def test_a_word_that_a_border_cuts_is_another_photos(sharp: float) -> None:
    """However much sharper the photo that cuts it is."""
    ink = drawn((50, 30, 25, 6), (85, 30, 20, 6))
    maps = [patch(LEFT, ink, 0.2), patch(RIGHT, ink, sharp)]
    cells, decisions, _ = decide(maps)
    # What the cells choose changes with the sharpness, the word does not.
    assert (cells[32, 66:75] == (1 if sharp > 0.3 else 0)).all()
    assert (decisions.labels[29:37, 49:76] == 0).all()
    assert (decisions.labels[29:37, 84:106] == 1).all()


def test_a_line_that_no_photo_shows_whole_falls_apart_into_words() -> None:
    # Gaps of three cells, which the first dilation closes and the second leaves open.
    ink = drawn(*((left, 30, 12, 6) for left in range(5, 150, 15)))
    _, decisions, _ = decide([patch(LEFT, ink), patch(RIGHT, ink)])
    for left in range(5, 150, 15):
        assert len(np.unique(decisions.labels[29:37, left : left + 12])) == 1
    assert not decisions.broken.any()


def test_what_nobody_shows_whole_keeps_the_cells_decisions() -> None:
    ink = drawn((30, 30, 100, 9))
    cells, decisions, _ = decide([patch(LEFT, ink), patch(RIGHT, ink)])
    assert (decisions.labels[ink > 0] == cells[ink > 0]).all()
    assert decisions.broken.sum() == 900


def test_a_rule_does_not_tie_words() -> None:
    words = tuple((left, 30, 12, 6) for left in range(5, 140, 20))
    ink = drawn(*words, (2, 38, 150, 1))
    _, decisions, _ = decide([patch(LEFT, ink, 0.2), patch(RIGHT, ink, 0.3)])
    for left, top, width, height in words:
        assert len(np.unique(decisions.labels[top : top + height, left : left + width])) == 1
        assert decisions.labels[32, left] == (1 if left > 62 else 0)


def test_several_words_that_only_the_worse_photo_holds_go_to_the_better_one() -> None:
    ink = drawn(*((left, 30, 12, 6) for left in range(5, 150, 15)))
    _, decisions, _ = decide([patch(WHOLE, ink, 0.1), patch(RIGHT, ink, 0.3)])
    assert (decisions.labels[29:37, 64:150] == 1).all()
    assert (decisions.labels[29:37, 49:61] == 0).all()


@pytest.mark.parametrize("photos", [3, 5, 16])
def test_any_number_of_photos(photos: int) -> None:
    ink = drawn(*((left, top, 12, 6) for left in range(5, 140, 18) for top in (10, 25, 40, 55)))
    rng = np.random.default_rng(photos)
    maps = [patch(WHOLE, ink, 0.05)]
    for _ in range(photos - 1):
        left, top = rng.integers(0, [100, 50])
        width, height = rng.integers(20, [160 - left, 80 - top])
        maps.append(
            patch(Rectangle(int(left), int(top), int(width), int(height)), ink, rng.uniform(0.1, 0.3))
        )
    cells, decisions, _ = decide(maps)
    assert (cells >= 0).all()
    components = cv2.connectedComponents(ink)[1]
    for component in range(1, components.max() + 1):
        rows, columns = np.nonzero(components == component)
        assert len(np.unique(decisions.labels[rows, columns])) == 1
        box = maps[decisions.labels[rows[0], columns[0]]].box
        assert box.left <= columns.min()
        assert columns.max() < box.right
        assert box.top <= rows.min()
        assert rows.max() < box.bottom


def test_weights_are_one_photos_at_print_and_fade_elsewhere() -> None:
    ink = drawn((70, 30, 22, 6))
    maps = [patch(LEFT, ink), patch(RIGHT, ink)]
    _, decisions, _ = decide(maps)
    weights = fade_weights(maps, decisions, TEXT_HEIGHT, 1.5)
    page = np.zeros((2, ROWS, COLUMNS), np.uint8)
    for number, (one, weight) in enumerate(zip(maps, weights, strict=True)):
        page[number][one.box.within(WHOLE)] = weight
    assert (page.max(axis=0) > 0).all()
    word = page[:, 28:38, 68:94]
    assert set(np.unique(word)) == {0, 255}
    assert (word.min(axis=0) == 0).all()
    line = page[0, 70, 60:100].astype(int)
    assert (np.diff(line) <= 0).all()
    assert np.abs(np.diff(line)).max() < 50
    # Near its end a photo has no say where the other has.
    assert page[0, 70, 99] <= 2
    assert page[1, 70, 60] <= 2

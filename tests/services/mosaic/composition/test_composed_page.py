"""The claims of 4.4: words whole, sharp, and never doubled; seams where nothing is printed."""

import tracemalloc
from collections.abc import Iterator
from dataclasses import dataclass, replace

import cv2
import numpy as np
import pytest

from services.arrays import Mask, RgbImage
from services.contract.mosaic import Composition
from services.geometry.homographies import scaling, translation
from services.mosaic.composition.composed_page import compose_page
from services.mosaic.light.hidden_parts import HiddenPart
from services.mosaic.placed_photo import PlacedPhoto
from tests.services.mosaic.cuttings import TEXT_HEIGHT_PX, Box, cut, in_color, place, prose

pytestmark = pytest.mark.pipeline

WIDTH, HEIGHT = 1000, 700
LEFT, RIGHT = Box(0, 0, 620, 700), Box(381, 0, 1000, 700)


@pytest.fixture(scope="module")
def page() -> RgbImage:
    return in_color(prose().image)


def composed(placed: list[PlacedPhoto], how: Composition = "selective") -> RgbImage:
    return compose_page(placed, WIDTH, HEIGHT, how, TEXT_HEIGHT_PX).image


@dataclass(frozen=True, slots=True)
class Inked:
    """One word's pixels in page, and which photos show it whole."""

    at: tuple[slice, slice]
    print: Mask
    holders: tuple[int, ...]

    def off(self, one: RgbImage, other: RgbImage) -> float:
        """Root mean square difference where the word is printed, and two pixels round it."""
        difference = one[self.at].astype(np.float32) - other[self.at]
        return float(np.sqrt(np.mean(difference[self.print] ** 2)))


def words(boxes: list[Box], margin: float = 0.0) -> Iterator[Inked]:
    """All words of the page."""
    dark = cv2.dilate((prose().image < 160).astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
    for line in prose().lines:
        for word in line:
            x0, y0, x1, y1 = word.box
            at = (slice(int(y0) - 2, int(y1) + 3), slice(int(x0) - 2, int(x1) + 3))
            holders = tuple(i for i, box in enumerate(boxes) if box.holds(word.box, margin))
            yield Inked(at, np.asarray(dark[at]), holders)


def off(one: RgbImage, other: RgbImage) -> float:
    """Root mean square difference."""
    return float(np.sqrt(np.mean((one.astype(np.float32) - other) ** 2)))


def differences(
    image: RgbImage, placed: list[PlacedPhoto], boxes: list[Box]
) -> list[tuple[int, list[float]]]:
    """For every word, in how many photos it is whole, and how far it is from what each of these shows.

    A word so near to a photo's border that its margin is cut may be another's; one that no photo shows with its
    margin is left out.
    """
    alone = [composed([one]) for one in placed]
    return [
        (len(wide.holders), [word.off(image, alone[i]) for i in word.holders])
        for word, wide in zip(words(boxes), words(boxes, 16.0), strict=True)
        if wide.holders
    ]


@pytest.mark.parametrize("shift", [(1.5, 0.0), (-1.06, 1.06)])
def test_a_misplaced_photo_leaves_no_ghost(page: RgbImage, shift: tuple[float, float]) -> None:
    boxes = [LEFT, RIGHT]
    placed = [cut(page, LEFT, blur_px=0.5), cut(page, RIGHT, index=1, blur_px=0.5, shift=shift)]
    selective = differences(composed(placed), placed, boxes)
    assert sum(count == 2 for count, _ in selective) > 20
    # Every word is one photo's, to the last pixel.
    assert max(min(found) for _, found in selective) == 0.0
    average = [
        min(found) for count, found in differences(composed(placed, "average"), placed, boxes) if count == 2
    ]
    assert np.median(average) > 5


@pytest.mark.parametrize(
    ("blur_px", "gain"),
    [((0.5, 0.5), (0.6, 1.0)), ((0.5, 1.6), (1.0, 1.0)), ((1.6, 0.5), (0.6, 1.0))],
)
def test_no_word_is_broken(page: RgbImage, blur_px: tuple[float, float], gain: tuple[float, float]) -> None:
    """Neither by a decision's border nor by that of the overlap: it is one photo's, to the last pixel."""
    boxes = [LEFT, RIGHT]
    placed = [
        cut(page, box, index=i, blur_px=blur_px[i], gain=gain[i], noise=1.5) for i, box in enumerate(boxes)
    ]
    found = differences(composed(placed), placed, boxes)
    assert len(found) > 60
    # Beside a blurred word's rim its border may pass; a border through a word makes 20 and more.
    assert max(min(each) for _, each in found) < 4
    assert np.mean([min(each) == 0 for _, each in found]) > 0.97


def test_the_blurred_photo_loses(page: RgbImage) -> None:
    boxes = [LEFT, RIGHT]
    for sharp in (0, 1):
        placed = [
            cut(
                page,
                box,
                index=i,
                blur_px=0.5 if i == sharp else 1.2,
                gain=0.6 if i == sharp else 1.0,
                noise=2.0,
            )
            for i, box in enumerate(boxes)
        ]
        image, alone = composed(placed), composed([placed[sharp]])
        both = [word.off(image, alone) for word in words(boxes, 16.0) if len(word.holders) == 2]
        # Two words may stick together in the blurred photo where the sharp one ends.
        assert np.mean(np.array(both) == 0) > 0.9
        result = compose_page(placed, WIDTH, HEIGHT, "selective", TEXT_HEIGHT_PX)
        assert result.sharpness[sharp] == 1.0
        assert 0.2 < result.sharpness[1 - sharp] < 0.9


def test_words_that_are_hidden_come_from_the_other_photo(page: RgbImage) -> None:
    """To the last pixel, although the photo that hides them is the sharper one."""
    whole = Box(0, 0, WIDTH, HEIGHT)
    placed = [cut(page, whole, blur_px=0.5), cut(page, whole, index=1, blur_px=0.8)]
    cells = np.zeros((HEIGHT // 10, WIDTH // 10), bool)
    cells[20:40, 30:60] = True
    hidden = HiddenPart(cells, np.ones_like(cells), scaling(0.1) @ translation(-4.5, -4.5))
    image = composed([replace(placed[0], hidden=hidden), placed[1]])
    sharp, other = (composed([one]) for one in placed)
    from_other = [word.off(image, other) for word in words([Box(300, 200, 600, 400)]) if word.holders]
    assert len(from_other) > 10
    assert max(from_other) == 0
    from_first = [word.off(image, sharp) for word in words([Box(0, 440, WIDTH, HEIGHT)]) if word.holders]
    assert len(from_first) > 10
    assert max(from_first) == 0


def test_three_photos_partly_on_each_other(page: RgbImage) -> None:
    boxes = [Box(0, 0, 560, 420), Box(420, 40, 1000, 480), Box(150, 300, 900, 700)]
    placed = [
        cut(page, boxes[0], blur_px=0.5),
        cut(page, boxes[1], index=1, blur_px=0.9, gain=0.7, shift=(1.2, -0.8)),
        cut(page, boxes[2], index=2, blur_px=0.7, gain=0.85, shift=(-1.0, 1.0)),
    ]
    image = composed(placed)
    found = differences(image, placed, boxes)
    assert {count for count, _ in found} == {1, 2, 3}
    assert max(min(each) for _, each in found) < 1
    assert (image[690:, :140] == 255).all()
    assert (image[600:, 910:] == 255).all()
    # What any photo shows is not left white.
    for box in boxes:
        assert (image[box.top + 3 : box.bottom - 4, box.left + 3 : box.right - 4] < 255).any(axis=2).all()


def test_order_does_not_count(page: RgbImage) -> None:
    boxes = [Box(0, 0, 560, 420), Box(420, 40, 1000, 480), Box(150, 300, 900, 700)]
    placed = [cut(page, box, index=i, blur_px=0.5 + 0.2 * i, shift=(i, 0)) for i, box in enumerate(boxes)]
    usual = composed(placed)
    for order in ([2, 1, 0], [1, 2, 0]):
        assert off(composed([placed[i] for i in order]), usual) < 0.1


def test_a_word_that_nobody_shows_whole_is_not_lost(page: RgbImage) -> None:
    """A narrow overlap cuts words; what is shown of them comes from both, in place."""
    boxes = [Box(0, 0, 510, 700), Box(490, 0, 1000, 700)]
    placed = [cut(page, box, index=i, blur_px=0.5) for i, box in enumerate(boxes)]
    image, whole = composed(placed), composed([cut(page, Box(0, 0, 1000, 700), blur_px=0.5)])
    cut_words = [word.off(image, whole) for word in words(boxes) if not word.holders]
    assert len(cut_words) >= 5
    assert max(cut_words) < 1.5


def test_a_sharper_close_up_is_used_before_an_overview(page: RgbImage) -> None:
    """The overview alone holds everything, also a frame that ties all words together."""
    framed = page.copy()
    cv2.rectangle(framed, (20, 20), (980, 680), (10, 10, 10), 2)
    boxes = [Box(0, 0, 1000, 700), Box(200, 150, 800, 550)]
    placed = [cut(framed, boxes[0], blur_px=1.5), cut(framed, boxes[1], index=1, blur_px=0.5)]
    image, close = composed(placed), composed([placed[1]])
    inside = [word.off(image, close) for word in words(boxes, 16.0) if len(word.holders) == 2]
    assert len(inside) > 20
    assert np.mean(np.array(inside) == 0) > 0.93


def test_background_has_no_steps_but_of_light(page: RgbImage) -> None:
    """Between photos of different light the paper changes gently, within a line's height."""
    blank = np.full_like(page, 220)
    blank[300:330, 100:900] = page[100:130, 100:900]
    placed = [cut(blank, LEFT), cut(blank, RIGHT, index=1, gain=0.9)]
    image = composed(placed).astype(int)
    row = image[600, 3:-3, 0]
    assert row.min() < 200
    assert row.max() > 207
    assert np.abs(np.diff(row)).max() <= 3
    average = composed(placed, "average").astype(int)[600, 3:-3, 0]
    assert np.abs(np.diff(average)).max() <= 1


def test_a_picture_that_nobody_shows_whole_fades() -> None:
    rng = np.random.default_rng(5)
    coarse = rng.integers(40, 220, (35, 50)).astype(np.uint8)
    picture = in_color(
        np.asarray(cv2.resize(coarse, (WIDTH, HEIGHT), interpolation=cv2.INTER_CUBIC), np.uint8)
    )
    placed = [cut(picture, LEFT), cut(picture, RIGHT, index=1, gain=0.93)]
    image = composed(placed).astype(int)[4:-4, 4:-4]
    # Its gradients hardly exceed its own.
    own = np.abs(np.diff(picture.astype(int), axis=1)).max()
    assert np.abs(np.diff(image, axis=1)).max() <= own + 4


def test_an_average_is_the_mean(page: RgbImage) -> None:
    placed = [cut(page, Box(0, 0, 1000, 700)), cut(page, Box(0, 0, 1000, 700), index=1, gain=0.5)]
    image = composed(placed, "average").astype(int)[5:-5, 5:-5]
    assert np.abs(image - 0.75 * page[5:-5, 5:-5]).max() <= 2


def test_nothing_to_show_is_a_white_page() -> None:
    blank = place(np.full((300, 300, 3), 200, np.uint8), scaling(1.0))
    beside = place(np.full((300, 300, 3), 200, np.uint8), np.array([[1.0, 0, 5000], [0, 1, 0], [0, 0, 1]]))
    result = compose_page([beside], 200, 100, "selective", 20.0)
    assert (result.image == 255).all()
    assert result.sharpness == (0.0,)
    result = compose_page([blank, beside], 200, 100, "selective", 20.0)
    assert np.abs(result.image[5:, 5:].astype(int) - 200).max() <= 1


@pytest.mark.parametrize("how", ["selective", "average"])
def test_memory_does_not_grow_with_the_page(page: RgbImage, how: Composition) -> None:
    """Beyond the page itself: four times the pixels take hardly more, though every photo fills the page."""

    def beyond(scale: float) -> float:
        placed = [place(page, scaling(scale)), place(page[:, :900], scaling(scale), 1)]
        tracemalloc.start()
        image = compose_page(
            placed, int(WIDTH * scale), int(HEIGHT * scale), how, TEXT_HEIGHT_PX * scale
        ).image
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return (peak - image.nbytes) / 1e6

    small, large = beyond(1.5), beyond(3.0)
    assert small < 120
    assert large < small + 10

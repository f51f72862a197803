"""An opened book's pages: each one's truth is a part of the whole's."""

import numpy as np
import pytest

from simulation.flat_page import Page, PageWord
from simulation.sheets import Staging
from simulation.spreads import SPREAD_VIEWS, bind, opened_book, page_truths, photograph_spread
from simulation.truth import Truth

LEFT = Page(np.full((141, 100), 200, np.uint8), ((PageWord("left", (10.0, 20.0, 40.0, 30.0)),),), name="l")
RIGHT = Page(np.full((141, 100), 120, np.uint8), ((PageWord("right", (50.0, 60.0, 80.0, 70.0)),),), name="r")
BOOK = opened_book(60, 30, 35)


def _whole() -> Truth:
    spread, view = bind(LEFT, RIGHT), SPREAD_VIEWS[1]
    camera = view.camera(340, 250)
    return Truth(spread, BOOK, 0.0, view.pose(spread, BOOK, camera, 0.05), camera)


def test_each_page_is_where_it_is_on_the_spread() -> None:
    whole = _whole()
    whole.check_visible()
    points = np.random.default_rng(1).uniform([0, 0], [99, 140], (60, 2))
    for truth, shift in zip(page_truths(whole, LEFT, RIGHT), (0.0, 100.0), strict=True):
        photo = truth.page_to_photo(points)
        np.testing.assert_allclose(photo, whole.page_to_photo(points + np.array([shift, 0.0])), atol=1e-9)
        np.testing.assert_allclose(truth.photo_to_page(photo), points, atol=1e-6)
        np.testing.assert_allclose(truth.normals(photo), whole.normals(photo), atol=1e-9)
        assert truth.on_page(photo).all()
    left, right = page_truths(whole, LEFT, RIGHT)
    assert not right.on_page(left.page_to_photo(points)).any()


def test_words_and_pixels_of_both_pages() -> None:
    spread = bind(LEFT, RIGHT)
    assert [line[0].text for line in spread.lines] == ["left", "right"]
    assert spread.lines[1][0].box == (150.0, 60.0, 180.0, 70.0)
    assert spread.image[70, 99] == 200
    assert spread.image[70, 100] == 120
    with pytest.raises(ValueError, match="one size"):
        bind(LEFT, Page(np.zeros((140, 100), np.uint8)))


def test_a_page_alone_is_in_its_place_and_the_other_is_not_there() -> None:
    staging = Staging("black")

    def shoot(only: int | None) -> np.ndarray:
        rng = np.random.default_rng(1)
        photos = photograph_spread(
            LEFT, RIGHT, SPREAD_VIEWS[0], BOOK, staging, rng=rng, only=only, size=(340, 250)
        )
        return photos[0].image

    both, alone = shoot(None), shoot(1)
    left, right = photograph_spread(
        LEFT, RIGHT, SPREAD_VIEWS[0], BOOK, staging, rng=np.random.default_rng(1), size=(340, 250)
    )
    x, y = np.round(right.truth.page_to_photo(np.array([[60.0, 70.0]]))[0]).astype(int)
    assert abs(int(both[y, x, 0]) - int(alone[y, x, 0])) <= 1
    x, y = np.round(left.truth.page_to_photo(np.array([[40.0, 70.0]]))[0]).astype(int)
    assert both[y, x, 0] > 100
    assert alone[y, x, 0] == 0


def test_pages_rise_out_of_the_gutter_towards_the_viewer() -> None:
    at = BOOK.place(np.array([[-0.3, 0.0], [0.0, 0.0], [0.3, 0.0]]))
    assert at[0, 2] < at[1, 2] - 0.1
    assert at[2, 2] < at[1, 2] - 0.1

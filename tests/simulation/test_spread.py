"""Two pages of a book: they meet in the gutter, and each has its own truth."""

import numpy as np
import pytest

from simulation.pages import own_pages
from simulation.scenes import View
from simulation.spread import Binding, Moved, SimulatedSpread, page_beside_gutter, photograph_spread
from simulation.surfaces import Cylinder

VIEW = View("spread", 2500.0, 14.0, 80.0, 3.0)
SIZE = (700, 520)


@pytest.fixture(scope="module")
def spread() -> SimulatedSpread:
    pages = own_pages(320, 500)
    shapes = (page_beside_gutter(0.8, 0.1, right=False), page_beside_gutter(0.5, 0.2, right=True))
    return photograph_spread(
        (pages[0], pages[1]), VIEW, shapes, rng=np.random.default_rng(1), size=SIZE, binding=Binding(0.6, 0.1)
    )


@pytest.mark.pipeline
def test_the_pages_meet_in_the_gutter(spread: SimulatedSpread) -> None:
    down = np.linspace(-1, 1, 9) * spread.left.page.half_height_units
    left = spread.left.sheet_to_photo(np.column_stack([np.ones(9), down]))
    right = spread.right.sheet_to_photo(np.column_stack([-np.ones(9), down]))
    np.testing.assert_allclose(left, right, atol=1e-6)
    # A spine is straight.
    x, y = left.T
    assert np.abs(np.polyval(np.polyfit(y, x, 1), y) - x).max() < 0.01


def test_both_pages_fit_into_the_photo(spread: SimulatedSpread) -> None:
    outline = np.concatenate([spread.left.outline(), spread.right.outline()])
    low, high = outline.min(axis=0), outline.max(axis=0)
    assert (low >= 0).all()
    assert (high <= np.array(SIZE) - 1).all()
    assert ((high - low) / SIZE).max() == pytest.approx(0.96, abs=0.01)


def test_paper_is_darker_in_the_gutter(spread: SimulatedSpread) -> None:
    sheet = np.column_stack([np.linspace(-0.99, -0.8, 20), np.full(20, -1.53)])  # above the text
    seen = np.round(spread.right.sheet_to_photo(sheet)).astype(int)
    values = spread.image[seen[:, 1], seen[:, 0]].mean(axis=1)
    assert values[0] < 0.6 * values[-1]
    assert (np.diff(values) > -3).all()


def test_a_moved_shape_is_the_shape_elsewhere() -> None:
    shape = Cylinder((0.0, 0.2, -0.3))
    moved = Moved(shape, (0.5, -0.2, 0.3))
    sheet = np.random.default_rng(2).uniform(-0.9, 0.9, (20, 2))
    origin = np.array([0.1, 0.2, -6.0])
    np.testing.assert_allclose(moved.meet(origin, moved.place(sheet) - origin), sheet, atol=1e-6)


@pytest.mark.pipeline
def test_pages_of_different_height_are_no_book() -> None:
    pages = (own_pages(320, 500)[0], own_pages(320, 400)[1])
    shapes = (page_beside_gutter(0.8, 0.1, right=False), page_beside_gutter(0.5, 0.2, right=True))
    with pytest.raises(ValueError, match="one shape"):
        photograph_spread(pages, VIEW, shapes, rng=np.random.default_rng(1), size=SIZE)

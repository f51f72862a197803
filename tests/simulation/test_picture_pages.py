"""Sheets without text."""

import numpy as np
import pytest

from simulation.picture_pages import PICTURE_PAGES, picture_page


@pytest.mark.parametrize("name", PICTURE_PAGES)
def test_pictures_are_drawn_alike_in_their_size_and_without_words(name: str) -> None:
    page, again, other = (picture_page(name, 300, seed) for seed in (1, 1, 2))
    assert page.width == 300
    assert 1.2 < page.height / page.width < 1.55
    assert not page.lines
    assert np.array_equal(page.image, again.image)
    if name != "poster":
        assert not np.array_equal(page.image, other.image)
    # Something is printed, and not everywhere up to the edge.
    dark = np.mean(page.image.min(axis=2) < 128)
    assert 0.005 < dark < 0.8


def test_no_such_picture() -> None:
    with pytest.raises(KeyError):
        picture_page("novel")

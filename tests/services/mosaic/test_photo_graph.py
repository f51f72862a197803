"""Which photos belong together."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.errors import NotOverlapping
from services.geometry.homographies import scaling, translation
from services.mosaic.photo_graph import choose_part, connect_photos, overlap_fraction
from tests.services.mosaic.views import cut_view, page_image

PAIRS = st.sets(st.tuples(st.integers(0, 9), st.integers(0, 9)).filter(lambda pair: pair[0] < pair[1]))


@given(PAIRS)
def test_parts_divide_the_photos_and_no_pair_joins_two(pairs: set[tuple[int, int]]) -> None:
    parts = connect_photos(range(10), pairs)
    assert sorted(index for part in parts for index in part) == list(range(10))
    part_of = {index: part for part in parts for index in part}
    assert all(part_of[a] is part_of[b] for a, b in pairs)
    for part in parts:
        # One photo of a part reaches all of it.
        reached = {part[0]}
        for _ in part:
            reached |= {b for a, b in pairs if a in reached} | {a for a, b in pairs if b in reached}
        assert reached == set(part)


def views(*weights: float):
    view = cut_view(page_image(), 0, 0, 200, 200)
    return {index: replace(view, index=index, weight=weight) for index, weight in enumerate(weights)}


def test_the_part_of_most_photos_is_the_page() -> None:
    assert choose_part([(0, 3), (1, 2, 4)], views(900, 1, 2, 900, 1), None) == ((1, 2, 4), 2)


def test_among_equal_parts_the_one_with_most_print() -> None:
    assert choose_part([(0, 1), (2, 3)], views(10, 10, 5, 30), None) == ((2, 3), 3)


def test_the_base_photo_chooses_its_part() -> None:
    assert choose_part([(0, 3), (1, 2, 4)], views(1, 1, 1, 1, 1), 0) == ((0, 3), 0)


def test_a_photo_alone_is_no_mosaic() -> None:
    with pytest.raises(NotOverlapping, match=r"no two of images\[0\], images\[1\] show"):
        choose_part([(0,), (1,)], views(1, 1), None)


def test_a_base_that_is_alone_is_named() -> None:
    with pytest.raises(NotOverlapping, match=r"images\[2\]"):
        choose_part([(0, 1), (2,)], views(1, 1, 1), 2)


def test_overlap_is_a_share_of_the_smaller_view() -> None:
    page = page_image()
    a, b = cut_view(page, 0, 0, 800, 600), cut_view(page, 600, 100, 400, 400)
    overlap = overlap_fraction(a, b, translation(600.0, 100.0))
    assert 0.47 < overlap < 0.53
    assert overlap_fraction(b, a, translation(-600.0, -100.0)) == pytest.approx(overlap)
    assert overlap_fraction(a, b, translation(900.0, 0.0)) == 0.0
    assert overlap_fraction(a, a, np.eye(3)) > 0.98
    assert 0.98 < overlap_fraction(a, b, translation(200.0, 100.0) @ scaling(0.5)) <= 1.0

"""Places for labels: in the picture, beside their zones, off each other."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from services.layout.rendering.chip_placing import Rect, place_chips

BOUNDS = (0, 40, 1000, 1400)
SIZE = (90, 24)


def shared(a: Rect, b: Rect) -> int:
    return max(0, min(a[2], b[2]) - max(a[0], b[0])) * max(0, min(a[3], b[3]) - max(a[1], b[1]))


def rects(places: list[tuple[int, int]], size: tuple[int, int] = SIZE) -> list[Rect]:
    return [(x, y, x + size[0], y + size[1]) for x, y in places]


def test_alone_it_stands_on_the_top_edge() -> None:
    assert place_chips([SIZE], [(200, 300, 700, 500)], BOUNDS) == [(200, 276)]


def test_where_there_is_no_room_above_it_stands_aside() -> None:
    zones = [(200, 300, 700, 500), (200, 505, 700, 700)]
    assert place_chips([SIZE, SIZE], zones, BOUNDS) == [(200, 276), (110, 505)]


def test_zones_upon_each_other_have_labels_of_their_own() -> None:
    found = rects(place_chips([SIZE] * 30, [(300, 600, 500, 640)] * 30, BOUNDS))
    assert sum(shared(a, b) for at, a in enumerate(found) for b in found[:at]) == 0


def test_paragraphs_of_two_columns() -> None:
    zones = [(x, y, x + 380, y + 96) for x in (100, 520) for y in range(100, 1300, 100)]
    found = rects(place_chips([SIZE] * len(zones), zones, BOUNDS))
    assert sum(shared(a, b) for at, a in enumerate(found) for b in found[:at]) == 0
    for chip, zone in zip(found, zones, strict=True):
        near = (zone[0] - SIZE[0], zone[1] - SIZE[1], zone[2] + SIZE[0], zone[3] + SIZE[1])
        assert shared(chip, near) == SIZE[0] * SIZE[1]


@given(
    st.lists(
        st.tuples(st.integers(0, 999), st.integers(40, 1399), st.integers(1, 1200), st.integers(1, 1500)),
        max_size=20,
    )
)
@settings(max_examples=40, deadline=None)
def test_labels_stay_in_bounds(boxes: list[tuple[int, int, int, int]]) -> None:
    zones = [(x, y, x + width, y + height) for x, y, width, height in boxes]
    found = np.array(place_chips([SIZE] * len(zones), zones, BOUNDS)).reshape(-1, 2)
    assert (found >= BOUNDS[:2]).all()
    assert (found + SIZE <= BOUNDS[2:]).all()


def test_a_label_larger_than_the_picture_starts_in_its_corner() -> None:
    assert place_chips([(2000, 24)], [(500, 500, 600, 600)], BOUNDS) == [(0, 476)]

"""Reading order: columns, heads over them, and rows without columns."""

import numpy as np
import pytest

from services.layout.segmentation.reading_order import reading_order


def test_columns_are_read_one_after_the_other() -> None:
    title, left, left2, right, right2, foot = (
        (100, 0, 900, 50),
        (0, 100, 480, 400),
        (0, 420, 480, 800),
        (520, 90, 1000, 300),
        (520, 320, 1000, 800),
        (0, 900, 1000, 950),
    )
    boxes = [foot, right2, right, left2, left, title]
    order = [boxes[index] for index in reading_order([tuple(map(float, box)) for box in boxes])]  # type: ignore[misc]
    assert order == [title, left, left2, right, right2, foot]


def test_a_head_between_ends_the_columns_above() -> None:
    upper = [(0.0, 0.0, 450.0, 100.0), (550.0, 0.0, 1000.0, 100.0)]
    head = (0.0, 150.0, 1000.0, 200.0)
    lower = [(0.0, 250.0, 450.0, 400.0), (550.0, 250.0, 1000.0, 400.0)]
    boxes = [*lower, head, *upper]
    assert [boxes[index] for index in reading_order(boxes)] == [*upper, head, *lower]


def test_a_centred_letterhead_comes_before_short_lines_at_the_margin_below_it() -> None:
    letterhead, reference, greeting, body = (
        (317.0, 60.0, 562.0, 95.0),
        (103.0, 133.0, 222.0, 148.0),
        (103.0, 336.0, 240.0, 352.0),
        (103.0, 366.0, 800.0, 920.0),
    )
    boxes = [body, greeting, reference, letterhead]
    assert [boxes[index] for index in reading_order(boxes, heads_first=True)] == [
        letterhead,
        reference,
        greeting,
        body,
    ]


def test_a_right_column_that_begins_higher_is_read_second() -> None:
    left, right_head, right = (
        (0.0, 150.0, 450.0, 800.0),
        (550.0, 50.0, 800.0, 100.0),
        (550.0, 120.0, 1000.0, 800.0),
    )
    boxes = [right, right_head, left]
    assert [boxes[index] for index in reading_order(boxes, heads_first=True)] == [left, right_head, right]


@pytest.mark.parametrize("count", [0, 1, 40, 500])
def test_every_zone_comes_once(count: int) -> None:
    corner = np.random.default_rng(count).uniform(0, 1000, (count, 2))
    boxes = [(x, y, x + 200.0, y + 80.0) for x, y in corner.tolist()]
    assert sorted(reading_order(boxes)) == list(range(count))
    assert sorted(reading_order([(5.0, 5.0, 9.0, 9.0)] * count)) == list(range(count))

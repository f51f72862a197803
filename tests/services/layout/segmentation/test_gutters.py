"""Gutters between columns, by the boxes of words alone."""

import numpy as np
import pytest

from services.layout.segmentation.gutters import split_at_gutters

EM_PX = 20.0


def two_columns(space: float) -> tuple[np.ndarray, np.ndarray]:
    """Boxes and rows of eight rows of three words in each of two columns, which are three ems apart."""
    boxes, rows = [], []
    for row in range(8):
        for column in range(2):
            for word in range(3):
                x0 = column * (3 * 3.0 + 2 * space + 3.2) + word * (3.0 + space)
                box = (x0, 1.2 * row, x0 + 3.0, 1.2 * row + 0.85)
                boxes.append([EM_PX * side for side in box])
                rows.append(row)
    return np.array(boxes), np.array(rows, np.intp)


@pytest.mark.parametrize("space", [0.15, 0.3])
def test_columns_are_apart_however_tight_the_print_is(space: float) -> None:
    boxes, rows = two_columns(space)
    pieces = split_at_gutters(boxes, rows, (boxes, rows), np.empty((0, 4)))
    is_right = boxes[:, 0] > boxes[:, 2].max() / 2
    assert not set(pieces[is_right]) & set(pieces[~is_right])
    assert len(set(pieces)) == 16

"""Boxes (x0, y0, x1, y1) in pixels: what two of them have in common. Plain numbers, for the app and for workers."""

from collections.abc import Sequence

Sides = Sequence[float]
SAME_PX = 1.0
"""Largest distance of the sides of one zone. Results round boxes to hundredths of a pixel; drawing is coarser."""
SAME_ROW = 0.5
"""Common height of what is printed in one row, as a share of the lower one's."""
CELL_IN_ROW = 0.3
"""Common height of a cell and its row in a table, as a share of the lower one's. People draw boxes roughly, and a cell
may have several lines."""


def area(box: Sides) -> float:
    """In square pixels."""
    return (box[2] - box[0]) * (box[3] - box[1])


def common_area(one: Sides, other: Sides) -> float:
    """Of both, in square pixels; 0 where they are apart."""
    across = min(one[2], other[2]) - max(one[0], other[0])
    down = min(one[3], other[3]) - max(one[1], other[1])
    return max(across, 0.0) * max(down, 0.0)


def are_one_place(one: Sides, other: Sides) -> bool:
    """Whether two boxes are of one zone."""
    return max(abs(a - b) for a, b in zip(one, other, strict=True)) <= SAME_PX


def lie_on_each_other(one: Sides, other: Sides) -> bool:
    """Whether two boxes have at least half of the smaller one in common: a zone, and what is drawn in its place."""
    common = common_area(one, other)
    return common > 0.0 and 2 * common >= min(area(one), area(other))


def common_height(one: Sides, other: Sides) -> float:
    """Rows of both as a share of the lower one's; negative where they have none."""
    common = min(one[3], other[3]) - max(one[1], other[1])
    return common / max(1e-6, min(one[3] - one[1], other[3] - other[1]))


def holds_middle(box: Sides, other: Sides) -> bool:
    """Whether the middle of `other` lies in the box."""
    x, y = (other[0] + other[2]) / 2, (other[1] + other[3]) / 2
    return box[0] <= x <= box[2] and box[1] <= y <= box[3]

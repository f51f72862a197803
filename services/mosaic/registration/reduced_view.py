"""A flat view rotated by quarters and reduced, as used by registration."""

from functools import cached_property

import cv2
import numpy as np

from services.arrays import GrayImage, Homography, Mask, Points
from services.imaging.reduction import average_areas
from services.mosaic.flat_photo import FlatPhoto

RULE_PX = 49
"""Least length of unbroken ink, across or down, that is a rule: four characters high, as wide as a block of text."""


class ReducedView:
    """A view rotated counter-clockwise by quarters and reduced.

    `gray` and `shown` are (h, w); `H_reduced_flat` maps the photo's flat pixels to this view's.
    """

    def __init__(self, photo: FlatPhoto, turns: int, factor: float) -> None:
        gray, shown, H = reduce_view(photo.gray, photo.shown, factor)
        if turns % 4:
            H = quarter_turn(turns, gray.shape[1], gray.shape[0]) @ H
            gray, shown = np.rot90(gray, turns).copy(), np.rot90(shown, turns).copy()
        self.gray: GrayImage = gray
        self.shown: Mask = shown
        self.H_reduced_flat: Homography = H

    @cached_property
    def corners(self) -> Points:
        """Corners (4, 2) of the bounding box of the shown part."""
        columns, rows = np.flatnonzero(self.shown.any(axis=0)), np.flatnonzero(self.shown.any(axis=1))
        if not len(columns):
            return np.zeros((4, 2))
        x0, x1, y0, y1 = columns[0], columns[-1], rows[0], rows[-1]
        return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]], float)

    @cached_property
    def unruled(self) -> GrayImage:
        """`gray` without rules, because with them all cells of a table or grid look alike."""
        return remove_rules(self.gray)


def reduce_view(gray: GrayImage, shown: Mask, factor: float) -> tuple[GrayImage, Mask, Homography]:
    """The view at `factor` of its size (1 at most), and the homography from the view's pixels to the reduced ones'."""
    height, width = gray.shape
    if factor >= 1:
        return gray, shown, np.eye(3)
    size = max(1, round(width * factor)), max(1, round(height * factor))
    reduced = average_areas(gray, *size)
    mask = cv2.resize(shown.view(np.uint8), size, interpolation=cv2.INTER_NEAREST) > 0
    H = np.diag([size[0] / width, size[1] / height, 1.0])
    H[:2, 2] = 0.5 * np.diag(H)[:2] - 0.5
    return reduced, mask, H


def remove_rules(gray: GrayImage) -> GrayImage:
    """`gray` with long straight lines, across and down, replaced by their background."""
    ink = cv2.bitwise_not(gray)
    rules = np.zeros_like(ink)
    for long, thick in (((1, RULE_PX), (3, 1)), ((RULE_PX, 1), (1, 3))):
        # A rule that is not quite straight crosses from one row of pixels to the next.
        wide = cv2.dilate(ink, np.ones(thick, np.uint8))
        rules = cv2.max(rules, cv2.morphologyEx(wide, cv2.MORPH_OPEN, np.ones(long, np.uint8)))
    return np.asarray(cv2.bitwise_not(cv2.subtract(ink, rules)), np.uint8)


def quarter_turn(turns: int, width: int, height: int) -> Homography:
    """From a view of `width` x `height` to the view rotated counter-clockwise by `turns` quarters (`np.rot90`)."""
    H = np.eye(3)
    for _ in range(turns % 4):
        H = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, width - 1.0], [0.0, 0.0, 1.0]]) @ H
        width, height = height, width
    return H

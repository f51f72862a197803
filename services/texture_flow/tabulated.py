"""Values on a regular grid, looked up between its nodes."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import Floats, Points, Vector

_REMAP_WIDTH = 4096
"""Width of the array of points for the look-up: OpenCV's bilinear look-up is ten times as fast as numpy's."""


@dataclass(frozen=True, slots=True, eq=False)
class TabulatedValues:
    """`values` (rows, columns) or (rows, columns, 2); node (r, c) lies at `origin` + `spacing` (c, r)."""

    values: Floats
    origin: tuple[float, float]
    spacing: float

    def at(self, points: Points, border: int = cv2.BORDER_CONSTANT) -> Floats:
        """Values (N,) or (N, 2) at `points` (N, 2), bilinear; beyond the nodes as OpenCV's `border` (zero)."""
        places = np.asarray(points).T
        return self._look_up(
            [self._nodes_at(place.astype(np.float64), k) for k, place in enumerate(places)], border
        )

    def at_pixels(self, pixels: NDArray[np.integer[Any]], border: int = cv2.BORDER_CONSTANT) -> Floats:
        """As `at` the points whose x and y are the whole numbers `pixels` (2, N), not negative.

        Of many in one image each column and each row is placed among the nodes once.
        """
        found = []
        for k, place in enumerate(pixels):
            every = np.arange(int(place.max(initial=0)) + 1, dtype=np.float64)
            found.append(self._nodes_at(every, k).astype(np.float32)[place])
        return self._look_up(found, border)

    def _nodes_at(self, place: Vector, axis: int) -> Vector:
        """Places (N,) along an axis, 0 for x, in nodes."""
        return np.asarray((place - self.origin[axis]) / self.spacing)

    def _look_up(self, places: Sequence[NDArray[Any]], border: int) -> Floats:
        """Values at x and y (N,) in nodes."""
        count = len(places[0])
        if count == 0:
            return np.zeros((0, *self.values.shape[2:]))
        width = min(count, _REMAP_WIDTH)
        where = np.zeros((2, -(-count // width) * width), np.float32)
        where[0, :count], where[1, :count] = places
        x, y = where.reshape(2, -1, width)
        found = cv2.remap(self.values.astype(np.float32), x, y, cv2.INTER_LINEAR, borderMode=border)
        return np.asarray(found.reshape(-1, *self.values.shape[2:])[:count], np.float64)

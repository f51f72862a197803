"""Values on a regular grid, looked up between its nodes."""

from dataclasses import dataclass

import cv2
import numpy as np

from services.arrays import Floats, Points

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
        count = len(points)
        if count == 0:
            return np.zeros((0, *self.values.shape[2:]))
        width = min(count, _REMAP_WIDTH)
        where = np.zeros((2, -(-count // width) * width), np.float32)
        for axis in (0, 1):
            place = np.asarray(points)[:, axis].astype(np.float64)
            where[axis, :count] = (place - self.origin[axis]) / self.spacing
        x, y = where.reshape(2, -1, width)
        found = cv2.remap(self.values.astype(np.float32), x, y, cv2.INTER_LINEAR, borderMode=border)
        return np.asarray(found.reshape(-1, *self.values.shape[2:])[:count], np.float64)

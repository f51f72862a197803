"""Map between a flat view and the mosaic."""

from dataclasses import dataclass, replace

import numpy as np

from services.arrays import Floats, Homography, Points
from services.geometry.homographies import transform_points

INVERSE_STEPS = 4
"""Fixed-point steps of the inverse. Displacements vary by a few per cent of the distance, so each step gains one or two
digits."""


@dataclass(frozen=True, slots=True, eq=False)
class DisplacementField:
    """Smooth displacement of flat pixels, bilinear between the nodes of a grid that spans the view corner to corner.

    `nodes` (rows, columns, 2) are flat pixels; the view is `width` x `height`. Beyond the border it is constant.
    """

    nodes: Floats
    width: int
    height: int

    def at(self, flat: Points) -> Points:
        """Displacements (N, 2) at flat pixels (N, 2)."""
        rows, columns = self.nodes.shape[:2]
        x = np.clip(flat[:, 0] / max(self.width - 1, 1), 0, 1) * (columns - 1)
        y = np.clip(flat[:, 1] / max(self.height - 1, 1), 0, 1) * (rows - 1)
        # Points that are not known are NaN, and so are their displacements.
        i, j = (np.minimum(np.nan_to_num(each).astype(int), n - 2) for each, n in ((x, columns), (y, rows)))
        s, t = (x - i)[:, None], (y - j)[:, None]
        upper = (1 - s) * self.nodes[j, i] + s * self.nodes[j, i + 1]
        lower = (1 - s) * self.nodes[j + 1, i] + s * self.nodes[j + 1, i + 1]
        return np.asarray((1 - t) * upper + t * lower)


@dataclass(frozen=True, slots=True, eq=False)
class Placement:
    """Flat pixels f -> mosaic pixels H (f + d(f)); `displacement` d is None if it is zero."""

    H_mosaic_flat: Homography
    displacement: DisplacementField | None = None

    def to_mosaic(self, flat: Points) -> Points:
        """Mosaic pixels (N, 2) of flat pixels (N, 2)."""
        moved = flat if self.displacement is None else flat + self.displacement.at(flat)
        return transform_points(self.H_mosaic_flat, moved)

    def to_flat(self, mosaic: Points) -> Points:
        """Flat pixels (N, 2) of mosaic pixels (N, 2)."""
        moved = transform_points(np.linalg.inv(self.H_mosaic_flat), mosaic)
        if self.displacement is None:
            return moved
        flat = moved
        for _ in range(INVERSE_STEPS):
            flat = moved - self.displacement.at(flat)
        return flat

    def within(self, H_new_mosaic: Homography) -> "Placement":
        """This placement in another frame of the mosaic."""
        return replace(self, H_mosaic_flat=H_new_mosaic @ self.H_mosaic_flat)

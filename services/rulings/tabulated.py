"""Values on a regular grid of centred unit coordinates, looked up between its nodes."""

from dataclasses import dataclass

import cv2
import numpy as np

from services.arrays import Floats, Points


@dataclass(frozen=True, slots=True, eq=False)
class TabulatedValues:
    """`values` (rows, columns), node (r, c) at `origin` + `spacing` (c, r)."""

    values: Floats
    origin: Points
    spacing: float

    def at(self, points: Points) -> Floats:
        """Value (...) at `points` (..., 2), zero outside."""
        where = ((points - self.origin) / self.spacing).astype(np.float32).reshape(-1, 2)
        # OpenCV looks up in an image: the list of points is folded into rows that it can take.
        width = min(max(len(where), 1), 4096)
        folded = np.pad(where, ((0, -len(where) % width), (0, 0))).reshape(-1, width, 2)
        value = cv2.remap(
            self.values.astype(np.float32),
            folded[..., 0],
            folded[..., 1],
            cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_CONSTANT,
        )
        return np.asarray(value.ravel()[: len(where)].reshape(points.shape[:-1]), np.float64)


def measure_text_density(points: Points, spacing: float) -> TabulatedValues:
    """Density of marks at `points` (N, 2), one where they are half as dense as is typical, or denser."""
    low = points.min(axis=0) - 3 * spacing
    cells = np.minimum(np.ceil((np.ptp(points, axis=0) + 6 * spacing) / spacing), 256).astype(int) + 1
    at = np.clip(np.round((points - low) / spacing).astype(int), 0, cells - 1)
    count = np.zeros((cells[1], cells[0]))
    np.add.at(count, (at[:, 1], at[:, 0]), 1.0)
    count = cv2.GaussianBlur(count, (0, 0), 1.0, borderType=cv2.BORDER_CONSTANT)
    typical = float(np.median(count[at[:, 1], at[:, 0]]))
    return TabulatedValues(np.clip(2 * count / max(typical, 1e-12), 0.0, 1.0), low, spacing)

"""How dense the marks of a text lie."""

import cv2
import numpy as np

from services.arrays import Points
from services.texture_flow.tabulated import TabulatedValues


def measure_text_density(points: Points, spacing: float) -> TabulatedValues:
    """Density of marks at `points` (N, 2), one where they are half as dense as is typical, or denser."""
    low = points.min(axis=0) - 3 * spacing
    cells = np.minimum(np.ceil((np.ptp(points, axis=0) + 6 * spacing) / spacing), 256).astype(int) + 1
    at = np.clip(np.round((points - low) / spacing).astype(int), 0, cells - 1)
    count = np.zeros((cells[1], cells[0]))
    np.add.at(count, (at[:, 1], at[:, 0]), 1.0)
    count = cv2.GaussianBlur(count, (0, 0), 1.0, borderType=cv2.BORDER_CONSTANT)
    typical = float(np.median(count[at[:, 1], at[:, 0]]))
    share = np.clip(2 * count / max(typical, 1e-12), 0.0, 1.0)
    return TabulatedValues(share, (float(low[0]), float(low[1])), spacing)

"""Array type aliases; `docs/conventions.md` defines frames and units."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

RgbImage = NDArray[np.uint8]
"""(H, W, 3) uint8, RGB."""
GrayImage = NDArray[np.uint8]
"""(H, W) uint8."""
Mask = NDArray[np.bool_]
"""(H, W) bool."""
Points = NDArray[np.floating[Any]]
"""(N, 2) float64, (x, y) pixels, origin at the centre of the top-left pixel."""
Vector = NDArray[np.floating[Any]]
"""(N,) float64."""
Homography = NDArray[np.floating[Any]]
"""(3, 3) float64; `H_dst_src` maps homogeneous source points to destination points."""
Floats = NDArray[np.floating[Any]]
"""Any shape, float64 unless documented otherwise."""
PageImage = NDArray[np.uint8] | NDArray[np.bool_]
"""A page to be encoded: (H, W, 3) RGB, (H, W) gray, or (H, W) black and white, True for white."""

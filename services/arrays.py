"""Array aliases; shapes and frames are told in `docs/conventions.md`."""

import numpy as np
from numpy.typing import NDArray

RgbImage = NDArray[np.uint8]
"""(H, W, 3) uint8, RGB."""
GrayImage = NDArray[np.uint8]
"""(H, W) uint8."""
Mask = NDArray[np.bool_]
"""(H, W) bool."""
Points = NDArray[np.float64]
"""(N, 2) float64, (x, y) pixels, origin at the centre of the top-left pixel."""
Vector = NDArray[np.float64]
"""(N,) float64."""
Homography = NDArray[np.float64]
"""(3, 3) float64; `H_dst_src` maps homogeneous source points to destination points."""

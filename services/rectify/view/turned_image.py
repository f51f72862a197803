"""Images turned by right angles and flipped."""

import cv2
import numpy as np
from numpy.typing import NDArray

from services.rectify.results import Orientation

_TURNS = {90: cv2.ROTATE_90_CLOCKWISE, 180: cv2.ROTATE_180, 270: cv2.ROTATE_90_COUNTERCLOCKWISE}


def apply_orientation(image: NDArray[np.uint8], orientation: Orientation) -> NDArray[np.uint8]:
    """`image` (H, W) or (H, W, 3) flipped left to right if `mirrored`, then turned clockwise; contiguous.

    OpenCV takes 4 to 13 ms for 12 megapixels, NumPy 37 to 52.
    """
    flipped = cv2.flip(image, 1) if orientation.mirrored else image
    turn = _TURNS.get(orientation.rotation_deg % 360)
    return np.ascontiguousarray(flipped if turn is None else cv2.rotate(flipped, turn), np.uint8)

"""Edges that a program has drawn: steps between two rows or columns of pixels, sharp and straight to the pixel.

A camera blurs its edges, and leads none of them exactly along its pixels.
"""

import cv2
import numpy as np

from services.arrays import Mask, Points, RgbImage, Vector
from services.imaging.channels import luminance

STEP = 6
"""Gray levels of such an edge at least: a panel of a window on its ground."""
SHARP = 4
"""Times that the next differences on both sides are smaller: a blurred edge has one of half its size beside it."""
LONG = 0.15
"""Of the picture's width or height: a panel, a bar, a row of a table."""
SAMPLES = 400
"""Places along the picture that are looked at."""
FRAME = 4
"""Edges round a photo that was put on a ground of its own: a picture with more is a program's."""
SMOOTH_PX = 2
"""Width of a smoothed edge, and error of a corner that was found on it."""


def is_drawn(photo: RgbImage) -> bool:
    """Whether the picture (H, W, 3) is that of a program, as a screenshot is, and has no perspective."""
    rows = _count_steps(photo)
    columns = _count_steps(photo.swapaxes(0, 1)) if rows else 0
    return columns > 0 and rows + columns > FRAME


def drawn_box(photo: RgbImage, corners: Points | None) -> tuple[int, int, int, int]:
    """What is shown of a drawn picture (H, W, 3): left, top, right, bottom, pixels.

    All of it; or the box of the sheet's `corners` (N, 2) if there is nothing but one color beyond it.
    """
    height, width = photo.shape[:2]
    whole = (0, 0, width - 1, height - 1)
    if corners is None:
        return whole
    last = (width - 1, height - 1)
    left, top = np.clip(np.floor(corners.min(axis=0)) - SMOOTH_PX, 0, last).astype(int).tolist()
    right, bottom = np.clip(np.ceil(corners.max(axis=0)) + SMOOTH_PX, 0, last).astype(int).tolist()
    beyond = (
        photo[:top],
        photo[bottom + 1 :],
        photo[top : bottom + 1, :left],
        photo[top : bottom + 1, right + 1 :],
    )
    colors = np.array(
        [end for strip in beyond if strip.size for end in (strip.min((0, 1)), strip.max((0, 1)))]
    )
    return (left, top, right, bottom) if len(colors) and np.ptp(colors, axis=0).max() < STEP else whole


def _count_steps(photo: RgbImage) -> int:
    """Number of rows of a picture (H, W, 3) between which and the next one there is such an edge.

    Few places tell first whether there may be one: an edge that is long at `SAMPLES` places is at each eighth too.
    """
    return _count_at(photo, SAMPLES) if _count_at(photo, SAMPLES // 8, spared=1) else 0


def _count_at(photo: RgbImage, samples: int, spared: int = 0) -> int:
    """`_count_steps` by that many places, of which the longest run may lack `spared`."""
    seen = luminance(np.ascontiguousarray(photo[:, :: max(photo.shape[1] // samples, 1)]))
    step = cv2.absdiff(seen[1:], seen[:-1])
    aside = np.zeros_like(step)
    aside[1:] = step[:-1]
    np.maximum(aside[:-1], step[1:], out=aside[:-1])
    sharp = (step >= STEP) & (aside <= step // SHARP)
    return int(np.sum(_longest(sharp) + spared > LONG * seen.shape[1]))


def _longest(marked: Mask) -> Vector:
    """Length (N,) of the longest run of each row of `marked` (N, M), where it may be long."""
    likely = np.flatnonzero(marked.mean(axis=1) > LONG / 2)
    longest = np.zeros(len(marked))
    for row in likely:
        ends = np.flatnonzero(np.diff(np.concatenate([[False], marked[row], [False]]).astype(np.int8)))
        longest[row] = (ends[1::2] - ends[::2]).max()
    return longest

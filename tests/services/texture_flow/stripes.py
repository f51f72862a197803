"""Drawn lines of known direction: what a projection profile is made for."""

import numpy as np
from numpy.typing import NDArray


def draw_stripes(
    shape: tuple[int, int],
    angle_rad: float,
    period_px: float,
    share: float = 0.45,
    word_px: float | None = None,
) -> NDArray[np.float32]:
    """Dark (1) stripes on light (0), with edges one pixel soft, through the centre of the top-left pixel.

    With `word_px`, a fifth of each stripe is left out, in pieces of that length, at random.
    """
    y, x = np.mgrid[0 : shape[0], 0 : shape[1]]
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    line = (c * y - s * x) / period_px + 0.5
    from_line = np.abs(line % 1 - 0.5) * period_px
    ink = np.clip(share * period_px / 2 - from_line + 0.5, 0, 1)
    if word_px is not None:
        kept = np.random.default_rng(0).random((4096, 4096)) > 0.2
        ink *= kept[np.floor(line).astype(int), np.floor((c * x + s * y) / word_px).astype(int)]
    return ink.astype(np.float32)

"""What `mosaic` answers: the page, and for every photo and every pair of photos the evidence."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from services.arrays import RgbImage
from services.rectify.results import Notice, Orientation


@dataclass(frozen=True, slots=True, eq=False)
class Patch:
    """One photo, in the order of the upload.

    `mesh` is (rows, columns, 2): the mosaic point (x, y), pixels, of photo pixel
    (c (width-1)/(columns-1), r (height-1)/(rows-1)); `scale` is the mosaic's pixels per photo pixel in the middle of
    what the photo shows, and `sharpness` the mean gradient magnitude of its print, relative to the sharpest photo's
    (0-1]. All three are None for a photo that was not placed.
    """

    placed: bool
    mesh: NDArray[np.float64] | None = None
    scale: float | None = None
    sharpness: float | None = None


@dataclass(frozen=True, slots=True)
class Pair:
    """Two photos, `a` < `b`, that were found to overlap.

    `matches` counts the candidate feature matches, `votes` those in the largest compatible group (4.3),
    `runner_up_votes` those in the largest other one, `overlap_fraction` is the overlap's area over that of the smaller
    photo's view, `residual_px` the RMS distance of block matches after the global adjustment, in mosaic pixels.
    """

    a: int
    b: int
    matches: int
    votes: int
    runner_up_votes: int
    overlap_fraction: float
    residual_px: float


@dataclass(frozen=True, slots=True, eq=False)
class MosaicResult:
    """The whole page. `base` is the photo that the page was begun with; `unplaced` are indices of photos."""

    image: RgbImage
    base: int
    patches: tuple[Patch, ...]
    pairs: tuple[Pair, ...]
    unplaced: tuple[int, ...]
    orientation: Orientation
    warnings: tuple[Notice, ...] = ()
    timings_ms: dict[str, float] = field(default_factory=dict)

"""Result of a mosaic: the page, and evidence for every photo and every pair of photos."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from services.arrays import RgbImage
from services.contract.answers.mosaic import Pair, SheetCamera, SheetSurface
from services.notices import Notice
from services.rectify.results import Orientation


@dataclass(frozen=True, slots=True, eq=False)
class Patch:
    """One photo, in the order of the upload. The fields below are None for a photo that was not placed.

    Attributes
    ----------
    mesh : (rows, columns, 2) mosaic points (x, y), pixels, of photo pixels
        (c (width-1)/(columns-1), r (height-1)/(rows-1)).
    scale : mosaic pixels per photo pixel at the centre of the shown part.
    sharpness : mean gradient magnitude of its print relative to the sharpest photo, in (0, 1].
    covered_fraction : share of its part of the page that glare, a shadow or a finger hides, and another photo shows.
    camera : the photo's camera before the page's `surface`; None where each photo was flattened by itself.
    """

    placed: bool
    mesh: NDArray[np.float64] | None = None
    scale: float | None = None
    sharpness: float | None = None
    covered_fraction: float | None = None
    camera: SheetCamera | None = None


@dataclass(frozen=True, slots=True, eq=False)
class MosaicResult:
    """The whole page. `base` is the photo where the composition started; `unplaced` are indices of photos.

    `surface` is the bent sheet that all photos show; None where each was flattened by itself.
    """

    image: RgbImage
    base: int
    patches: tuple[Patch, ...]
    pairs: tuple[Pair, ...]
    unplaced: tuple[int, ...]
    orientation: Orientation
    warnings: tuple[Notice, ...] = ()
    timings_ms: dict[str, float] = field(default_factory=dict)
    surface: SheetSurface | None = None

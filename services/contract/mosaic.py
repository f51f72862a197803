"""What a caller may ask of /mosaic."""

from dataclasses import dataclass
from typing import Literal

from services.contract.images import ImageLimits
from services.contract.rectify import Illumination

Composition = Literal["selective", "average"]

FEWEST_PHOTOS = 2
MOST_PHOTOS = 16


@dataclass(frozen=True, slots=True)
class MosaicParameters:
    """Options of one mosaic; the HTTP contract's fields of the same names.

    `base` is the index of the photo whose part of the page is shown when the photos fall into parts that do not
    connect; None leaves the choice to the largest part.
    """

    rectify: bool = True
    base: int | None = None
    composition: Composition = "selective"
    illumination: Illumination = "normalize"
    upright: bool = True


@dataclass(frozen=True, slots=True)
class MosaicLimits:
    """What each photo of a mosaic may cost, and all of them together, which are in memory at once."""

    photo: ImageLimits
    max_megapixels: float

"""Options and limits of /mosaic."""

from dataclasses import dataclass
from typing import Literal

from services.contract.images import ImageLimits
from services.contract.rectify import Illumination, PageParameters, Rotation

Composition = Literal["selective", "average"]

FEWEST_PHOTOS = 2
MOST_PHOTOS = 16


@dataclass(frozen=True, slots=True)
class MosaicParameters(PageParameters):
    """Options of one mosaic.

    `base` is an index of a photo. When the photos form several parts that do not overlap, the mosaic shows the part
    with this photo. None: the largest part. `rotate` is the clockwise turn of the page in place of the one that
    `upright` finds.
    """

    rectify: bool = True
    base: int | None = None
    composition: Composition = "selective"
    illumination: Illumination = "normalize"
    rotate: Rotation | None = None


@dataclass(frozen=True, slots=True)
class MosaicLimits:
    """Limits of each photo of a mosaic, and of all photos together: they are in memory at the same time."""

    photo: ImageLimits
    max_megapixels: float

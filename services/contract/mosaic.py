"""Options and limits of /mosaic."""

from dataclasses import dataclass
from typing import Literal

from services.contract.cameras import CameraMemory
from services.contract.images import ImageLimits
from services.contract.rectify import Illumination, Rotation

Composition = Literal["selective", "average"]

FEWEST_PHOTOS = 2
MOST_PHOTOS = 16


@dataclass(frozen=True, slots=True)
class MosaicParameters:
    """Options of one mosaic. The fields have the names of the HTTP contract.

    `base` is an index of a photo. When the photos form several parts that do not overlap, the mosaic shows the part
    with this photo. None: the largest part. `text` reads the page in `language`. `camera` names the camera of all
    photos, None: each as EXIF names it; `cameras` are those that are remembered. `rotate` is the clockwise turn of the
    page in place of the one that `upright` finds. `keep_photo`: the reply has what later answers about the page need.
    """

    rectify: bool = True
    base: int | None = None
    composition: Composition = "selective"
    illumination: Illumination = "normalize"
    upright: bool = True
    text: bool = False
    language: str | None = None
    camera: str | None = None
    cameras: tuple[CameraMemory, ...] = ()
    rotate: Rotation | None = None
    keep_photo: bool = False


@dataclass(frozen=True, slots=True)
class MosaicLimits:
    """Limits of each photo of a mosaic, and of all photos together: they are in memory at the same time."""

    photo: ImageLimits
    max_megapixels: float

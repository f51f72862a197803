"""The steps of `mosaic`, in their order."""

from collections.abc import Sequence

from services.arrays import RgbImage
from services.errors import NotOverlapping
from services.mosaic.parameters import MosaicParameters
from services.mosaic.results import MosaicResult
from services.ocr.engine import OcrEngine


def mosaic(
    photos: Sequence[RgbImage],
    parameters: MosaicParameters,
    exif_focal_lengths_px: Sequence[float | None] | None = None,
    ocr: OcrEngine | None = None,
) -> MosaicResult:
    """The one page that `photos`, each (H, W, 3), show parts of.

    Raises
    ------
    InvalidOption
        When there are too few or too many photos, or the base is none of them.
    NoText
        When fewer than two of the photos show enough printed text; the detail names the others.
    NotOverlapping
        When no two of them show the same part of a page.
    """
    raise NotOverlapping("photos are not registered yet.")

"""The steps of `rectify`, in their order."""

import numpy as np

from services.arrays import RgbImage
from services.ocr.engine import OcrEngine
from services.rectify.parameters import RectifyParameters
from services.rectify.results import CameraEstimate, Evidence, Orientation, PlaneSurface, RectifyResult


def rectify(
    photo: RgbImage,
    parameters: RectifyParameters,
    exif_focal_length_px: float | None = None,
    ocr: OcrEngine | None = None,
) -> RectifyResult:
    """Frontal flat view of the page in `photo` (H, W, 3) RGB.

    Raises
    ------
    NoText
        When the photo shows too little printed text to see the page's shape.
    InvalidOption
        When `parameters` cannot be met (for example a region outside of the photo).
    """
    height, width = photo.shape[:2]
    grid = np.stack(np.meshgrid(np.linspace(0, width - 1, 3), np.linspace(0, height - 1, 3)), axis=-1)
    return RectifyResult(
        photo,
        "planar",
        Evidence(None, None, 0.0),
        CameraEstimate(None, None, "unknown"),
        PlaneSurface(None),
        Orientation(0, False, None),
        grid,
    )

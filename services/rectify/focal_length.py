"""What is known of a photo's focal length beforehand: from the client, from EXIF, or of a typical camera."""

import numpy as np

from services.geometry.focal_prior import FocalPrior, typical_focal_prior
from services.geometry.photo_frame import PhotoFrame
from services.imaging.exif import DiagonalFocalLength

GIVEN_DEVIATION = 0.003
EXIF_DEVIATION = 0.03
"""EXIF's 35 mm equivalent is rounded to whole millimetres, and the crop by video stabilisation is not recorded."""


def focal_prior(frame: PhotoFrame, given_px: float | None, exif_px: float | None) -> FocalPrior:
    """The client's focal length, else that of EXIF, else that of a typical camera."""
    if given_px is not None:
        return FocalPrior(float(np.log(given_px / frame.unit_px)), GIVEN_DEVIATION, "given")
    if exif_px is not None:
        of_diagonal = isinstance(exif_px, DiagonalFocalLength)
        return FocalPrior(float(np.log(exif_px / frame.unit_px)), EXIF_DEVIATION, "exif", of_diagonal)
    return typical_focal_prior()

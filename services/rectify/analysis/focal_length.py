"""What is known of a photo's focal length beforehand: from the client, from EXIF, or of a typical camera."""

import numpy as np

from services.contract.cameras import CLEAR_DEVIATION, FEWEST_PHOTOS, CameraMemory, find_camera
from services.contract.rectify import RectifyParameters
from services.geometry.focal_prior import FocalPrior, typical_focal_prior
from services.geometry.photo_frame import PhotoFrame
from services.imaging.exif import DiagonalFocalLength
from services.rectify.results import CameraEstimate

GIVEN_DEVIATION = 0.003
EXIF_DEVIATION = 0.03
"""EXIF's 35 mm equivalent is rounded to whole millimetres, and the crop by video stabilisation is not recorded."""


def remembered(parameters: RectifyParameters) -> CameraMemory | None:
    """What is remembered of the camera that `parameters` name."""
    return find_camera(parameters.cameras, parameters.camera)


def requested_prior(frame: PhotoFrame, parameters: RectifyParameters, exif_px: float | None) -> FocalPrior:
    """What a request and the EXIF data of its photo say of the focal length."""
    return focal_prior(frame, parameters.focal_length_px, exif_px, remembered(parameters))


def focal_prior(
    frame: PhotoFrame, given_px: float | None, exif_px: float | None, memory: CameraMemory | None = None
) -> FocalPrior:
    """The client's focal length, else the more precise one of EXIF and `memory`, else that of a typical camera."""
    if given_px is not None:
        return FocalPrior(float(np.log(given_px / frame.unit_px)), GIVEN_DEVIATION, "given")
    is_known = memory is not None and memory.photos >= FEWEST_PHOTOS
    if memory is not None and is_known and (exif_px is None or memory.deviation < EXIF_DEVIATION):
        return FocalPrior(memory.log_focal, memory.deviation, "remembered", True)
    if exif_px is not None:
        of_diagonal = isinstance(exif_px, DiagonalFocalLength)
        return FocalPrior(float(np.log(exif_px / frame.unit_px)), EXIF_DEVIATION, "exif", of_diagonal)
    return typical_focal_prior()


def seen_focal_length(
    frame: PhotoFrame, camera: CameraEstimate, parameters: RectifyParameters, exif_px: float | None
) -> tuple[float, float] | None:
    """Focal length (px) that the page alone shows, and the standard deviation of its logarithm; None if not clearly.

    The fit lies between the page's focal length and the prior's, inversely to their variances.
    """
    own = camera.log_focal_deviation
    if own is None or own > CLEAR_DEVIATION or camera.focal_length_px is None:
        return None
    if camera.principal_point_source != "centre" or camera.source == "given":
        return None
    prior = typical_focal_prior()
    if camera.source != "estimated":
        prior = requested_prior(frame, parameters, exif_px)
    found = float(np.log(camera.focal_length_px / frame.unit_px))
    alone = found + (found - prior.log_focal) * (own / prior.deviation) ** 2
    if abs(alone - found) > CLEAR_DEVIATION:
        return None
    return float(np.exp(alone)) * frame.unit_px, own

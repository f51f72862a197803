"""Options of a rectification that can only be checked against the photo."""

import numpy as np

from services.contract.rectify import RectifyParameters
from services.errors import InvalidOption


def check_parameters(width: int, height: int, parameters: RectifyParameters) -> None:
    """Check the focal length and the region against the size of the photo.

    Raises
    ------
    InvalidOption
        When the focal length is not plausible, or the region lies outside of the photo.
    """
    diagonal = float(np.hypot(width, height))
    if parameters.focal_length_px is not None and not 0.15 < parameters.focal_length_px / diagonal < 15.0:
        raise InvalidOption(
            f"focal_length_px: {parameters.focal_length_px:g} is not believable for a photo of {width} x {height} "
            f"pixels; expected {0.15 * diagonal:.0f} to {15 * diagonal:.0f}.",
            "focal_length_px",
        )
    if parameters.region is not None:
        corners = np.array(parameters.region)
        beside = (corners.max(axis=0) < 0).any() or (corners.min(axis=0) > [width - 1, height - 1]).any()
        if beside:
            raise InvalidOption("region: the polygon lies outside of the photo.", "region")

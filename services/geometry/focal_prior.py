"""What is known of the focal length before the page is seen."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from services.geometry.camera import TYPICAL_FOCAL_LENGTH

FocalLengthSource = Literal["estimated", "exif", "given", "assumed", "remembered"]

MAX_FOCAL, MIN_FOCAL = 12.0, 0.35
"""Bounds of a believable focal length over half the diagonal: 9 to 160 degrees of view (diagonal)."""
TYPICAL_DEVIATION = 0.25
"""Main cameras of phones lie within one deviation (22 to 36 mm equivalent), most others within two."""


@dataclass(frozen=True, slots=True)
class FocalParameters:
    """When a focal length that a page shows is accepted, for every shape of page."""

    believable: float = 3.5
    """Deviations of the prior. A focal length further from the typical one comes from a page that is not quite flat, or
    from sides that are not those of a rectangle, not from a rare lens."""
    held_deviation: float = 0.08
    """Deviation of the logarithm under the narrow prior that keeps the typical focal length in that case."""
    exif_contradiction: float = 3.0
    """Deviations of the prior. If the page shows a focal length further from EXIF's, the photo was cropped or zoomed
    later."""
    seen_deviation: float = 0.25
    """The focal length is called estimated when the page alone fixes its logarithm better than this."""


FOCAL = FocalParameters()


MEASURED = ("exif", "remembered")
"""Sources of a prior that a page may contradict: the photo was cropped or zoomed."""


@dataclass(frozen=True, slots=True)
class FocalPrior:
    """What is known of the focal length beforehand: its logarithm (unit: half diagonal) and the deviation of that."""

    log_focal: float
    deviation: float
    source: FocalLengthSource
    of_diagonal: bool = False
    """The focal length is known as a multiple of the diagonal of the photo as it was taken, before any cropping."""

    def source_beside(self, seen_deviation: float) -> FocalLengthSource:
        """Source of a fitted focal length that the page alone shows with this deviation of its logarithm."""
        seen = self.source == "assumed" and seen_deviation < FOCAL.seen_deviation
        return "estimated" if seen else self.source


def typical_focal_prior() -> FocalPrior:
    """What is known of a camera that is not known."""
    return FocalPrior(float(np.log(2 * TYPICAL_FOCAL_LENGTH)), TYPICAL_DEVIATION, "assumed", True)

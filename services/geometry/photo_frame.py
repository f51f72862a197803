"""The frame of a photo's pixels, and the centred unit coordinates that geometry is done in."""

from dataclasses import dataclass, replace

import numpy as np

from services.arrays import Homography, Points
from services.geometry.homographies import scaling, translation


@dataclass(frozen=True, slots=True, eq=False)
class PhotoFrame:
    """The photo's own frame and the one that geometry is done in: centred, half the diagonal as unit.

    `principal_point_px` is None where it is the photo's middle.
    """

    width: int
    height: int
    principal_point_px: tuple[float, float] | None = None

    @property
    def centre(self) -> tuple[float, float]:
        """Principal point in pixels."""
        return self.principal_point_px or ((self.width - 1) / 2, (self.height - 1) / 2)

    @property
    def unit_px(self) -> float:
        """Half the diagonal in pixels."""
        return float(np.hypot(self.width, self.height)) / 2

    @property
    def H_photo_centred(self) -> Homography:
        """From centred unit coordinates to photo pixels."""
        return translation(*self.centre) @ scaling(self.unit_px)

    def to_centred(self, photo: Points) -> Points:
        """Centred unit coordinates (N, 2) of photo pixels (N, 2)."""
        return np.asarray((photo - self.centre) / self.unit_px)

    def to_photo(self, centred: Points) -> Points:
        """Photo pixels (N, 2) of centred unit coordinates (N, 2)."""
        return np.asarray(centred * self.unit_px + self.centre)

    def moved(self, offset: tuple[float, float]) -> "PhotoFrame":
        """The frame whose origin lies at `offset`, in centred units of this one."""
        x, y = self.centre
        at = (x + offset[0] * self.unit_px, y + offset[1] * self.unit_px)
        return replace(self, principal_point_px=at)

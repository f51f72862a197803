"""The view of a page through a part of the photo that its shape was found in."""

from dataclasses import dataclass, replace

import numpy as np

from services.arrays import Homography, Points
from services.geometry.homographies import transform_points
from services.geometry.page_frame import Frame


@dataclass(frozen=True, slots=True, eq=False)
class PartFrame:
    """View of a page through a part of the photo whose view `whole` is: own pixels -> its pixels -> it -> the part."""

    whole: Frame
    H_part_photo: Homography
    H_page_flat: Homography
    width: int
    height: int

    @property
    def H_photo_flat(self) -> Homography | None:
        """See `Frame`."""
        H = self.whole.H_photo_flat
        return None if H is None else self.H_part_photo @ H @ self.H_page_flat

    def to_photo(self, pixels: Points) -> Points:
        """See `Frame`."""
        seen = self.whole.to_photo(transform_points(self.H_page_flat, pixels))
        return transform_points(self.H_part_photo, seen)

    def to_flat(self, photo: Points) -> Points:
        """See `Frame`."""
        seen = self.whole.to_flat(transform_points(np.linalg.inv(self.H_part_photo), photo))
        return transform_points(np.linalg.inv(self.H_page_flat), seen)

    def through(self, H_old_new: Homography, width: int, height: int) -> "PartFrame":
        """See `Frame`."""
        return replace(self, H_page_flat=self.H_page_flat @ H_old_new, width=width, height=height)

"""Interface of page models: the map between the flat page and the photo."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from services.arrays import Floats, Homography, Points
from services.geometry.homographies import jacobians, transform_points


class PageMap(Protocol):
    """One-to-one map between the flat page and the photo.

    Photo points are in centred unit coordinates (relative to the principal point, half the diagonal as unit).
    Page points are (u, v): u along the text lines, v across them downwards, in a unit of the model's own choice.
    """

    def to_photo(self, page: Points) -> Points:
        """Photo points (N, 2) of page points (N, 2); NaN where the page is not visible or the model ends."""

    def to_page(self, centred: Points) -> Points:
        """Page points (N, 2) of photo points (N, 2); NaN where the model ends."""

    def jacobians(self, centred: Points) -> Floats:
        """Derivatives (N, 2, 2) d page / d photo at photo points (N, 2)."""


@dataclass(frozen=True, slots=True, eq=False)
class PlaneMap:
    """The map of a planar page, a homography."""

    H_centred_page: Homography

    def to_photo(self, page: Points) -> Points:
        """See `PageMap`."""
        return transform_points(self.H_centred_page, page)

    def to_page(self, centred: Points) -> Points:
        """See `PageMap`."""
        return transform_points(np.linalg.inv(self.H_centred_page), centred)

    def jacobians(self, centred: Points) -> Floats:
        """See `PageMap`."""
        return jacobians(np.linalg.inv(self.H_centred_page), centred)

"""What every model of the page's shape offers: the way between the flat page and the photo."""

from typing import Protocol

from services.arrays import Floats, Points


class PageMap(Protocol):
    """One-to-one map between the flat page and the photo.

    Photo points are in centred unit coordinates (relative to the principal point, half the diagonal as unit).
    Page points are (u, v): u along the text lines, v across them downwards, in a unit of the model's own choice.
    """

    def to_photo(self, page: Points) -> Points:
        """Photo points (N, 2) of page points (N, 2); NaN where the page cannot be seen or the model ends."""
        ...

    def to_page(self, centred: Points) -> Points:
        """Page points (N, 2) of photo points (N, 2); NaN where the model ends."""
        ...

    def jacobians(self, centred: Points) -> Floats:
        """Derivatives (N, 2, 2) d page / d photo at photo points (N, 2)."""
        ...

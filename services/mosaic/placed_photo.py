"""A flat view with its placement on the mosaic and its tones."""

from dataclasses import dataclass

from services.arrays import Points
from services.mosaic.flat_photo import FlatPhoto
from services.mosaic.light.hidden_parts import HiddenPart
from services.mosaic.light.tones import ToneMap
from services.mosaic.placing.placement import Placement


@dataclass(frozen=True, slots=True, eq=False)
class PlacedPhoto:
    """Input of the composition for one photo.

    `hidden` is None where no other photo shows the same places; `yielding` is what is left to a photo that disagrees.
    """

    flat: FlatPhoto
    placement: Placement
    tones: ToneMap
    hidden: HiddenPart | None = None
    yielding: HiddenPart | None = None

    def to_photo(self, mosaic: Points) -> Points:
        """Photo pixels (N, 2) of mosaic pixels (N, 2)."""
        return self.flat.to_photo(self.placement.to_flat(mosaic))

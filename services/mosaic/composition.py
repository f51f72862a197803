"""One page of many patches (4.4)."""

from dataclasses import dataclass

from services.arrays import RgbImage


@dataclass(frozen=True, slots=True, eq=False)
class ComposedPage:
    """The page (H, W, 3), white where no photo shows it, and the sharpness of each photo's print, in their order.

    Sharpness is relative to the sharpest photo's: 0-1, 0 where a photo shows no print.
    """

    image: RgbImage
    sharpness: tuple[float, ...]

"""A part of a photo, reduced and in even light, with its place in the photo."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from services.arrays import GrayImage, Points
from services.geometry.homographies import from_resized
from services.imaging.illumination import flatten_part
from services.imaging.reduction import reduce_image


@dataclass(frozen=True, slots=True, eq=False)
class PhotoPart:
    """The flat-fielded part `image` (h, w) of a photo, from photo pixel `origin` (x, y) on, resized by `factor`."""

    image: GrayImage
    factor: float
    origin: tuple[int, int]

    def to_photo(self, points: Points) -> Points:
        """Photo pixels (N, 2) of pixels (N, 2) of this image."""
        return from_resized(points, self.factor) + self.origin


def cut_part(
    gray: GrayImage, light: GrayImage, first: NDArray[np.intp], last: NDArray[np.intp], factor: float
) -> PhotoPart:
    """The part of the photo `gray` (H, W) from pixel `first` (x, y) to before `last`, resized by `factor`.

    `light` is the photo's `reduced_light`.
    """
    part = reduce_image(gray[first[1] : last[1], first[0] : last[0]], factor)
    # Pixel u of the part shows the photo's (u + 1/2) / factor - 1/2 + first, and the light likewise.
    x, y = (np.array(light.shape) / gray.shape)[::-1]
    light_from_part = np.array(
        [
            [x / factor, 0.0, (0.5 / factor + first[0]) * x - 0.5],
            [0.0, y / factor, (0.5 / factor + first[1]) * y - 0.5],
        ]
    )
    return PhotoPart(flatten_part(part, light, light_from_part), factor, (int(first[0]), int(first[1])))

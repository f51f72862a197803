"""Pages whose pixels are not square, as those of a fax at 204 x 98 dpi: their pixels are made square.

Everything that follows measures angles and proportions of print. The axis of lower resolution is enlarged, so that
nothing is lost; only where the image would become too large, the other one is reduced.
"""

import cv2
import numpy as np

from services.contract.images import ImageLimits
from services.imaging.page_images import PagePicture


def square_pixels(picture: PagePicture, limits: ImageLimits | None = None) -> PagePicture:
    """`picture` with square pixels; `stretch` says how they lie in those of the file, `dpi` is their resolution."""
    limits = limits or ImageLimits()
    aspect = picture.pixel_aspect
    if aspect == 1.0:
        return picture
    height, width = picture.pixels.shape[:2]
    stretch = (aspect, 1.0) if aspect > 1 else (1.0, 1 / aspect)
    larger = max(width * stretch[0], height * stretch[1])
    if width * height * max(stretch) > limits.max_pixels or larger > limits.max_side_px:
        stretch = (stretch[0] / max(stretch), stretch[1] / max(stretch))
    size = max(round(width * stretch[0]), 1), max(round(height * stretch[1]), 1)
    interpolation = cv2.INTER_CUBIC if min(stretch) >= 1 else cv2.INTER_AREA
    pixels = np.asarray(cv2.resize(picture.pixels, size, interpolation=interpolation), np.uint8)
    dpi = None if picture.dpi is None else picture.dpi * min(stretch)
    exact = (size[0] / width, size[1] / height)
    return picture._replace(
        pixels=pixels, dpi=dpi, pixel_aspect=1.0, stretch=exact, full_size=picture.size, focal_length_px=None
    )

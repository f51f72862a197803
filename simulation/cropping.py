"""Photos that were cut: the principal point is no longer in their middle."""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from simulation.camera import Camera
from simulation.photo import SimulatedPhoto

_FILM_DIAGONAL_MM = 43.2666


@dataclass(frozen=True, slots=True)
class Cut:
    """What was cut away: a share of the photo's width or height, from one side."""

    side: Literal["left", "right", "top", "bottom"]
    share: float


def crop_photo(photo: SimulatedPhoto, cut: Cut) -> SimulatedPhoto:
    """The photo less a strip at one side; its Exif directory stayed as it was.

    `exif_focal_length_px` is what a reader of its FocalLengthIn35mmFilm, a whole number of millimetres, takes
    the focal length for: it is counted in diagonals, and the diagonal is now shorter.
    """
    camera = photo.truth.camera
    width, height = camera.width, camera.height
    across = round(cut.share * width) if cut.side in ("left", "right") else 0
    down = round(cut.share * height) if cut.side in ("top", "bottom") else 0
    left, top = (across if cut.side == "left" else 0), (down if cut.side == "top" else 0)
    image = np.ascontiguousarray(photo.image[top : top + height - down, left : left + width - across])
    (x, y), middle = camera.principal_point, np.array([width - across - 1, height - down - 1]) / 2.0
    offset = (float(x - left - middle[0]), float(y - top - middle[1]))
    cropped = Camera(camera.focal_length_px, width - across, height - down, offset)
    film_mm = round(camera.focal_length_px / np.hypot(width, height) * _FILM_DIAGONAL_MM)
    told = film_mm / _FILM_DIAGONAL_MM * float(np.hypot(cropped.width, cropped.height))
    return SimulatedPhoto(image, replace(photo.truth, camera=cropped), told)

"""Flat views and photos of one set page, cut out where the truth is known."""

import functools

import cv2
import numpy as np

from services.arrays import Homography, RgbImage
from services.geometry.homographies import translation
from services.mosaic.flat_photo import FlatPhoto
from services.mosaic.flattening import view_photo
from services.sheet.plane.framing import FlatFrame
from simulation.flat_page import Page
from simulation.pages import own_pages


@functools.cache
def set_page(number: int = 0) -> Page:
    """One of five pages, 1000 x 1560 pixels, 40 characters to the line."""
    return own_pages(1000, 1560)[number]


def page_image(number: int = 0) -> RgbImage:
    """(1560, 1000, 3)."""
    return np.ascontiguousarray(np.repeat(set_page(number).image[..., None], 3, axis=2))


def photograph(page: RgbImage, H_photo_page: Homography, width: int, height: int) -> RgbImage:
    """(height, width, 3): what a pin-hole camera sees of a flat page on white."""
    photo = cv2.warpPerspective(
        page, H_photo_page, (width, height), flags=cv2.INTER_CUBIC, borderValue=(255.0,) * 3
    )
    return np.asarray(photo, np.uint8)


def look_at(
    centre: tuple[float, float], tilt_deg: float, azimuth_deg: float, scale: float, width: int, height: int
) -> Homography:
    """H_photo_page of a pin-hole camera (f = 1.3 half diagonals) that leans over the page's point `centre`."""
    tilt, azimuth = np.radians([tilt_deg, azimuth_deg])
    axis = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    K = np.array([[0.0, -axis[2], axis[1]], [axis[2], 0.0, -axis[0]], [-axis[1], axis[0], 0.0]])
    R = np.eye(3) + np.sin(tilt) * K + (1 - np.cos(tilt)) * K @ K
    focal = 1.3 * 0.5 * float(np.hypot(width, height))
    camera = np.array([[focal, 0.0, (width - 1) / 2], [0.0, focal, (height - 1) / 2], [0.0, 0.0, 1.0]])
    plane = np.column_stack([R[:, 0], R[:, 1], [0.0, 0.0, focal / scale]])
    return np.asarray(camera @ plane @ translation(-centre[0], -centre[1]))


def cut_view(
    page: RgbImage, left: int, top: int, width: int, height: int, index: int = 0, text_height_px: float = 12.0
) -> FlatPhoto:
    """The flat view of a photo that shows a box of the page, pixel for pixel."""
    photo = photograph(page, translation(-left, -top), width, height)
    return view_photo(index, photo, FlatFrame(np.eye(3), width, height), text_height_px, 100.0)

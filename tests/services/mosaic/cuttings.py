"""A page cut into photos whose place is known exactly."""

from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np

from services.arrays import GrayImage, Homography, RgbImage
from services.geometry.homographies import translation
from services.mosaic.flat_photo import FlatPhoto
from services.mosaic.light.tones import ToneMap
from services.mosaic.placed_photo import PlacedPhoto
from services.mosaic.placing.placement import Placement
from services.sheet.plane.framing import FlatFrame
from simulation.flat_page import Page
from simulation.pages import own_pages

TEXT_HEIGHT_PX = 20.0
"""Of the pages' body, 26 px, from the descender's to the ascender's end of most words."""


@cache
def identity_tones(width: int, height: int) -> ToneMap:
    """The map that changes nothing."""
    return ToneMap(np.array([[[1, 1, 1, 1, 0, 0]]], np.float32), width, height)


def prose() -> Page:
    """Two paragraphs' worth of a page, 1000 x 700."""
    return own_pages(1000, 700)[0]


def in_color(gray: GrayImage) -> RgbImage:
    """The same on a sheet a little off white."""
    return np.asarray(np.clip(gray[..., None] * np.array([0.95, 0.93, 0.88]) + 5, 0, 255), np.uint8)


@dataclass(frozen=True, slots=True)
class Box:
    """Page pixels, ends excluded."""

    left: int
    top: int
    right: int
    bottom: int

    def holds(self, box: tuple[float, float, float, float], margin: float = 0.0) -> bool:
        """Whether a word's box lies within, `margin` away from the border."""
        x0, y0, x1, y1 = box
        inside = x0 >= self.left + margin and y0 >= self.top + margin
        return inside and x1 <= self.right - 1 - margin and y1 <= self.bottom - 1 - margin


def cut(
    page: RgbImage,
    box: Box,
    *,
    index: int = 0,
    blur_px: float = 0.0,
    gain: float = 1.0,
    noise: float = 0.0,
    shift: tuple[float, float] = (0.0, 0.0),
) -> PlacedPhoto:
    """The part of `page` within `box` as a photo of its own, placed `shift` beside where it belongs."""
    photo = page[box.top : box.bottom, box.left : box.right].astype(np.float32) * gain
    if blur_px:
        photo = cv2.GaussianBlur(photo, (0, 0), blur_px)
    if noise:
        photo = photo + np.random.default_rng(index).normal(0, noise, photo.shape)
    return place(
        np.clip(photo + 0.5, 0, 255).astype(np.uint8),
        translation(box.left + shift[0], box.top + shift[1]),
        index,
    )


def place(photo: RgbImage, H_mosaic_photo: Homography, index: int = 0) -> PlacedPhoto:
    """A photo that is flat already."""
    height, width = photo.shape[:2]
    gray = np.asarray(cv2.cvtColor(photo, cv2.COLOR_RGB2GRAY), np.uint8)
    shown = np.ones(gray.shape, bool)
    frame = FlatFrame(np.eye(3), width, height)
    flat = FlatPhoto(index, photo, frame, gray, shown, TEXT_HEIGHT_PX, 1.0, 100.0)
    return PlacedPhoto(flat, Placement(H_mosaic_photo), identity_tones(width, height))

"""Flat views drawn from set pages by known homographies, as imperfect photos would give them."""

import functools
from dataclasses import dataclass

import cv2
import numpy as np

from services.arrays import GrayImage, Homography, Points
from services.geometry.homographies import scaling, transform_points, translation
from services.mosaic.flat_photo import FlatPhoto
from services.mosaic.registration.reduced_view import quarter_turn
from services.sheet.plane.framing import FlatFrame
from simulation.pages import own_pages

WIDTH, HEIGHT = 1200, 1875
TEXT_HEIGHT_PX = 24.0


@functools.cache
def page(number: int = 0) -> GrayImage:
    """One of five pages (1875, 1200); 0 and 3 are set in the same type."""
    return np.asarray(own_pages(WIDTH, HEIGHT)[number].image, np.uint8)


@dataclass(frozen=True)
class Flaws:
    """Of one view's sharpness and light."""

    blur_px: float = 0.5
    noise: float = 3.0
    gain: float = 1.0
    seed: int = 0


def draw_view(
    paper: GrayImage,
    H_page_flat: Homography,
    size: tuple[int, int],
    index: int = 0,
    flaws: Flaws | None = None,
    turns: int = 0,
) -> FlatPhoto:
    """The view of `size` whose pixel p shows the page at `H_page_flat` p; then turned by quarters."""
    flaws = flaws or Flaws()
    warp = cv2.WARP_INVERSE_MAP
    # Twice as fine, then blurred and reduced: the view is sampled as a sensor does.
    H_page_double = H_page_flat @ np.array([[0.5, 0, -0.25], [0, 0.5, -0.25], [0, 0, 1.0]])
    double = 2 * size[0], 2 * size[1]
    drawn = cv2.warpPerspective(paper, H_page_double, double, flags=cv2.INTER_CUBIC | warp, borderValue=255)
    drawn = cv2.GaussianBlur(drawn, (0, 0), 2 * max(flaws.blur_px, 0.2))
    drawn = cv2.resize(drawn, size, interpolation=cv2.INTER_AREA).astype(np.float64)
    noise = np.random.default_rng(flaws.seed).normal(0, flaws.noise, drawn.shape)
    gray = np.clip(255 - flaws.gain * (255 - drawn) + noise, 0, 255).astype(np.uint8)
    shown = cv2.warpPerspective(np.ones_like(paper), H_page_flat, size, flags=cv2.INTER_NEAREST | warp) > 0
    gray[~shown] = 255
    H_flat_turned = np.linalg.inv(quarter_turn(turns, *size))
    gray, shown = np.rot90(gray, turns).copy(), np.rot90(shown, turns).copy()
    scale = float(np.sqrt(np.linalg.det(H_page_flat[:2, :2])))
    return FlatPhoto(
        index,
        np.repeat(gray[..., None], 3, axis=2),
        FlatFrame(H_page_flat @ H_flat_turned, gray.shape[1], gray.shape[0]),
        gray,
        shown,
        TEXT_HEIGHT_PX / scale,
        1.0,
        1000.0,
    )


def part(left: float, top: float, scale: float = 1.0, tilt: tuple[float, ...] = (0, 0, 0, 0)) -> Homography:
    """H_page_flat of a view from (left, top) on; `scale` page pixels per flat pixel; `tilt` (shear, shear, g, h)."""
    rest = np.array([[1.0, tilt[0], 0], [tilt[1], 1.0, 0], [tilt[2] * 1e-5, tilt[3] * 1e-5, 1.0]])
    return translation(left, top) @ scaling(scale) @ rest


def true_homography(a: FlatPhoto, b: FlatPhoto) -> Homography:
    """Flat pixels of b -> flat pixels of a; the frames of drawn views lead to the page."""
    H = np.linalg.inv(_H_page(a)) @ _H_page(b)
    return H / H[2, 2]


def overlap_points(a: FlatPhoto, b: FlatPhoto) -> Points:
    """Pixels (N, 2) of b that both views show, by the truth."""
    width, height = b.size
    x, y = np.meshgrid(np.linspace(0, width - 1, 40), np.linspace(0, height - 1, 40))
    points = np.stack([x.ravel(), y.ravel()], axis=1)
    there = transform_points(true_homography(a, b), points)
    return points[(there >= 0).all(axis=1) & (there <= np.array(a.size) - 1).all(axis=1)]


def registration_error(a: FlatPhoto, b: FlatPhoto, H_a_b: Homography) -> float:
    """RMS distance over the overlap, pixels of a."""
    points = overlap_points(a, b)
    apart = transform_points(H_a_b, points) - transform_points(true_homography(a, b), points)
    return float(np.sqrt(np.mean(np.sum(apart**2, axis=1))))


def _H_page(photo: FlatPhoto) -> Homography:
    frame = photo.frame
    assert isinstance(frame, FlatFrame)
    return frame.H_photo_flat

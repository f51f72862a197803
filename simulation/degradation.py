"""What the dissertation's photos were spared: a desk, shadow, vignetting, blur, noise, JPEG."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

RgbImage = NDArray[np.uint8]
"""(H, W, 3) uint8, RGB."""


@dataclass(frozen=True, slots=True)
class Degradation:
    """How a photo is spoiled, in the order of the fields; the defaults spoil nothing.

    shadow: share of the light that a soft-edged shadow takes away where it is deepest, 0-1.
    vignetting: share of the light that is missing at the image's corners, 0-1; it grows as radius squared.
    blur_sigma_px: Gaussian blur of the optics.
    motion_px: length of a straight smear in a random direction.
    noise_sigma: white noise of the sensor, gray values, drawn for every channel.
    jpeg_quality: 1-100, or None for no compression.
    """

    shadow: float = 0.0
    vignetting: float = 0.0
    blur_sigma_px: float = 0.0
    motion_px: float = 0.0
    noise_sigma: float = 0.0
    jpeg_quality: int | None = None

    def __post_init__(self) -> None:
        if not (0 <= self.shadow <= 1 and 0 <= self.vignetting <= 1):
            raise ValueError("shadow and vignetting are shares, 0 to 1")
        if min(self.blur_sigma_px, self.motion_px, self.noise_sigma) < 0:
            raise ValueError("blur, motion and noise cannot be negative")
        if self.jpeg_quality is not None and not 1 <= self.jpeg_quality <= 100:
            raise ValueError("JPEG quality is 1 to 100")


@dataclass(frozen=True, slots=True)
class Exposure:
    """What light and camera make of a scene's brightness, in the order of the fields; the defaults change nothing.

    slant: share of the light, -1 to 1, that is added at the right and at the lower border and taken away opposite.
    gain: brightness as a whole (1 keeps white paper white; more clips it).
    balance: gains of red, green and blue.
    gamma: exponent that brightness in 0-1 is raised to.
    """

    slant: tuple[float, float] = (0.0, 0.0)
    gain: float = 1.0
    balance: tuple[float, float, float] = (1.0, 1.0, 1.0)
    gamma: float = 1.0

    def __post_init__(self) -> None:
        if self.gain <= 0 or self.gamma <= 0 or min(self.balance) <= 0 or max(map(abs, self.slant)) >= 1:
            raise ValueError("gains and gamma are positive, and slanted light takes less than all away")


def expose(image: RgbImage, exposure: Exposure) -> RgbImage:
    """The image (H, W, 3) under another light."""
    height, width = image.shape[:2]
    across = np.linspace(-exposure.slant[0], exposure.slant[0], width, dtype=np.float32)
    down = np.linspace(-exposure.slant[1], exposure.slant[1], height, dtype=np.float32)[:, None]
    light = (1.0 + across + down) * np.float32(exposure.gain / 255.0)
    values = image.astype(np.float32) * np.maximum(light, 0.0)[..., None]
    values *= np.array(exposure.balance, np.float32)
    values = np.clip(values, 0, 1) ** np.float32(exposure.gamma)
    return np.asarray(np.clip(values * 255.0 + 0.5, 0, 255), np.uint8)


PHONE = Degradation(shadow=0.45, vignetting=0.25, blur_sigma_px=0.7, noise_sigma=4.0, jpeg_quality=85)
"""A hasty phone photo under a lamp, still well legible."""


def degrade(image: RgbImage, degradation: Degradation, rng: np.random.Generator) -> RgbImage:
    """Spoil a photo; the same generator state gives the same photo."""
    height, width = image.shape[:2]
    light = shadow_field(width, height, degradation.shadow, rng) if degradation.shadow else None
    if degradation.vignetting:
        fall = 1.0 - degradation.vignetting * _radius_squared(width, height)
        light = fall if light is None else light * fall
    spoilt = image
    if light is not None or degradation.blur_sigma_px or degradation.motion_px or degradation.noise_sigma:
        values = image.astype(np.float32)
        if light is not None:
            values *= light[..., None]
        if degradation.blur_sigma_px:
            values = np.asarray(cv2.GaussianBlur(values, (0, 0), degradation.blur_sigma_px), np.float32)
        if degradation.motion_px:
            kernel = _motion_kernel(degradation.motion_px, rng.uniform(0, np.pi))
            values = np.asarray(cv2.filter2D(values, -1, kernel), np.float32)
        if degradation.noise_sigma:
            values += rng.standard_normal(values.shape, np.float32) * np.float32(degradation.noise_sigma)
        spoilt = np.clip(values + 0.5, 0, 255).astype(np.uint8)
    return spoilt if degradation.jpeg_quality is None else _through_jpeg(spoilt, degradation.jpeg_quality)


def shadow_field(width: int, height: int, strength: float, rng: np.random.Generator) -> NDArray[np.float32]:
    """Light (H, W) in 1 - strength .. 1: a wavy soft edge at a random place and direction."""
    angle = rng.uniform(0, 2 * np.pi)
    offset = rng.uniform(-0.25, 0.25)
    softness = rng.uniform(0.03, 0.15)
    wave, phase, waves = rng.uniform(0.02, 0.08), rng.uniform(0, 2 * np.pi), rng.uniform(1.0, 3.0)
    scale = np.float32(1.0 / max(width, height))
    x = (np.arange(width, dtype=np.float32) - width / 2) * scale
    y = (np.arange(height, dtype=np.float32)[:, None] - height / 2) * scale
    across = x * np.float32(np.cos(angle)) + y * np.float32(np.sin(angle))
    along = y * np.float32(np.cos(angle)) - x * np.float32(np.sin(angle))
    edge = (
        across
        - np.float32(offset)
        - np.float32(wave) * np.sin(along * np.float32(2 * np.pi * waves) + np.float32(phase))
    )
    ramp = np.clip(edge / np.float32(softness) + 0.5, 0, 1)
    return np.asarray(1.0 - np.float32(strength) * ramp * ramp * (3 - 2 * ramp), np.float32)


def desk_texture(width: int, height: int, rng: np.random.Generator) -> RgbImage:
    """A wooden desk (H, W, 3): a base colour, long streaks of grain, knots of shade, fine specks."""
    tint = np.array([1.0, 0.74, 0.5]) * rng.uniform(0.9, 1.1, 3)
    base = (rng.uniform(70, 180) * tint).astype(np.float32)
    grain = np.zeros((height, width), np.float32)
    upright = bool(rng.integers(2))
    for cell, stretch, weight in ((4, 40, 0.5), (12, 30, 0.8), (60, 6, 1.0), (300, 1, 0.8)):
        cells = (cell, cell * stretch) if upright else (cell * stretch, cell)
        grain += np.float32(weight) * _smooth_noise(width, height, cells, rng)
    grain /= max(float(grain.std()), 1e-6)
    depth = rng.uniform(0.08, 0.22)
    shade = 1.0 + np.float32(depth) * grain + 0.04 * rng.standard_normal((height, width), np.float32)
    return np.clip(base * shade[..., None], 0, 255).astype(np.uint8)


def _smooth_noise(
    width: int, height: int, cell: tuple[int, int], rng: np.random.Generator
) -> NDArray[np.float32]:
    """White noise on cells (w, h) px, interpolated."""
    coarse = rng.standard_normal((height // cell[1] + 3, width // cell[0] + 3), np.float32)
    scale = np.array([[cell[0], 0.0, 0.0], [0.0, cell[1], 0.0]], np.float64)
    return np.asarray(cv2.warpAffine(coarse, scale, (width, height), flags=cv2.INTER_CUBIC), np.float32)


def _radius_squared(width: int, height: int) -> NDArray[np.float32]:
    """(H, W) squared distance from the image's centre, 1 at the corners."""
    cx, cy = (width - 1) / 2.0, (height - 1) / 2.0
    x = ((np.arange(width) - cx) ** 2).astype(np.float32)
    y = ((np.arange(height) - cy) ** 2).astype(np.float32)
    return np.asarray((x + y[:, None]) / np.float32(max(cx**2 + cy**2, 1e-9)), np.float32)


def _motion_kernel(length_px: float, angle_rad: float) -> NDArray[np.float32]:
    reach = int(np.ceil(length_px / 2)) + 1
    kernel = np.zeros((2 * reach + 1, 2 * reach + 1), np.float32)
    for step in np.linspace(-length_px / 2, length_px / 2, 8 * reach + 1):
        x, y = reach + step * np.cos(angle_rad), reach + step * np.sin(angle_rad)
        i, j = int(np.floor(y)), int(np.floor(x))
        b, a = y - i, x - j
        kernel[i : i + 2, j : j + 2] += np.outer([1 - b, b], [1 - a, a]).astype(np.float32)
    return np.asarray(kernel / kernel.sum(), np.float32)


def _through_jpeg(image: RgbImage, quality: int) -> RgbImage:
    done, data = cv2.imencode(".jpg", image[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, quality])
    if not done:
        raise ValueError("the photo cannot be written as JPEG")
    back = cv2.imdecode(data, cv2.IMREAD_COLOR)
    return np.ascontiguousarray(np.asarray(back, np.uint8)[..., ::-1])

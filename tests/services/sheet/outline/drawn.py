"""Photos drawn from known outlines."""

import cv2
import numpy as np

from services.arrays import Points, RgbImage

SCALE = 8
"""Samples a pixel, along each axis: edges are right to a sixteenth of a pixel."""


def draw_sheet(
    outline: Points,
    size: tuple[int, int],
    *,
    paper: tuple[int, int, int] = (235, 233, 228),
    ground: tuple[int, int, int] = (110, 84, 60),
    noise: float = 3.0,
    seed: int = 1,
) -> RgbImage:
    """Photo of `size` (width, height) of a sheet with `outline` (N, 2), corners where the outline has them."""
    width, height = size
    fine = np.zeros((height * SCALE, width * SCALE), np.uint8)
    at = (outline + 0.5) * SCALE - 0.5
    cv2.fillPoly(fine, [np.round(at * 16).astype(np.int32)], 255, cv2.LINE_8, 4)
    share = cv2.resize(fine, size, interpolation=cv2.INTER_AREA).astype(np.float64)[..., None] / 255
    rng = np.random.default_rng(seed)
    image = share * np.array(paper) + (1 - share) * np.array(ground)
    image = cv2.GaussianBlur(image, (0, 0), 0.7) + rng.normal(0, noise, image.shape)
    return np.asarray(np.clip(image + 0.5, 0, 255), np.uint8)


def sides_of(corners: Points, bend: float = 0.0, points: int = 80) -> Points:
    """Outline (4 * points, 2) through `corners` (4, 2); top and bottom side bend by a share of their length."""
    sides = []
    for k in range(4):
        a, b = corners[k], corners[(k + 1) % 4]
        t = np.arange(points)[:, None] / points
        way = b - a
        # Top and bottom bend the same way, as on a cylinder.
        normal = np.array([way[1], -way[0]]) * (1 if k == 0 else -1 if k == 2 else 0)
        sides.append(a + t * way + 4 * bend * t * (1 - t) * normal)
    return np.concatenate(sides)


def distances(points: Points, outline: Points) -> np.ndarray:
    """Distance (N,) of points from a closed polygon."""
    a, b = outline, np.roll(outline, -1, axis=0)
    way = b - a
    t = np.einsum("nmk,mk->nm", points[:, None] - a[None], way) / np.maximum((way**2).sum(axis=1), 1e-12)
    nearest = a + np.clip(t, 0, 1)[..., None] * way
    return np.asarray(np.linalg.norm(points[:, None] - nearest, axis=2).min(axis=1))

"""Place of the print in a photo, and the part of it that is on the sheet."""

from dataclasses import dataclass

import cv2
import numpy as np

from services.arrays import Floats, Mask, Points, Vector
from services.imaging.components import label_components
from services.sheet.outline.colors import color_density, count_colors
from services.sheet.outline.reduced_photo import ReducedPhoto

# Which characters are accepted, and where the middle of the sheet is searched.
RADIUS = 0.02
"""Of the photo's long side: print extends this far around its characters."""
LIKE_PRINT = 0.1
"""Of the commonest density: characters on colours that are rarer among them are not print on the sheet."""
PART = 0.1
"""Of the characters of the largest part: smaller parts are clutter."""
MIDDLE = 0.25
"""Of the photo: half axes of the ellipse that replaces the print if none was found."""


@dataclass(frozen=True, slots=True, eq=False)
class PrintPlace:
    """Where print lies on the reduced photo: `mask` (h, w) round characters, `core` (h, w) an ellipse in their middle.

    `characters` (N, 2) are those on the ground that most of them share. Without print there are none, and both masks
    are an ellipse in the photo's middle.
    """

    mask: Mask
    core: Mask
    characters: Points


def place_print(reduced: ReducedPhoto, characters: Points | None) -> PrintPlace:
    """Place of the print; without print, an ellipse in the middle of the photo."""
    height, width = reduced.colors.shape[:2]
    if characters is None:
        x0, y0, x1, y1 = reduced.window
        middle = np.array([(x0 + x1) / 2, (y0 + y1) / 2])
        core = _ellipse((height, width), middle, np.diag([x1 - x0, y1 - y0]) * MIDDLE)
        return PrintPlace(core, core, np.zeros((0, 2)))
    place = reduced.from_photo(characters)
    at = np.clip(np.round(place).astype(int), 0, [width - 1, height - 1])
    code = reduced.codes[at[:, 1], at[:, 0]]
    density = color_density(count_colors(code))[code]
    kept = density >= LIKE_PRINT * np.percentile(density, 90)
    place, at = place[kept], at[kept]
    mask = np.zeros((height, width), np.uint8)
    mask[at[:, 1], at[:, 0]] = 1
    radius = max(int(RADIUS * max(height, width)), 1)
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * radius + 1, 2 * radius + 1))
    mask = np.asarray(cv2.dilate(mask, kernel), np.uint8)
    count, labels, _, _ = label_components(mask)
    held = np.bincount(labels[at[:, 1], at[:, 0]], minlength=count)
    large = held >= PART * held.max()
    large[0] = False
    chosen = large[labels]
    place = place[chosen[at[:, 1], at[:, 0]]]
    middle, axes = _middle(place)
    # Within one deviation the sheet contains the print, even if texture was found as print.
    core = _ellipse((height, width), middle, axes)
    return PrintPlace(np.asarray(chosen), core | ~chosen.any(), place)


def _middle(points: Points) -> tuple[Vector, Floats]:
    """Centre (2,) and matrix (2, 2) of the ellipse of one standard deviation, of the inner half of `points`, grown."""
    centre = np.median(points, axis=0)
    cov = np.cov(points.T) + np.eye(2)
    for _ in range(3):
        away = np.einsum("ni,ij,nj->n", points - centre, np.linalg.inv(cov), points - centre)
        inner = points[away <= np.median(away)]
        centre, cov = inner.mean(axis=0), np.cov(inner.T) * 3.0 + np.eye(2)
    values, vectors = np.linalg.eigh(cov)
    return centre, np.asarray((vectors * np.sqrt(values)) @ vectors.T)


def _ellipse(shape: tuple[int, int], centre: Vector, axes: Floats) -> Mask:
    """(h, w) inside of the ellipse centre + axes @ unit circle."""
    angle = np.linspace(0, 2 * np.pi, 60, endpoint=False)
    points = centre + np.stack([np.cos(angle), np.sin(angle)], axis=1) @ axes.T
    mask = np.zeros(shape, np.uint8)
    cv2.fillPoly(mask, [np.round(points).astype(np.int32)], 1)
    return mask.astype(bool)

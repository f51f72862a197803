"""The photo that several photos are parts of, pasted from them."""

from collections.abc import Mapping

import cv2
import numpy as np

from services.arrays import Floats, GrayImage, Homography, Mask, RgbImage
from services.geometry.homographies import scaling, transform_points, translation
from services.geometry.page_frame import fill_unknown

MOST_PIXELS = 12e6
"""Of the pasted photo, which is measured only."""
FULL = 0.75
"""Share of a row or column that photos show, from which it is no wedge of a photo that was turned. Wedges move the
middle, which is taken for the principal point: with them crops of three bent sheets, turned by 2 to 4 degrees, became
0.13 to 0.55 % of the width off, without them 0.08 to 0.14."""
MOST_TRIMMED = 0.1
"""Largest share that is trimmed at a side, or nothing is: four crops that were turned by up to 4 degrees leave 0.07."""
PIXEL_BLUR = 0.5
"""Blur of a photo that is reduced, pixels of the picture: no pixel is skipped."""
FILL_PX = 300
"""Long side of the picture in which what no photo shows is filled smoothly, so that no edge is seen there."""
FILL_BLUR_PX = 4.0
"""Blur of what is filled, from the nearest pixels that a photo shows, in that picture."""
LIGHT_STEP_PX = 8
"""One pixel in this many, along both axes, compares the light of two photos."""


def paste_photos(
    photos: Mapping[int, RgbImage], H_common_photo: Mapping[int, Homography]
) -> tuple[RgbImage, Homography]:
    """The photo (H, W, 3) of which `photos` are parts, and the map of their common pixels to its own.

    Each pixel is from the photo in which it is farthest from the border. All are drawn in the light of the first one.
    """
    corners = []
    for index, photo in photos.items():
        height, width = photo.shape[:2]
        box = np.array([[0.0, 0.0], [width - 1, 0.0], [width - 1, height - 1], [0.0, height - 1]])
        corners.append(transform_points(H_common_photo[index], box))
    low, high = np.min(corners, axis=(0, 1)), np.max(corners, axis=(0, 1))
    extent = high - low + 1
    factor = min(1.0, float(np.sqrt(MOST_PIXELS / np.prod(extent))))
    H_picture_common = scaling(factor) @ translation(-low[0], -low[1])
    width, height = (max(int(np.ceil(v * factor)), 1) for v in extent)
    picture = np.zeros((height, width, 3), np.uint8)
    farthest = np.zeros((height, width), np.float32)
    for index, photo in photos.items():
        _add(picture, farthest, photo, H_picture_common @ H_common_photo[index])
    left, top, right, bottom = _without_wedges(farthest > 0)
    unseen = np.asarray(farthest == 0).view(np.uint8)[top:bottom, left:right]
    H = translation(-left, -top) @ H_picture_common
    return _fill(np.ascontiguousarray(picture[top:bottom, left:right]), unseen), H


def _without_wedges(seen: Mask) -> tuple[int, int, int, int]:
    """The box (left, top, right, bottom) without rows and columns at the borders that are mostly not `seen`."""
    bounds, trimmed = [], 0.0
    for axis in (0, 1):
        full = np.flatnonzero(seen.mean(axis=axis) >= FULL)
        first, last, size = (
            (int(full[0]), int(full[-1]) + 1, seen.shape[1 - axis]) if len(full) else (0, 0, 1)
        )
        trimmed = max(trimmed, first / size, 1 - last / size)
        bounds.append((first, last))
    if trimmed > MOST_TRIMMED:
        return 0, 0, seen.shape[1], seen.shape[0]
    (left, right), (top, bottom) = bounds
    return left, top, right, bottom


def _add(picture: RgbImage, farthest: Floats, photo: RgbImage, H_picture_photo: Homography) -> None:
    """Draw `photo` where it is farther from its border than what was drawn before."""
    scale = float(np.hypot(H_picture_photo[0, 0], H_picture_photo[1, 0]))
    if scale < 1:
        photo = np.asarray(cv2.GaussianBlur(photo, (0, 0), PIXEL_BLUR * (scale**-2 - 1) ** 0.5), np.uint8)
    M = H_picture_photo[:2]
    height, width = photo.shape[:2]
    size = (picture.shape[1], picture.shape[0])
    across = np.minimum(np.arange(width), np.arange(width)[::-1]).astype(np.float32) + 1
    down = np.minimum(np.arange(height), np.arange(height)[::-1]).astype(np.float32)[:, None] + 1
    inset = cv2.warpAffine(np.minimum(across, down), M, size, flags=cv2.INTER_LINEAR)
    inset[inset < 1] = 0  # beyond the border's pixels
    drawn = cv2.warpAffine(photo, M, size, flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    few = np.s_[::LIGHT_STEP_PX, ::LIGHT_STEP_PX]
    both = (farthest[few] > 0) & (inset[few] > 0)
    if both.any():
        known, own = (picture[few][both].astype(np.float64).mean(axis=0) for picture in (picture, drawn))
        gain = (known + 1) / (own + 1)
        drawn = np.asarray(np.clip(drawn * gain.astype(np.float32), 0, 255), np.uint8)
    chosen = inset > farthest
    picture[chosen], farthest[chosen] = drawn[chosen], inset[chosen]


def _fill(picture: RgbImage, unseen: GrayImage) -> RgbImage:
    """`picture` with what no photo shows filled from around, without edges."""
    if not unseen.any():
        return picture
    factor = min(1.0, FILL_PX / max(unseen.shape))
    size = tuple(max(round(side * factor), 1) for side in unseen.shape[::-1])
    holes = cv2.resize(unseen, size, interpolation=cv2.INTER_AREA) > 0
    holes = cv2.dilate(holes.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    small = cv2.resize(picture, size, interpolation=cv2.INTER_AREA).astype(np.float64)
    small[holes] = np.nan
    near = fill_unknown(small)
    smooth = cv2.GaussianBlur(near, (0, 0), FILL_BLUR_PX)
    small = np.asarray(np.where(holes[:, :, None], smooth, near) + 0.5, np.uint8)
    filled = cv2.resize(small, unseen.shape[::-1], interpolation=cv2.INTER_LINEAR)
    return np.asarray(cv2.copyTo(filled, unseen, picture), np.uint8)

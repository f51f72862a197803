"""An even area with an edge all round it, anywhere in a photo: a board on a wall, among other things.

Boundaries are searched from the print, or from the photo's middle. A board that fills a part of the photo, beside the
middle and with a frame round it, has neither there. It is even between its strokes, and ends on all sides.
"""

from collections.abc import Iterator

import cv2
import numpy as np

from services.arrays import Points, RgbImage
from services.imaging.channels import length_of_channels
from services.imaging.components import label_components
from services.imaging.reduction import Halves
from services.sheet.outline.candidates import Candidate
from services.sheet.outline.detection import RATED_SHARE, measure_candidate
from services.sheet.outline.reduced_photo import LEAST_SIDE_PX, ReducedPhoto, medium_photo, reduce_photo
from services.sheet.outline.results import BELIEVED_CONFIDENCE, SheetOutline
from services.sheet.outline.scoring import rate_curve

# Lengths are pixels of the reduced photo.
REACH = 2
"""Colours are compared over twice this distance; an area ends as far before its edge."""
LEAST_SHARE = 0.04
"""Of the photo, of the area: smaller ones are sockets, notes on a wall, and letters."""
CONVEX = 0.8
"""Share of its convex hull that an area covers, its holes counted in: print and glare at its border are no part."""


def find_even_area(photo: RgbImage | Halves) -> SheetOutline | None:
    """The outline of the even area in `photo` (H, W, 3) whose four sides are seen best; None if there is none."""
    halves = Halves.of(photo)
    if min(halves.image.shape[:2]) < LEAST_SIDE_PX:
        return None
    reduced = reduce_photo(halves)
    best: SheetOutline | None = None
    for hull in _enclosed_areas(reduced):
        rating = rate_curve(reduced, np.zeros((0, 2)), hull, RATED_SHARE)
        measured = measure_candidate(
            halves.image, reduced, medium_photo(halves), Candidate(hull, rating, 0.0)
        )
        if measured is not None and measured.confidence > (best.confidence if best else BELIEVED_CONFIDENCE):
            best = measured.outline
    return best


def _enclosed_areas(reduced: ReducedPhoto) -> Iterator[Points]:
    """Convex hulls (N, 2), clockwise, of the areas without an edge that do not reach the border of the photo."""
    x0, y0, x1, y1 = reduced.window
    shown = np.asarray(cv2.blur(reduced.colors[y0 : y1 + 1, x0 : x1 + 1], (3, 3)))
    r = REACH
    wide = cv2.copyMakeBorder(shown, r, r, r, r, cv2.BORDER_REPLICATE)
    across = length_of_channels(wide[r:-r, 2 * r :] - wide[r:-r, : -2 * r])
    down = length_of_channels(wide[2 * r :, r:-r] - wide[: -2 * r, r:-r])
    calm = np.hypot(across, down) < reduced.contrast
    even = np.asarray(cv2.erode(calm.astype(np.uint8), np.ones((3, 3), np.uint8)), np.uint8)
    height, width = even.shape
    found = label_components(even)
    for number in np.flatnonzero(found.stats[:, cv2.CC_STAT_AREA] >= LEAST_SHARE * even.size):
        left, top, across_px, down_px, _ = found.stats[number].tolist()
        inside = min(left, top, width - left - across_px, height - top - down_px) > 2 * r
        if number == 0 or not inside:
            continue
        mask = cv2.dilate(
            (found.labels == number).astype(np.uint8), np.ones((2 * r + 1, 2 * r + 1), np.uint8)
        )
        contours, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
        border = max(contours, key=cv2.contourArea)
        hull = cv2.convexHull(border)
        if cv2.contourArea(border) >= CONVEX * cv2.contourArea(hull):
            yield np.asarray(hull[:, 0], np.float64) + np.array([x0, y0])

"""The ground of a photo: whether it is of one kind up to the photo's frame, but for slivers of a desk at its sides.

A page that was cropped by an app, scanned or drawn from a PDF fills its picture: paper reaches to the frame on all
sides, whether something is printed there or not. Print is removed by a closing; what is left changes slowly on paper,
by light and shadow, and suddenly where something else begins.
"""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from services.arrays import Floats, Mask, Points, RgbImage, Vector
from services.imaging.channels import mean_of_channels
from services.imaging.reduction import GROUND_PX, Halves, reduce_image

SIDES = ("top", "right", "bottom", "left")
"""Of the photo's frame, in the order of the depths of slivers."""
CUT_PERCENTILE = 25.0
"""Of a sliver's depths along its side."""


# Lengths are shares of the photo's long side, differences of brightness those of its logarithm.
SLIVER_SIDE_PX = 1000
"""Of the copy on which slivers are measured."""
CLOSING = 1 / 22
"""Wider than a line of print of 14 points on a full page, and than dark boxes of forms."""
STEP = 0.10
"""Difference of brightness over `REACH_PX` pixels that is an edge: light and soft shadows change less."""
HUE_STEP = 5.0
"""Difference of a or of b of CIE Lab over `REACH_PX` pixels that is an edge."""
REACH_PX = 5
DARK = 0.35
"""Difference of brightness between a sliver of desk and the paper beside it."""
DEEPEST = 0.05
"""A desk that reaches deeper into the photo is no sliver."""
DEEP_SHARE = 0.1
"""Share of a side on which it may."""
SPIKE = 0.03
"""Slivers that are shorter along a side are print that touches the frame."""
DRAWN_LEVEL = 3
"""Gray levels by which a bar that a program has drawn differs from its colour, ..."""
DRAWN_SHARE = 0.7
"""... on this share of it: wood, cloth and shadows differ by more."""
MARK_LEVEL = 60
"""Gray levels by which its clock, icons or letters differ at least, ..."""
MARK_SHARE = 0.002
"""... on this share of it."""
REACHED_SHARE = 0.8
"""Share of a side of a flat view on which the ground must go on to where the photo ends."""


@dataclass(frozen=True, slots=True, eq=False)
class Ground:
    """The ground that reaches to a photo's frame.

    `slivers` has, for each of the photo's `SIDES`, the depth (N,) in photo pixels of what is not ground, at N places
    evenly along the side, left to right or top to bottom. `size` is the photo's (width, height) in pixels.
    """

    slivers: tuple[Vector, Vector, Vector, Vector]
    size: tuple[int, int]

    @property
    def box(self) -> tuple[int, int, int, int]:
        """First and last column and row of the photo that lie on the ground: left, top, right, bottom.

        A side is cut where little paper is lost; the desk that is left is drawn white.
        """
        top, right, bottom, left = (
            round(float(np.percentile(depth, CUT_PERCENTILE))) for depth in self.slivers
        )
        return left, top, self.size[0] - 1 - right, self.size[1] - 1 - bottom

    @property
    def outline(self) -> Points | None:
        """Outline (M, 2), photo pixels, of the ground, the frame where no sliver is; None if there are none."""
        if not any(depth.any() for depth in self.slivers):
            return None
        right, bottom = self.size[0] - 1, self.size[1] - 1
        (x, top), (y, beyond), (x_below, below), (y_left, left) = (self._edge(side) for side in range(4))
        sides = (
            np.column_stack([x, top]),
            np.column_stack([right - beyond, y]),
            np.column_stack([x_below, bottom - below])[::-1],
            np.column_stack([left, y_left])[::-1],
        )
        return np.concatenate(sides)

    def _edge(self, side: int) -> tuple[Vector, Vector]:
        """Places (N,) along a side, photo pixels from its left or upper end, and the depths (N,) of its sliver there.

        Up to the ground's corners: beyond, in the slivers of the sides beside, all is desk.
        """
        depth, length = self.slivers[side], self.size[side % 2] - 1
        along = np.linspace(0, length, len(depth))
        first, last = ((3, 1), (0, 2))[side % 2]
        end = 0 if side in (0, 3) else -1
        low, high = self._near_corner(first, end), self._near_corner(last, end)
        kept = (along >= low) & (along <= length - high)
        return along[kept], depth[kept]

    def _near_corner(self, side: int, end: int) -> float:
        """Depth of a side's sliver near its first (0) or last (-1) end, but beyond the sliver of the side beside it."""
        depth = self.slivers[side] if end == 0 else self.slivers[side][::-1]
        step = max(len(depth) // 20, 1)
        return float(np.percentile(depth[step // 2 : 2 * step], 75))


def find_ground(photo: RgbImage | Halves) -> Ground | None:
    """The ground of `photo` (H, W, 3); None if it is not of one kind up to the photo's frame."""
    halves = Halves.of(photo)
    height, width = halves.image.shape[:2]
    factor = min(1.0, GROUND_PX / max(height, width))
    small = reduce_image(halves, factor, least_side_px=8)
    blank = _without_print(small)
    ground = _largest_part(~_edges(blank))
    depths = _slivers(halves, ground, blank)
    if depths is None:
        return None
    return Ground(depths, (width, height))


def even_share(photo: RgbImage | Halves) -> float:
    """Share of the `photo` (H, W, 3), 0-1, that the largest even part covers, with what is printed on it."""
    halves = Halves.of(photo)
    factor = min(1.0, GROUND_PX / max(halves.image.shape[:2]))
    small = reduce_image(halves, factor, least_side_px=8)
    return float(_largest_part(~_edges(_without_print(small))).mean())


def sides_reached(view: RgbImage, shown: Mask) -> frozenset[str]:
    """Those of the `SIDES` of a flat `view` (H, W, 3) on which its ground goes on to where the photo ends.

    `shown` (H, W) are the pixels of the view that the photo shows.
    """
    factor = min(1.0, GROUND_PX / max(view.shape[:2]))
    small = reduce_image(view, factor, least_side_px=8)
    size = (small.shape[1], small.shape[0])
    inside = cv2.resize(shown.astype(np.uint8), size, interpolation=cv2.INTER_AREA)
    # A closing would carry the white beyond the photo into it; what is near its end is as what is beside it.
    known = cv2.erode(inside, np.ones((REACH_PX, REACH_PX), np.uint8)) > 0
    if not known.any():
        return frozenset()
    small[~known] = np.median(small[known], axis=0)
    blank = _without_print(small)
    beyond = cv2.dilate((~known).astype(np.uint8), np.ones((REACH_PX, REACH_PX), np.uint8)) > 0
    ground = _largest_part(~_edges(blank) & ~beyond) & known
    found = []
    for side in SIDES:
        paper, seen = (_from_side(mask, side) for mask in (ground, known))
        lines = seen.any(axis=0)
        first = np.minimum(seen.argmax(axis=0) + REACH_PX, len(seen) - 1)
        reached = paper[first, np.arange(paper.shape[1])][lines]
        if len(reached) and reached.mean() >= REACHED_SHARE:
            found.append(side)
    return frozenset(found)


def _slivers(photo: Halves, ground: Mask, blank: RgbImage) -> tuple[Vector, Vector, Vector, Vector] | None:
    """Depths of slivers at the photo's sides in photo pixels; None if something deeper than a sliver is there.

    `ground` and `blank` (h, w) are a reduced copy's. The slivers are measured on a larger one.
    """
    height, width = photo.image.shape[:2]
    factor = min(1.0, SLIVER_SIDE_PX / max(height, width))
    fine = reduce_image(photo, factor, least_side_px=8)
    size = (fine.shape[1], fine.shape[0])
    even = cv2.resize(blank, size, interpolation=cv2.INTER_LINEAR)
    joined = cv2.resize(ground.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST) > 0
    found: list[Vector] = []
    for side in SIDES:
        limit = DEEPEST * size[1 - SIDES.index(side) % 2]
        strip = int(limit) + 2
        seen, paper, near = (_from_side(image, side)[:strip] for image in (fine, even, joined))
        depth = _depths(near & ~_differs(seen, paper))
        end = int(np.median(depth))
        if (np.abs(depth - end) <= 2).mean() > DRAWN_SHARE and _is_drawn(seen[:end]):
            depth = np.zeros_like(depth)
        if (depth > limit).mean() > DEEP_SHARE:
            return None
        found.append(np.minimum(depth, limit) / factor)
    top, right, bottom, left = found
    return top, right, bottom, left


def _is_drawn(bar: RgbImage) -> bool:
    """Whether a `bar` (h, w, 3) beside the ground is one of a program's: of one colour, with something light on it."""
    if not bar.size:
        return False
    off = np.abs(bar.astype(np.int16) - np.median(bar, axis=(0, 1)).astype(np.int16)).max(axis=2)
    return bool((off <= DRAWN_LEVEL).mean() > DRAWN_SHARE and (off > MARK_LEVEL).mean() > MARK_SHARE)


def _from_side(image: NDArray[Any], side: str) -> NDArray[Any]:
    """`image` (h, w, ...) turned or mirrored so that its first row is the photo's `side`."""
    if side in ("left", "right"):
        image = image.swapaxes(0, 1)
    return image[::-1] if side in ("right", "bottom") else image


def _without_print(small: RgbImage) -> RgbImage:
    """`small` (h, w, 3) after a closing, which removes what is dark and narrow."""
    side = max(int(CLOSING * max(small.shape[:2])) | 1, 3)
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side))
    return np.asarray(cv2.medianBlur(cv2.morphologyEx(small, cv2.MORPH_CLOSE, kernel), 5), np.uint8)


def _log_brightness(image: RgbImage) -> Floats:
    # Some gray levels are added, so that noise in the dark is no edge.
    return np.asarray(np.log(mean_of_channels(image.astype(np.float64)) + 8.0))


def _edges(blank: RgbImage) -> Mask:
    """Where brightness or hue of `blank` (h, w, 3) change more over a few pixels than on paper."""
    window = np.ones((REACH_PX, REACH_PX), np.uint8)

    def change(values: Floats) -> Floats:
        return np.asarray(cv2.dilate(values, window) - cv2.erode(values, window))

    lab = cv2.cvtColor(blank, cv2.COLOR_RGB2LAB).astype(np.float64)
    found = change(_log_brightness(blank)) > STEP
    for hue in (lab[..., 1], lab[..., 2]):
        found |= change(np.ascontiguousarray(hue)) > HUE_STEP
    return np.asarray(found)


def _largest_part(even: Mask) -> Mask:
    """The largest connected part of `even` (h, w), grown back to the edges, with what lies within it."""
    _, labels, stats, _ = cv2.connectedComponentsWithStats(even.astype(np.uint8), connectivity=4)
    if len(stats) < 2:
        return np.zeros(even.shape, bool)
    largest = labels == 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA]))
    part = cv2.dilate(largest.astype(np.uint8), np.ones((REACH_PX, REACH_PX), np.uint8)) > 0
    # What is not joined with the frame lies within: pictures, tinted boxes.
    _, beyond, stats, _ = cv2.connectedComponentsWithStats((~part).astype(np.uint8), connectivity=4)
    rows, columns = even.shape
    left, top, width, height = stats[:, : cv2.CC_STAT_AREA].T
    within = (left > 0) & (top > 0) & (left + width < columns) & (top + height < rows)
    within[0] = True
    return np.asarray(within[beyond])


def _differs(small: RgbImage, blank: RgbImage) -> Mask:
    """Pixels of `small` (h, w, 3) darker than the paper `blank` there: print, and slivers that the closing removed."""
    return np.asarray(_log_brightness(blank) - _log_brightness(small) > DARK)


def _depths(paper: Mask) -> Vector:
    """Rows (w,) before the first row of `paper` (h, w), along its first row; short spikes are print."""
    rows, columns = paper.shape
    first = np.where(paper.any(axis=0), paper.argmax(axis=0), rows).astype(np.float64)
    window = max(round(SPIKE * columns), 1) | 1
    return np.asarray(median_filter(first, window, mode="nearest"))

"""Verification of a homography by blocks of text, matched by normalized cross-correlation (4.3).

Under a true homography, a block of a few words is found near its predicted place, with a much larger correlation than
other text of the same typeface, and so are its neighbours. Every pair is verified this way. On a page that is not
quite flat, blocks deviate from the homography by a slowly varying displacement. The search therefore allows a
displacement, and compares it with those of neighbouring blocks, not with the homography.
"""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from services.arrays import GrayImage, Homography, Mask, Points, Vector
from services.geometry.homographies import transform_points, translation
from services.mosaic.registration.reduced_view import ReducedView

GRID_TRIES = 12
GRID_GROWTH = 1.2
"""The grid of blocks is made coarser by this factor until few enough remain, this number of times at most (9-fold)."""


# Pixels are those of the reduced views, in which text is `text_height_px` high.
TEXT_HEIGHT_PX = 12.0
"""At 8, narrow overlaps contain no block; at 16 the search takes twice as long."""
BLOCK_PX = 48
"""Side of a block: about five characters by two or three lines."""
FEW_BLOCKS = 14
"""Number of blocks below which their side is reduced, at most twice, ..."""
SHRINKING = 0.7
"""... by this factor."""
LEAST_SIDE_PX = 18.0
"""Least side of a block in a narrow overlap; the other side becomes longer."""
LONGEST_SIDE_PX = 112.0
LONGEST_SHARE = 0.9
"""Largest side of a block, relative to the overlap's longer side."""
LEAST_SHOWN = 0.98
"""Least share of a block that both views show."""
BREADTH_SHARE = 0.45
"""Side of a block relative to the overlap's width, so that two fit next to each other."""
MOST_BLOCKS = 280
"""Largest number of blocks, distributed over the overlap."""
INK = 14.0
"""Least standard deviation of gray values in a block with print; bare paper is below 5."""
DETAIL = 4.0
"""Least detail, in gray values a pixel: the root of the structure tensor's smaller eigenvalue in a block. Text has
at least 5.6. Paper, rules and soft pictures, which match in many places or in none, have at most 3."""
CORRELATION = 0.7
"""Least correlation of a match, also after its refinement. 99 % of true blocks reach 0.82; 90 % of blocks of other
text stay below 0.55."""
DISTINCT = 0.04
"""Least difference between the best and the second-best correlation of a block."""
NEIGHBOURS = 8
SUPPORTERS = 3
"""Number of nearest neighbours, and how many of them must agree (or half, if there are fewer)."""
AGREEMENT_PX, AGREEMENT_SLOPE = 1.5, 0.05
"""Largest difference of neighbours' displacements: a constant plus this share of their distance."""


@dataclass(frozen=True, slots=True, eq=False)
class BlockMatches:
    """Blocks of a, and which of them were found in b.

    `points_a` (N, 2) are the centres of their print and `displacements` (N, 2) their distances from the places that the
    homography predicts, both in reduced pixels of a. `correlations` (N,) are those at the best place. `telling` (N,)
    marks blocks with detail in all directions: if these are not found, the homography is probably wrong.
    """

    points_a: Points
    displacements: Points
    correlations: Vector
    found: NDArray[np.bool_]
    telling: NDArray[np.bool_]

    @property
    def agreement(self) -> float:
        """Share of the telling blocks that were found."""
        return float(self.found[self.telling].mean()) if self.telling.any() else 0.0

    @property
    def evidence(self) -> int:
        """Number of telling blocks that were found."""
        return int(np.count_nonzero(self.found & self.telling))


NO_BLOCKS = BlockMatches(
    np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0), np.zeros(0, bool), np.zeros(0, bool)
)


def match_blocks(
    a: ReducedView,
    b: ReducedView,
    H_a_b: Homography,
    search_px: int,
    most_blocks: int = MOST_BLOCKS,
) -> BlockMatches:
    """Blocks of text in the overlap, searched within `search_px` of their places by `H_a_b` (reduced pixels)."""
    corners = transform_points(H_a_b, b.corners)
    low = np.floor(np.maximum(corners.min(axis=0), a.corners.min(axis=0))).astype(int)
    high = np.ceil(np.minimum(corners.max(axis=0), a.corners.max(axis=0))).astype(int) + 1
    if np.min(high - low) < LEAST_SIDE_PX:
        return NO_BLOCKS
    width, height = high - low
    H_b_window = np.linalg.inv(H_a_b) @ translation(low[0] - search_px, low[1] - search_px)
    size = int(width + 2 * search_px), int(height + 2 * search_px)
    warp = cv2.WARP_INVERSE_MAP
    other = cv2.warpPerspective(
        b.unruled,
        H_b_window,
        size,
        flags=cv2.INTER_LINEAR | warp,
        borderMode=cv2.BORDER_CONSTANT,
        borderValue=255,
    )
    seen = cv2.warpPerspective(b.shown.view(np.uint8), H_b_window, size, flags=cv2.INTER_NEAREST | warp)
    inner = slice(search_px, search_px + height), slice(search_px, search_px + width)
    own = a.unruled[low[1] : high[1], low[0] : high[0]]
    both = seen[inner].astype(bool) & a.shown[low[1] : high[1], low[0] : high[0]]
    side: float = BLOCK_PX
    for _ in range(3):
        block = _block_size(both, side)
        if block is None:
            return NO_BLOCKS
        w, h = block
        corners_ij, telling = _choose_blocks(own, np.asarray(other[inner]), both, block, most_blocks)
        if len(corners_ij) >= FEW_BLOCKS:
            break
        side *= SHRINKING
    displacements, correlations = np.zeros((len(corners_ij), 2)), np.zeros(len(corners_ij))
    for n, (x, y) in enumerate(corners_ij):
        template = own[y : y + h, x : x + w]
        region = np.asarray(other[y : y + h + 2 * search_px, x : x + w + 2 * search_px])
        scores = np.asarray(cv2.matchTemplate(region, template, cv2.TM_CCOEFF_NORMED), np.float32)
        displacements[n], correlations[n] = _peak(scores)
    points = corners_ij + low + ink_centres(own, corners_ij, w, h)
    candidates = correlations >= CORRELATION
    found = candidates.copy()
    found[candidates] = support_blocks(points[candidates], displacements[candidates])
    return BlockMatches(points, displacements, correlations, found, telling)


def take_blocks(image: NDArray[Any], corners: NDArray[np.intp], width: int, height: int) -> NDArray[Any]:
    """Blocks (N, height, width) of `image` with top left pixels `corners` (N, 2)."""
    return np.asarray(sliding_window_view(image, (height, width))[corners[:, 1], corners[:, 0]])


def ink_centres(image: GrayImage, corners: NDArray[np.intp], width: int, height: int) -> Points:
    """Centroid of the print in each block (N, 2), from its top left pixel. The displacement is measured there.

    If a block has only one text line at its lower edge, its displacement is that of the line. Assigning it to the
    block's centre would hide an error of scale.
    """
    blocks = take_blocks(image, corners, width, height).astype(np.float32)
    weights = (blocks - blocks.mean(axis=(1, 2), keepdims=True)) ** 2 + 1e-6
    return centroids(weights)


def centroids(weights: NDArray[np.float32]) -> Points:
    """Centroids (N, 2), (x, y), of weights (N, h, w)."""
    _, height, width = weights.shape
    across, down = weights.sum(axis=1, dtype=np.float64), weights.sum(axis=2, dtype=np.float64)
    total = across.sum(axis=1)
    return np.stack([across @ np.arange(width) / total, down @ np.arange(height) / total], axis=1)


def _block_size(both: Mask, side: float) -> tuple[int, int] | None:
    """Width and height of the blocks of an overlap, adapted to its width."""
    breadth = _breadth(both, 2 * side / BREADTH_SHARE)
    if breadth < LEAST_SIDE_PX:
        return None
    short = float(np.clip(BREADTH_SHARE * breadth, LEAST_SIDE_PX, side))
    height, width = both.shape
    long = max(short, min(side**2 / short, LONGEST_SIDE_PX, LONGEST_SHARE * max(height, width)))
    return (round(short), round(long)) if width < height else (round(long), round(short))


def _breadth(both: Mask, enough: float) -> float:
    """Width of the overlap at its broadest place, pixels; at least `enough` where it is broader than that."""
    step = 4
    coarse = np.pad(both.view(np.uint8)[::step, ::step], 1)
    if step * 2 * float(cv2.distanceTransform(coarse, cv2.DIST_L2, 3).max()) > 2 * enough:
        return enough
    return 2 * float(cv2.distanceTransform(np.pad(both.view(np.uint8), 1), cv2.DIST_L2, 3).max())


def _choose_blocks(
    own: GrayImage, other: GrayImage, both: Mask, block: tuple[int, int], most: int
) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """Top left corners (N, 2) of blocks that both views show, with print in at least one, and the telling ones (N,).

    Telling blocks have detail in all directions, so they match in one place only (Shi and Tomasi 1994, Good features to
    track).
    """
    w, h = block
    height, width = both.shape
    shown = np.asarray(cv2.integral(both.view(np.uint8), sdepth=cv2.CV_32S))
    area = float(w * h)

    def box(integral: NDArray[Any], y: NDArray[np.intp], x: NDArray[np.intp]) -> Vector:
        total = integral[y + h, x + w] - integral[y, x + w] - integral[y + h, x] + integral[y, x]
        return np.asarray(total / area, float)

    # OpenCV makes sums of whole numbers in a fifteenth of the time of sums of floating-point numbers.
    sums = [cv2.integral2(image, sdepth=cv2.CV_32S, sqdepth=cv2.CV_64F) for image in (own, other)]
    # Blocks are half a block apart, or on the finest grid that keeps to their largest number.
    apart = np.array([max(4, w // 2), max(4, h // 2)])
    for _ in range(GRID_TRIES):
        xs, ys = (np.arange(0, n - m + 1, s) for n, m, s in ((width, w, apart[0]), (height, h, apart[1])))
        x, y = (g.ravel() for g in np.meshgrid(xs, ys))
        if not len(x):
            return np.zeros((0, 2), np.intp), np.zeros(0, bool)
        usable = box(shown, y, x) > LEAST_SHOWN
        variances = [box(squared, y, x) - box(plain, y, x) ** 2 for plain, squared in sums]
        usable &= np.maximum(*variances) > INK**2
        if np.count_nonzero(usable) <= most:
            break
        apart = np.ceil(apart * GRID_GROWTH).astype(int)
    chosen = np.stack([x, y], axis=1)[usable]
    chosen = chosen[:: -(-len(chosen) // most)] if len(chosen) > most else chosen
    telling = _least_eigenvalues(own, chosen, w, h) > DETAIL**2
    telling[~telling] = _least_eigenvalues(other, chosen[~telling], w, h) > DETAIL**2
    return chosen, telling


def _least_eigenvalues(image: GrayImage, corners: NDArray[np.intp], width: int, height: int) -> Vector:
    """Smaller eigenvalue of the mean structure tensor ((xx, xy), (xy, yy)) of each block (N,)."""
    if not len(corners):
        return np.zeros(0)
    across, down = (
        take_blocks(np.asarray(cv2.Sobel(image, cv2.CV_16S, *order)), corners, width, height)
        .reshape(len(corners), width * height)
        .astype(np.float32)
        for order in ((1, 0), (0, 1))
    )
    xx, xy, yy = (
        np.asarray(np.einsum("ni,ni->n", one, other), float) / (64 * width * height)
        for one, other in ((across, across), (across, down), (down, down))
    )
    return np.asarray((xx + yy) / 2 - np.hypot((xx - yy) / 2, xy))


def _peak(scores: NDArray[np.float32]) -> tuple[Vector, float]:
    """Subpixel displacement (2,) of the best place from the centre, and its score (0 if ambiguous)."""
    _, best, _, (x, y) = cv2.minMaxLoc(scores)
    rows, columns = scores.shape
    at = np.array([x - columns // 2, y - rows // 2], float)
    if 0 < x < columns - 1 and 0 < y < rows - 1:
        at += [_vertex(*scores[y, x - 1 : x + 2].tolist()), _vertex(*scores[y - 1 : y + 2, x].tolist())]
    else:
        return at, 0.0
    r = 4
    rest = scores.copy()
    rest[max(y - r, 0) : y + r + 1, max(x - r, 0) : x + r + 1] = -1
    return at, 0.0 if best - float(rest.max()) < DISTINCT else float(best)


def _vertex(before: float, peak: float, after: float) -> float:
    """Position of the maximum of the parabola through three values at distance 1."""
    curvature = before - 2 * peak + after
    return 0.0 if curvature >= 0 else 0.5 * (before - after) / curvature


def support_blocks(
    points: Points,
    displacements: Points,
    agreement_px: float = AGREEMENT_PX,
    agreement_slope: float = AGREEMENT_SLOPE,
) -> NDArray[np.bool_]:
    """Which blocks (N,), displaced by (N, 2), agree with enough of their nearest neighbours."""
    n = len(points)
    if n < 3:
        return np.zeros(n, bool)
    count = min(NEIGHBOURS, n - 1)
    distances, indices = cKDTree(points).query(points, count + 1)
    distances, indices = distances[:, 1:], indices[:, 1:]
    apart = np.linalg.norm(displacements[indices] - displacements[:, None], axis=2)
    agree = apart <= agreement_px + agreement_slope * distances
    return np.asarray(agree.sum(axis=1) >= min(SUPPORTERS, max(2, -(-count // 2))))

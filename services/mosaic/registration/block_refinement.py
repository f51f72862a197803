"""Refinement of matched blocks to a small fraction of a pixel, by least squares on gray values.

The peak of a correlation, interpolated by a parabola, is biased toward whole pixels. From there, Gauss-Newton steps
minimize the squared difference of the two blocks, each normalized to mean 0 and deviation 1. The normalization removes
gain and offset, as in correlation (Lucas and Kanade 1981; the reference's gradients are used in all steps: Baker and
Matthews 2004). At the true place gradients are odd and a difference of sharpness is even about every stroke, so a
blurred view causes no bias.
"""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import GrayImage, Homography, Points, Vector
from services.geometry.homographies import transform_points, translation
from services.imaging.node_grid import take_values
from services.mosaic.registration.block_matching import BLOCK_PX, CORRELATION, centroids, take_blocks
from services.mosaic.registration.reduced_view import ReducedView

# Pixels are those of the reference view, reduced for this step.
FINE_TEXT_HEIGHT_PX = 18.0
"""Text height of the reference; a larger one takes longer without a measurable gain."""
BLUR_PX = 1.0
"""Blur of both views: it increases the range of convergence and suppresses interpolation artefacts."""
EVALUATIONS = 3
"""Comparisons of blocks: a step, one to where the steps of a geometric series would end, and one more. Of 23 pairs the
median match is nearer to its limit than after six plain steps on 14, as near on 5, 0.0001 to 0.0002 px farther on 4."""
MOST_LEFT = 0.75
"""Largest ratio of one step to the one before, either way. Where the other view is sharper, steps are too long, and
turn back by half."""
FURTHEST_PX = 3.0
"""Largest movement; blocks that move farther were not at their true place."""


def refine_matches(
    reference: ReducedView,
    other: ReducedView,
    H_reference_other: Homography,
    points_reference: Points,
    displacements: Points,
) -> tuple[Points, Points, Vector]:
    """Matched points (M, 2) of reference and other, and their correlations (M,); M <= N, in reduced pixels.

    The block around each of `points_reference` (N, 2) is compared with the other view, warped by `H_reference_other`,
    at the same place plus `displacements` (N, 2).
    """
    if not len(points_reference):
        return np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0)
    half, rim = BLOCK_PX // 2, int(FURTHEST_PX)
    middles = np.round(points_reference).astype(np.intp)
    middles = np.clip(middles, 0, np.array(reference.gray.shape[::-1]) - 1)
    # Blur and displacements reach beyond the blocks.
    low = np.maximum(middles.min(axis=0) - half - 3 * rim, 0)
    high = middles.max(axis=0) + half + 3 * rim + 1
    part = np.s_[low[1] : high[1], low[0] : high[0]]
    middles, H_reference_part = middles - low, translation(*low.astype(float))
    H_other_part = np.linalg.inv(H_reference_other) @ H_reference_part
    own = _blurred(reference.gray[part])
    laid, seen = _lay(other, H_other_part, *own.shape[::-1])
    blurred = _blurred(laid)
    # In a narrow overlap blocks extend to the border of the shown area.
    both = cv2.erode(
        reference.shown[part].view(np.uint8) & seen,
        np.ones((2 * rim + 1,) * 2, np.uint8),
        borderType=cv2.BORDER_CONSTANT,
        borderValue=0,
    )
    mask = _around(both, middles, half, cv2.BORDER_CONSTANT).astype(np.float32)
    area = np.maximum(mask.sum(axis=(1, 2)), 1)
    blocks, deviation = _normalized(_around(own, middles, half, cv2.BORDER_REPLICATE), mask, area)
    gy, gx = np.gradient(blocks, axis=(1, 2))
    gx, gy, blocks = gx * mask, gy * mask, blocks * mask
    xx, xy, yy = (_sums(g, h) for g, h in ((gx, gx), (gx, gy), (gy, gy)))
    determinant = xx * yy - xy**2
    good = (deviation > 1.0) & (determinant > 1e-3 * (xx + yy) ** 2)
    determinant = np.where(good, determinant, 1.0)
    steps: list[Points] = []
    moved = displacements
    for number in range(EVALUATIONS):
        sampled, _ = _normalized(_sample(blurred, middles + moved, half), mask, area)
        correlations = _sums(sampled, blocks) / area
        error = sampled - blocks
        ex, ey = _sums(gx, error), _sums(gy, error)
        step = np.stack([yy * ex - xy * ey, xx * ey - xy * ex], axis=1) / determinant[:, None]
        steps.append(np.clip(step, -1, 1) * good[:, None])
        moved = moved - (_whole_way(*steps) if number == 1 else steps[-1])
    far = np.linalg.norm(moved - displacements, axis=1)
    good &= (correlations >= CORRELATION) & (far <= FURTHEST_PX)
    # The displacement belongs to the centroid of the gradients, not to the block's centre.
    points = middles + centroids(gx**2 + gy**2 + np.float32(1e-9)) - half
    return (
        transform_points(H_reference_part, points[good]),
        transform_points(H_other_part, (points + moved)[good]),
        correlations[good],
    )


def _whole_way(first: Points, second: Points) -> Points:
    """Where steps (N, 2) that go on as the second follows the first come to in the end."""
    ratio = np.sum(first * second, axis=1) / np.maximum(np.sum(first**2, axis=1), 1e-12)
    return np.asarray(second / (1 - np.clip(ratio, -MOST_LEFT, MOST_LEFT))[:, None])


def _blurred(gray: GrayImage) -> NDArray[np.float32]:
    return np.asarray(cv2.GaussianBlur(gray.astype(np.float32), (0, 0), BLUR_PX), np.float32)


def _sums(one: NDArray[np.float32], other: NDArray[np.float32]) -> NDArray[np.float32]:
    """Sums of products (N,) over blocks (N, h, w)."""
    return np.asarray(np.einsum("nij,nij->n", one, other))


def _lay(
    view: ReducedView, H_view_reference: Homography, width: int, height: int
) -> tuple[GrayImage, NDArray[np.uint8]]:
    """The view warped to the reference's pixels, and the mask where it shows the page."""
    warp = cv2.WARP_INVERSE_MAP
    size = width, height
    laid = cv2.warpPerspective(
        view.gray, H_view_reference, size, flags=cv2.INTER_CUBIC | warp, borderValue=255
    )
    seen = cv2.warpPerspective(
        view.shown.view(np.uint8), H_view_reference, size, flags=cv2.INTER_NEAREST | warp
    )
    return np.asarray(laid, np.uint8), np.asarray(seen, np.uint8)


def _normalized(
    blocks: NDArray[np.float32], mask: NDArray[np.float32], area: NDArray[np.float32]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Blocks (N, h, w) with mean 0 and deviation 1 where `mask` is 1, and their deviations (N,) before.

    `area` (N,) is the sum of the mask.
    """
    centred = blocks - (_sums(blocks, mask) / area)[:, None, None]
    deviation = np.sqrt(_sums(centred * mask, centred) / area)
    return centred / np.maximum(deviation, 1e-3)[:, None, None], deviation


def _around(image: NDArray[Any], middles: NDArray[np.intp], half: int, border: int) -> NDArray[Any]:
    """Blocks (N, h, w) of `image` around whole `middles` (N, 2); `border` is OpenCV's mode beyond its edges."""
    padded = np.asarray(cv2.copyMakeBorder(image, *(half,) * 4, border))
    return take_blocks(padded, middles, 2 * half + 1, 2 * half + 1)


def _sample(image: NDArray[np.float32], middles: Points, half: int) -> NDArray[np.float32]:
    """Blocks (N, h, w) of `image` around `middles` (N, 2), by cubic interpolation."""
    n, side = len(middles), 2 * half + 1
    at = np.empty((n, side, side, 2), np.float32)
    steps = np.arange(-half, half + 1, dtype=np.float32)
    at[..., 0] = middles[:, None, None, 0].astype(np.float32) + steps
    at[..., 1] = middles[:, None, None, 1].astype(np.float32) + steps[:, None]
    sampled = take_values(image, at.reshape(n * side, side, 2), cv2.INTER_CUBIC, cv2.BORDER_REPLICATE)
    return np.asarray(sampled, np.float32).reshape(n, side, side)

"""Refinement of matched blocks to a small fraction of a pixel, by least squares on gray values.

The peak of a correlation, interpolated by a parabola, is biased toward whole pixels. From there, Gauss-Newton steps
minimize the squared difference of the two blocks, each normalized to mean 0 and deviation 1. The normalization removes
gain and offset, as in correlation (Lucas and Kanade 1981; the reference's gradients are used in all steps: Baker and
Matthews 2004). At the true place gradients are odd and a difference of sharpness is even about every stroke, so a
blurred view causes no bias.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import GrayImage, Homography, Points, Vector
from services.geometry.homographies import transform_points
from services.mosaic.registration.block_matching import BLOCK_PX, CORRELATION, centroids
from services.mosaic.registration.reduced_view import ReducedView

# Pixels are those of the reference view, reduced for this step.
FINE_TEXT_HEIGHT_PX = 18.0
"""Text height of the reference; a larger one takes longer without a measurable gain."""
BLUR_PX = 1.0
"""Blur of both views: it increases the range of convergence and suppresses interpolation artefacts."""
STEPS = 5
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
    height, width = reference.gray.shape
    half = BLOCK_PX // 2
    H_other_reference = np.linalg.inv(H_reference_other)
    own = cv2.GaussianBlur(reference.gray.astype(np.float32), (0, 0), BLUR_PX)
    laid, seen = _lay(other, H_other_reference, width, height)
    blurred = np.asarray(cv2.GaussianBlur(laid.astype(np.float32), (0, 0), BLUR_PX), np.float32)
    # Blur and displacements reach beyond the shown area. In a narrow overlap blocks extend to its border.
    rim = np.ones((2 * int(FURTHEST_PX) + 1,) * 2, np.uint8)
    both = cv2.copyMakeBorder(
        reference.shown.astype(np.uint8) & seen, *(half,) * 4, cv2.BORDER_CONSTANT, value=0
    )
    both = cv2.erode(both, rim, borderType=cv2.BORDER_CONSTANT, borderValue=0)
    padded = np.asarray(cv2.copyMakeBorder(own, *(half,) * 4, cv2.BORDER_REPLICATE), np.float32)
    middles = np.clip(np.round(points_reference), 0, [width - 1, height - 1])
    steps = np.arange(-half, half + 1)
    rows = (middles[:, 1, None] + steps).astype(np.intp)[:, :, None] + half
    columns = (middles[:, 0, None] + steps).astype(np.intp)[:, None, :] + half
    mask = both[rows, columns].astype(np.float32)
    blocks, deviation = _normalized(padded[rows, columns], mask)
    gy, gx = np.gradient(blocks, axis=(1, 2))
    gx, gy = gx * mask, gy * mask
    xx, xy, yy = (np.einsum("nij,nij->n", g, h) for g, h in ((gx, gx), (gx, gy), (gy, gy)))
    determinant = xx * yy - xy**2
    good = (deviation > 1.0) & (determinant > 1e-3 * (xx + yy) ** 2)
    determinant = np.where(good, determinant, 1.0)
    moved = displacements.copy()
    correlations = np.zeros(len(middles))
    for _ in range(STEPS + 1):
        sampled, _ = _normalized(_sample(blurred, (middles + moved).astype(np.float32), steps), mask)
        area = np.maximum(mask.sum(axis=(1, 2)), 1)
        correlations = np.einsum("nij,nij,nij->n", sampled, blocks, mask) / area
        error = sampled - blocks
        ex, ey = np.einsum("nij,nij->n", gx, error), np.einsum("nij,nij->n", gy, error)
        step = np.stack([yy * ex - xy * ey, xx * ey - xy * ex], axis=1) / determinant[:, None]
        moved = moved - np.clip(step, -1, 1) * good[:, None]
    far = np.linalg.norm(moved - displacements, axis=1)
    good &= (correlations >= CORRELATION) & (far <= FURTHEST_PX)
    # The displacement belongs to the centroid of the gradients, not to the block's centre.
    points = middles + centroids(gx**2 + gy**2 + np.float32(1e-9)) - half
    return points[good], transform_points(H_other_reference, points + moved)[good], correlations[good]


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
    blocks: NDArray[np.float32], mask: NDArray[np.float32]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Blocks (N, h, w) normalized to mean 0 and deviation 1 where `mask` is 1, and their deviations (N,) before."""
    area = np.maximum(mask.sum(axis=(1, 2)), 1)
    means = np.einsum("nij,nij->n", blocks, mask) / area
    centred = blocks - means[:, None, None]
    deviation = np.sqrt(np.einsum("nij,nij,nij->n", centred, centred, mask) / area)
    return centred / np.maximum(deviation, 1e-3)[:, None, None], deviation


def _sample(
    image: NDArray[np.float32], middles: NDArray[np.float32], steps: NDArray[np.intp]
) -> NDArray[np.float32]:
    """Blocks (N, h, w) of `image` around `middles` (N, 2), by cubic interpolation."""
    n, side = len(middles), len(steps)
    x = np.broadcast_to(middles[:, 0, None, None] + steps.astype(np.float32)[None, None, :], (n, side, side))
    y = np.broadcast_to(middles[:, 1, None, None] + steps.astype(np.float32)[None, :, None], (n, side, side))
    shape = (n * side, side)
    sampled = cv2.remap(
        image,
        np.ascontiguousarray(x, np.float32).reshape(shape),
        np.ascontiguousarray(y, np.float32).reshape(shape),
        cv2.INTER_CUBIC,
        borderMode=cv2.BORDER_REPLICATE,
    )
    return np.asarray(sampled, np.float32).reshape(n, side, side)

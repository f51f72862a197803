"""Verification of a homography between two views, and their dense matches (4.3)."""

import hashlib
import math
from dataclasses import dataclass

import numpy as np

from services.arrays import Homography, Points, Vector
from services.geometry.homographies import jacobians, transform_points
from services.mosaic.flat_photo import FlatPhoto
from services.mosaic.registration.block_matching import (
    CORRELATION,
    MOST_BLOCKS,
    TEXT_HEIGHT_PX,
    BlockMatches,
    match_blocks,
    support_blocks,
)
from services.mosaic.registration.block_refinement import FINE_TEXT_HEIGHT_PX, refine_matches
from services.mosaic.registration.features import Features, detect_features, turn_features
from services.mosaic.registration.homography_fit import USUAL, FitParameters, fit_homography, is_sane
from services.mosaic.registration.reduced_view import ReducedView

LEVELS_PER_OCTAVE = 4
"""Reductions are rounded to these levels, so that several pairs share a photo's reduced views."""


# Lengths are relative to the text height.
SEARCH = 2.0
"""Radius of the first search around the predicted place, and the largest error of a prediction along other pairs, for
each photo in between."""
LEAST_SEARCH = 0.7
FIRST_BLOCKS = 40
FIRST_SHARE = 0.25
"""Least share of found blocks while a homography is roughly true and still moves (false: below 0.06)."""
ROUNDS = 5
AGREEMENT = 0.6
"""Least final share of found blocks: true pairs have 0.85-1, false ones below 0.1."""
COARSE_LOSS = 0.25
"""Loss width of the fit to found blocks. Smooth deviations from a homography remain in the matches."""
FINE_LOSS = 0.04
FINE_AGREEMENT = 0.06
FINE_SLOPE = 0.02
"""Largest difference of refined neighbours: a constant plus this share of their distance."""
LEAST_FOUND = 8
"""Least number of found blocks; neighbouring blocks overlap by half."""


class PreparedPhoto:
    """A photo with its features and reduced views, which are computed at first use."""

    def __init__(self, photo: FlatPhoto) -> None:
        self.photo = photo
        digest = hashlib.blake2b(photo.gray.tobytes(), digest_size=16)
        self.key = (round(photo.text_height_px, 6), photo.size, digest.hexdigest())
        """Sort key from the photo's content, so that the order of the upload has no effect."""
        self._features: dict[float, Features] = {}
        self._views: dict[tuple[int, int], ReducedView] = {}

    def features(self, fineness: float, turns: int) -> Features:
        """Features at `fineness` times the word scale, of the view turned by quarters."""
        if fineness not in self._features:
            self._features[fineness] = detect_features(self.photo, fineness)
        return turn_features(self._features[fineness], turns)

    def reduced(self, factor: float, turns: int) -> ReducedView:
        """The view reduced by about `factor` and turned by quarters."""
        level = min(0, round(LEVELS_PER_OCTAVE * math.log2(max(factor, 1e-3))))
        key = level, turns % 4
        if key not in self._views:
            self._views[key] = ReducedView(self.photo, turns, 2 ** (level / LEVELS_PER_OCTAVE))
        return self._views[key]


@dataclass(frozen=True, slots=True, eq=False)
class Overlap:
    """A homography between flat pixels `H_a_b`, the block matches under it, and the views of the matching."""

    H_a_b: Homography
    turns: int
    blocks: BlockMatches
    view_a: ReducedView
    view_b: ReducedView
    H_blocks: Homography
    """Reduced pixels of b -> those of a; the blocks' displacements refer to it."""

    @property
    def found(self) -> int:
        """Number of telling blocks that were found."""
        return self.blocks.evidence

    def matches(self) -> tuple[Points, Points]:
        """Found blocks (N, 2), reduced pixels of a and of b."""
        points = self.blocks.points_a[self.blocks.found]
        moved = points + self.blocks.displacements[self.blocks.found]
        return points, transform_points(np.linalg.inv(self.H_blocks), moved)


def local_scale(H_a_b: Homography, b: FlatPhoto) -> float:
    """Pixels of a over pixels of b in the middle of b's view."""
    width, height = b.size
    return _scale_of(H_a_b, np.array([[0.0, 0.0], [width - 1.0, height - 1.0]]))


def _scale_of(H: Homography, corners: Points) -> float:
    middle = corners.mean(axis=0, keepdims=True)
    return math.sqrt(max(abs(float(np.linalg.det(jacobians(H, middle)[0]))), 1e-12))


def verify_overlap(
    a: PreparedPhoto,
    b: PreparedPhoto,
    H_a_b: Homography,
    turns: int,
    search: float = SEARCH,
    *,
    least_found: int = LEAST_FOUND,
    fit: FitParameters = USUAL,
) -> Overlap | None:
    """The verified overlap close to `H_a_b`, in which b is rotated by `turns` quarters; None if there is none.

    `search` is the possible error of `H_a_b` in text heights, `least_found` the number of blocks to be found, and `fit`
    how far two views may differ from a similarity.
    """
    view_a, view_b, H = _at_block_scale(a, b, H_a_b, turns)
    loss = COARSE_LOSS * TEXT_HEIGHT_PX
    radius = search * TEXT_HEIGHT_PX
    most, least = FIRST_BLOCKS, 3
    for _ in range(ROUNDS):
        H_blocks = H
        found = match_blocks(view_a, view_b, H, math.ceil(radius), most)
        if found.evidence < least or found.agreement < FIRST_SHARE:
            return None
        points = found.points_a[found.found]
        moved = points + found.displacements[found.found]
        points_b = transform_points(np.linalg.inv(H), moved)
        H, _ = fit_homography(points, points_b, found.correlations[found.found], H, radius, loss, fit)
        if not is_sane(H, view_b.corners, _scale_of(H, view_b.corners), fit):
            return None
        fitted = transform_points(H, points_b)
        left = np.linalg.norm(fitted - points, axis=1)
        change = np.linalg.norm(fitted - moved, axis=1)
        radius = min(radius, max(LEAST_SEARCH * TEXT_HEIGHT_PX, 3 * float(np.percentile(left, 90))))
        if most == MOST_BLOCKS and float(np.percentile(change, 90)) < FINE_LOSS * TEXT_HEIGHT_PX:
            break
        most, least = MOST_BLOCKS, least_found
    if found.agreement < AGREEMENT:
        return None
    H_flat = np.linalg.inv(view_a.H_reduced_flat) @ H @ view_b.H_reduced_flat
    return Overlap(H_flat / H_flat[2, 2], turns, found, view_a, view_b, H_blocks)


def shows_otherwise(a: PreparedPhoto, b: PreparedPhoto, H_a_b: Homography, turns: int, search: float) -> bool:
    """Whether the overlap that `H_a_b` predicts contains print that differs between both views.

    `search` is the possible error of `H_a_b` in text heights.
    """
    view_a, view_b, H = _at_block_scale(a, b, H_a_b, turns)
    blocks = match_blocks(view_a, view_b, H, math.ceil(search * TEXT_HEIGHT_PX), FIRST_BLOCKS)
    return int(np.count_nonzero(blocks.telling)) >= LEAST_FOUND and blocks.agreement < FIRST_SHARE


def _at_block_scale(
    a: PreparedPhoto, b: PreparedPhoto, H_a_b: Homography, turns: int
) -> tuple[ReducedView, ReducedView, Homography]:
    """Both views at the resolution of block matching, and `H_a_b` between their pixels."""
    scale = local_scale(H_a_b, b.photo)
    text = math.sqrt(a.photo.text_height_px * b.photo.text_height_px * scale)
    factor = min(TEXT_HEIGHT_PX / max(text, 1e-6), 1.0, 1 / scale)
    view_a, view_b = a.reduced(factor, 0), b.reduced(factor * scale, turns)
    return view_a, view_b, view_a.H_reduced_flat @ H_a_b @ np.linalg.inv(view_b.H_reduced_flat)


def refine_overlap(
    a: PreparedPhoto, b: PreparedPhoto, overlap: Overlap, fit: FitParameters = USUAL
) -> tuple[Homography, Points, Points, Vector] | None:
    """`H_a_b`, points of a and b (N, 2) in flat pixels, and weights (N,), from the found blocks; None if they are few.

    The coarser view is the reference, because only the finer one can be reduced to the resolution of the other.
    """
    scale = local_scale(overlap.H_a_b, b.photo)
    text = math.sqrt(a.photo.text_height_px * b.photo.text_height_px * scale)
    factor = min(FINE_TEXT_HEIGHT_PX / max(text, 1e-6), 1.0, 1 / scale)
    fine_a, fine_b = a.reduced(factor, 0), b.reduced(factor * scale, overlap.turns)
    points_a, points_b = overlap.matches()
    points_a = _between(overlap.view_a, fine_a, points_a)
    points_b = _between(overlap.view_b, fine_b, points_b)
    H = fine_a.H_reduced_flat @ overlap.H_a_b @ np.linalg.inv(fine_b.H_reduced_flat)
    if scale <= 1:
        views, H_reference_other, near, far = (fine_a, fine_b), H, points_a, points_b
    else:
        views, H_reference_other, near, far = (fine_b, fine_a), np.linalg.inv(H), points_b, points_a
    displacements = transform_points(H_reference_other, far) - near
    near, far, correlations = refine_matches(*views, H_reference_other, near, displacements)
    if len(near) < 4:
        return None
    displacements = transform_points(H_reference_other, far) - near
    kept = support_blocks(near, displacements, FINE_AGREEMENT * FINE_TEXT_HEIGHT_PX, FINE_SLOPE)
    if np.count_nonzero(kept) < 4:
        return None
    near, far, correlations = near[kept], far[kept], correlations[kept]
    points_a, points_b = (near, far) if scale <= 1 else (far, near)
    points_a = transform_points(np.linalg.inv(fine_a.H_reduced_flat), points_a)
    points_b = transform_points(np.linalg.inv(fine_b.H_reduced_flat), points_b)
    # From 0 at the least correlation to 1 at a perfect one.
    weights = (correlations - CORRELATION) / (1 - CORRELATION)
    loss = FINE_LOSS * a.photo.text_height_px
    left = np.linalg.norm(transform_points(overlap.H_a_b, points_b) - points_a, axis=1)
    loss = max(loss, float(np.median(left)))
    H_a_b, _ = fit_homography(points_a, points_b, weights, overlap.H_a_b, 4 * loss, loss, fit)
    left = np.linalg.norm(transform_points(H_a_b, points_b) - points_a, axis=1)
    loss = max(FINE_LOSS * a.photo.text_height_px, 2 * float(np.median(left)))
    H_a_b, _ = fit_homography(points_a, points_b, weights, H_a_b, loss, loss, fit)
    return H_a_b, points_a, points_b, weights


def _between(old: ReducedView, new: ReducedView, points: Points) -> Points:
    return transform_points(new.H_reduced_flat @ np.linalg.inv(old.H_reduced_flat), points)

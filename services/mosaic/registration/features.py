"""Word-scale features of flat views, and their matches (4.3)."""

import math
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import Points, Vector
from services.geometry.homographies import transform_points
from services.mosaic.flat_photo import FlatPhoto
from services.mosaic.registration.reduced_view import quarter_turn, reduce_view

CELLS, DIRECTIONS = 4, 8
"""A descriptor is CELLS x CELLS histograms of DIRECTIONS gradient directions (rows, columns, directions)."""
MATCH_ROWS = 512
"""Number of rows of the similarity matrix that are computed at a time."""


# Measured on simulated and real sets: at full resolution letters cause too many false matches.
LONG_SIDE_PX = 700.0
"""Size to which a view is reduced, so that features are words, not letters (600-800 work equally well)."""
MOST_TEXT_HEIGHT_PX = 14.0
"""Of the text after the reduction: above it features are letters."""
RATIO = 0.93
"""Largest ratio of the nearest to the second nearest distance of a match. It is high, because the vote separates
true from false matches better than the ratio does."""


@dataclass(frozen=True, slots=True, eq=False)
class Features:
    """Upright features of one view.

    `points` (N, 2) and `sizes` (N,) are in flat pixels; `descriptors` (N, 128) float32 are square roots of
    normalized histograms, so that their products are Bhattacharyya coefficients; `reduction` is working pixels over
    flat pixels.
    """

    points: Points
    sizes: Vector
    descriptors: NDArray[np.float32]
    reduction: float
    width: int
    height: int


@dataclass(frozen=True, slots=True, eq=False)
class FeatureMatches:
    """Matched points (M, 2) of a and b, flat pixels, and the sizes (M,) of their features."""

    points_a: Points
    points_b: Points
    sizes_a: Vector
    sizes_b: Vector


def detect_features(photo: FlatPhoto, fineness: float = 1.0) -> Features:
    """Features of `photo`'s view in the shown part; `fineness` multiplies the working resolution."""
    width, height = photo.size
    text = max(photo.text_height_px, 1e-6)
    reduction = min(LONG_SIDE_PX / max(width, height), MOST_TEXT_HEIGHT_PX / text)
    reduction = min(1.0, fineness * reduction)
    gray, shown, H_reduced_flat = reduce_view(photo.gray, photo.shown, reduction)
    detector = cv2.SIFT.create(enable_precise_upscale=True)
    found = detector.detect(gray, shown.view(np.uint8) * 255)
    # Text lines are horizontal: a dominant direction would add noise and duplicates of features.
    upright: dict[tuple[float, float, float], cv2.KeyPoint] = {}
    for keypoint in found:
        keypoint.angle = 0.0
        upright.setdefault((keypoint.pt[0], keypoint.pt[1], keypoint.size), keypoint)
    keypoints, histograms = detector.compute(gray, list(upright.values())) if upright else ((), None)
    if histograms is None or not len(keypoints):
        none = np.zeros((0, 2))
        empty = np.zeros((0, CELLS * CELLS * DIRECTIONS), np.float32)
        return Features(none, np.zeros(0), empty, reduction, width, height)
    points = transform_points(np.linalg.inv(H_reduced_flat), np.array([k.pt for k in keypoints]))
    sizes = np.array([k.size for k in keypoints]) / reduction
    shares = histograms / np.maximum(histograms.sum(axis=1, keepdims=True), 1e-9)
    return Features(points, sizes, np.sqrt(shares).astype(np.float32), reduction, width, height)


def turn_features(features: Features, turns: int) -> Features:
    """Features of the view rotated counter-clockwise by `turns` quarters; descriptors are only permuted."""
    turns %= 4
    if not turns:
        return features
    n = len(features.points)
    bins = features.descriptors.reshape(n, CELLS, CELLS, DIRECTIONS)
    bins = np.roll(np.rot90(bins, turns, axes=(1, 2)), turns * DIRECTIONS // 4, axis=3)
    width, height = features.width, features.height
    points = transform_points(quarter_turn(turns, width, height), features.points)
    if turns % 2:
        width, height = height, width
    descriptors = np.ascontiguousarray(bins).reshape(features.descriptors.shape)
    return replace(features, points=points, descriptors=descriptors, width=width, height=height)


def match_features(a: Features, b: Features) -> FeatureMatches:
    """Exact nearest neighbours in b of the features of a that pass the ratio test."""
    if not len(a.points) or len(b.points) < 2:
        return FeatureMatches(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0), np.zeros(0))
    nearest, distinct = [], []
    for start in range(0, len(a.points), MATCH_ROWS):
        similarity = a.descriptors[start : start + MATCH_ROWS] @ b.descriptors.T
        rows = np.arange(len(similarity))
        first = similarity.argmax(axis=1)
        best = similarity[rows, first]
        similarity[rows, first] = -math.inf
        second = similarity.max(axis=1)
        # |u - v|^2 = 2 - 2 u.v of unit vectors.
        distinct.append(1 - best < RATIO**2 * (1 - second))
        nearest.append(first)
    i = np.flatnonzero(np.concatenate(distinct))
    j = np.concatenate(nearest)[i]
    return FeatureMatches(a.points[i], b.points[j], a.sizes[i], b.sizes[j])

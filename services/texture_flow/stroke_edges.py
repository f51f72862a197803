"""Edges of strokes, and the strength of their directions.

The directional filter is the derivative across a stroke's edge. A straight stroke puts all its edge pixels at one
direction, a round one spreads them thinly.
"""

import ctypes
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import Floats, GrayImage, Mask, Vector
from services.imaging.row_bands import BAND_ROWS, row_bands
from services.kernels.library import Edges, Field, Sampled, address, find_kernels, image_of, is_packed
from services.texture_flow.field import FlowField, angle_difference

GOLDEN = (5**0.5 - 1) / 2
LIKELY_SHARE = 0.5
"""Edges that are weaker than this share of what is strong in the first bands are not kept ..."""
ENOUGH_SHARE = 0.03
"""... when these contain this share of the image, over `LIKELY_SHARE`, as text."""
DERIVATIVE_SIGMA_PX = 1.1
"""Scale of the derivatives. Gaussian ones give an edge's direction to 0.05 degrees, Scharr's 0.15, Sobel's 1."""
TAPS = 9
"""Of their filters."""
SAMPLES = 100_000
"""Of gradients, about so many tell which of them are strong."""
EDGE_SHARE = 0.25
"""Least gradient of an edge relative to a strong gradient (99th percentile) ..."""
EDGE_FLOOR = 1.0
"""... and in gray levels a pixel: rounding on plain paper is not an edge."""
CROSSING_RAD = np.deg2rad(40.0)
"""Strokes nearer than this to the major flow are removed."""


@dataclass(frozen=True, slots=True)
class MinorFlowParameters:
    """How many edges the minor flow is measured from, and where they are sought."""

    max_edges: int = 200_000
    """Largest number of edge pixels; a thousand determine a block's direction to 0.1 degree."""
    band_rows: int = BAND_ROWS
    """Edges are sought in bands of so many rows ..."""
    band_share: float = 1.0
    """... in this share of them. Multiples of the golden ratio choose them: no period coincides with that of lines."""


@dataclass(frozen=True, slots=True, eq=False)
class StrokeEdges:
    """Edge pixels that cross the major flow: `points` (E, 2), tangent `angles` (E,) rad, `strengths` (E,)."""

    points: NDArray[np.float32]
    angles: NDArray[np.float32]
    strengths: NDArray[np.float32]


def detect_stroke_edges(
    gray: GrayImage, area: Mask, major: FlowField, parameters: MinorFlowParameters
) -> StrokeEdges:
    """Strong edges in the text `area` whose tangents differ enough from the major flow."""
    kernels, p = find_kernels(), parameters
    if kernels is None or not is_packed(gray):
        return detect_stroke_edges_plain(gray, area, major, p)
    area = np.ascontiguousarray(area)
    inside = int(np.count_nonzero(area))
    smooth, slope = (np.asarray(taps, np.float32) for taps in _derivative_taps())
    step = _sampling_step(inside)
    # What is found fills as much of them as it needs; whole vectors are written.
    at, (x, y) = np.empty(inside + 8, np.int32), np.empty((2, inside + 8), np.float32)
    edges, sampled = Edges(address(at), address(x), address(y), 0), Sampled(None, 0, step, 0)

    def find(rows: slice, least: float) -> NDArray[np.float32]:
        strengths = np.empty(area[rows].size // step + 2, np.float32)
        sampled.strengths, sampled.count = address(strengths), 0
        if not kernels.find_edges(
            ctypes.byref(image_of(gray)),
            address(area),
            rows.start,
            rows.stop,
            address(smooth),
            address(slope),
            least,
            ctypes.byref(edges),
            ctypes.byref(sampled),
        ):
            raise MemoryError
        return strengths[: sampled.count]

    strong = _search_bands(area, p, LIKELY_SHARE, find)
    if strong is None:  # the first bands had far stronger edges than the others
        edges.count, sampled.left = 0, 0
        strong = _search_bands(area, p, 0.0, find)
    assert strong is not None
    room, nodes = min(p.max_edges, edges.count) + 8, _nodes_of(major)
    points, angles, strengths = np.empty((room, 2), np.float32), *np.empty((2, room), np.float32)
    count = kernels.cross_lines(
        ctypes.byref(edges),
        gray.shape[1],
        strong,
        p.max_edges,
        ctypes.byref(_field_of(major, nodes)),
        np.cos(2 * CROSSING_RAD),
        address(points),
        address(angles),
        address(strengths),
    )
    return StrokeEdges(points[:count], angles[:count], strengths[:count])


class _Edges(NamedTuple):
    """Edge pixels of a band: index in the image, gradient, and its magnitude, (E,) each."""

    at: NDArray[np.intp]
    x: NDArray[np.float32]
    y: NDArray[np.float32]
    strength: NDArray[np.float32]

    def take(self, which: NDArray[np.intp]) -> "_Edges":
        return _Edges(self.at[which], self.x[which], self.y[which], self.strength[which])


def detect_stroke_edges_plain(
    gray: GrayImage, area: Mask, major: FlowField, parameters: MinorFlowParameters
) -> StrokeEdges:
    """`detect_stroke_edges` without a kernel: the same but for rounding."""
    p = parameters
    smooth, slope = _derivative_taps()
    step, found, passed = _sampling_step(int(area.sum())), list[_Edges](), 0

    def find(rows: slice, least: float) -> NDArray[np.float32]:
        nonlocal passed
        first, last = max(rows.start - TAPS // 2, 0), min(rows.stop + TAPS // 2, len(gray))
        band = slice(rows.start - first, rows.stop - first)
        gx, gy = (
            np.asarray(cv2.sepFilter2D(gray[first:last], cv2.CV_32F, *kernels), np.float32)[band].ravel()
            for kernels in ((slope, smooth), (smooth, slope))
        )
        strength, within = np.asarray(cv2.magnitude(gx, gy), np.float32).ravel(), area[rows].ravel()
        inside = strength[within]
        sampled = inside[-passed % step :: step].copy()  # a view would keep all of them
        passed += inside.size
        at = np.flatnonzero((strength > least) & within)
        found.append(_Edges(at + rows.start * gray.shape[1], gx[at], gy[at], strength[at]))
        return sampled

    strong = _search_bands(area, p, LIKELY_SHARE, find)
    if strong is None:
        found.clear()
        passed = 0
        strong = _search_bands(area, p, 0.0, find)
    assert strong is not None
    kept = [np.flatnonzero(edges.strength > strong) for edges in found]
    every, passed = sum(map(len, kept)) // p.max_edges + 1, 0
    for k, edges in enumerate(found):
        found[k] = edges.take(kept[k][-passed % every :: every])
        passed += len(kept[k])
    at, gx, gy, strengths = (np.concatenate(parts) for parts in zip(*found, strict=True))
    y, x = np.divmod(at, gray.shape[1])
    points = np.stack([x, y], axis=1, dtype=np.float32)
    # The tangent is perpendicular to the gradient.
    angles = np.arctan2(gx, -gy)
    clear = np.flatnonzero(np.abs(angle_difference(angles, major.at(points))) > CROSSING_RAD)
    return StrokeEdges(points[clear], angles[clear].astype(np.float32), strengths[clear])


def _derivative_taps() -> tuple[Vector, Vector]:
    """Filters (`TAPS`,) that smooth, and that give the slope of what they smooth."""
    taps = np.arange(TAPS) - TAPS // 2
    smooth = np.exp(-0.5 * (taps / DERIVATIVE_SIGMA_PX) ** 2)
    smooth /= smooth.sum()
    return smooth, taps * smooth / float((taps**2 * smooth).sum())


def _sampling_step(pixels: int) -> int:
    return max(pixels // SAMPLES, 1)


def _search_bands(
    area: Mask,
    p: MinorFlowParameters,
    likely_share: float,
    find: Callable[[slice, float], NDArray[np.float32]],
) -> float | None:
    """Least gradient of a strong edge, once all bands are searched for edges that may be strong.

    `find` keeps the edges of some rows above a least gradient, and returns samples of all gradients there. After the
    first bands, edges below `likely_share` of what is strong in these are not kept. None if strong ones may be among
    them.
    """
    sampled, passed, least = list[NDArray[np.float32]](), 0, EDGE_FLOOR
    for number, (rows, _, _) in enumerate(row_bands(len(area), TAPS // 2, p.band_rows)):
        if number * GOLDEN % 1.0 >= p.band_share:
            continue
        sampled.append(find(rows, least))
        passed += int(np.count_nonzero(area[rows]))
        if least == EDGE_FLOOR and likely_share * passed > ENOUGH_SHARE * area.size:
            least = max(EDGE_FLOOR, likely_share * _strong_gradient(sampled))
    strong = _strong_gradient(sampled)
    return None if least > max(strong, EDGE_FLOOR) else strong


def _strong_gradient(sampled: list[NDArray[np.float32]]) -> float:
    """Least gradient of a strong edge among samples (E,) of several bands."""
    strengths = np.concatenate(sampled)
    return EDGE_SHARE * float(np.percentile(strengths, 99)) if strengths.size else 0.0


@dataclass(frozen=True, slots=True, eq=False)
class EdgeBlocks:
    """Square blocks that edges are counted in.

    `which` (E,) is the block of each edge. Of the blocks (N,), row by row, `population` is the number of edges, and
    `centres` (N, 2) their mean place, weighted by strength.
    """

    which: NDArray[np.int32]
    population: Vector
    centres: Floats


def gather_blocks(edges: StrokeEdges, side_px: float, grid: tuple[int, int]) -> EdgeBlocks:
    """The blocks, (rows, columns) of a side of `side_px`, of `edges`."""
    kernels, count = find_kernels(), grid[0] * grid[1]
    if kernels is None:
        which, sums = _gather_plain(edges, side_px, grid)
    else:
        which, sums = np.empty(len(edges.points), np.int32), np.zeros((count, 4))
        arrays = [np.ascontiguousarray(each) for each in (edges.points, edges.strengths)]
        kernels.gather_blocks(
            *map(address, arrays), len(which), side_px, grid[1], address(which), address(sums)
        )
    return EdgeBlocks(which, sums[:, 0], sums[:, 2:] / np.maximum(sums[:, 1:2], 1e-9))


def _gather_plain(
    edges: StrokeEdges, side_px: float, grid: tuple[int, int]
) -> tuple[NDArray[np.int32], Floats]:
    """The block of each edge, and of each block the sums (N, 4) of edges, strengths, strengths times x and y."""
    column, row = (edges.points.astype(np.float64) / side_px).astype(np.int32).T
    which = row * grid[1] + column
    weights = np.column_stack([np.ones(len(which)), edges.strengths, edges.strengths[:, None] * edges.points])
    count = grid[0] * grid[1]
    return which, np.stack([np.bincount(which, each, count) for each in weights.T], axis=1)


def strength_curves(
    edges: StrokeEdges,
    blocks: EdgeBlocks,
    field: FlowField,
    turn_rad: float,
    half_range_rad: float,
    bin_rad: float,
) -> tuple[Floats, Vector]:
    """Strength S(beta) (N, B) per block over directions (B,), which are against those of `field`, turned.

    The strengths of edges are added up by the deviation of their tangents.
    """
    bins, count = round(2 * half_range_rad / bin_rad), len(blocks.population)
    deviations = angle_difference(edges.angles, field.at(edges.points) + turn_rad)
    index = np.floor((deviations + half_range_rad) / bin_rad).astype(int)
    ok = (index >= 0) & (index < bins)
    flat = np.bincount(blocks.which[ok] * bins + index[ok], edges.strengths[ok], count * bins)
    return flat.reshape(count, bins).astype(np.float64), (np.arange(bins) + 0.5) * bin_rad - half_range_rad


def _nodes_of(field: FlowField) -> NDArray[np.float32]:
    """The nodes (rows, columns, 2) of `field` as kernels take them."""
    return np.ascontiguousarray(field.doubled, np.float32)


def _field_of(field: FlowField, nodes: NDArray[np.float32]) -> Field:
    """`field` as kernels take it; its `nodes` must outlive the call that it is passed to."""
    return Field(address(nodes), *nodes.shape[:2], *field.origin, field.spacing_px)

"""Rays from the middle of a sheet outwards, and closed paths across them."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import Floats, Mask, Points, Vector
from services.imaging.channels import length_of_channels
from services.imaging.grid_paths import SHIFT_COST
from services.imaging.node_grid import take_values
from services.kernels.library import address, find_kernels
from services.sheet.outline.paths import find_closed_paths
from services.sheet.outline.reduced_photo import ReducedPhoto


@dataclass(frozen=True, slots=True)
class RayParameters:
    """What a boundary gains and costs, in full edges."""

    rays: int = 240
    samples: int = 176
    """Along a ray: about 2 px of the reduced photo."""
    longest: float = 1.02
    """Length of the longest ray, as a share of the distance to the photo's furthest corner."""
    max_shift: int = 7
    """Samples from ray to ray: a side that leans 60 degrees against the ray's normal."""
    exit_score: float = 0.3
    """Of a ray that leaves the photo inside the sheet."""
    region_weight: float = 3.0
    """A strip whose colours are surely on the wrong side, as wide as the typical radius."""


@dataclass(frozen=True, slots=True, eq=False)
class Rays:
    """N rays of M samples on the reduced photo.

    Sample m of ray n is at `origin + (m + 1) * steps[n]`; `places` (N, M, 2) are these in single precision. `edges`
    (N, M) is how clearly the colour changes along the ray (0-1), `last` (N,) the last sample inside the photo.
    """

    origin: Vector
    steps: Points
    places: NDArray[np.float32]
    edges: Floats
    last: NDArray[np.intp]

    def at(self, path: NDArray[np.intp]) -> Points:
        """Points (N, 2) of a path."""
        return np.asarray(self.origin + (path + 1.0)[:, None] * self.steps)

    def sample(self, image: Floats) -> Floats:
        """Values (N, M) or (N, M, K) of an image (h, w) or (h, w, K)."""
        return _sample(image, self.places)

    def reach_of_mask(self, mask: Mask) -> NDArray[np.intp]:
        """(N,) last sample of every ray inside `mask` (h, w); 0 for none."""
        there = self.sample(mask.astype(np.float32)) > 0.5
        last = there.shape[1] - 1 - np.argmax(there[:, ::-1], axis=1)
        return np.asarray(np.where(there.any(axis=1), last, 0), np.intp)

    def reach_of_hull(self, points: Points) -> Vector:
        """(N,) sample, with fraction, at which every ray leaves the convex hull of `points`; the origin is inside."""
        hull = cv2.convexHull(points.astype(np.float32))[:, 0, :].astype(np.float64)
        way = np.roll(hull, -1, axis=0) - hull
        normal = np.column_stack([way[:, 1], -way[:, 0]])
        inward = ((hull.mean(axis=0) - hull) * normal).sum(axis=1) > 0
        normal[inward] *= -1
        room = ((hull - self.origin) * normal).sum(axis=1)
        speed = self.steps @ normal.T
        reach = np.where(speed > 1e-9, room / np.maximum(speed, 1e-9), np.inf).min(axis=1)
        return np.asarray(np.clip(reach - 1, 0, self.edges.shape[1] - 1), np.float64)

    def search(
        self, sought: Sequence[tuple[Vector, Floats | float]], typical: float, p: RayParameters
    ) -> NDArray[np.intp]:
        """The best closed paths (G, N), each for samples `least` (N,) that it lies beyond, and log odds of paper.

        The odds (N, M) are those that a sample is paper, `typical` is the usual radius in samples.
        """
        score = np.stack([self._score(least, odds, typical, p) for least, odds in sought])
        return find_closed_paths(score, p.max_shift, SHIFT_COST)

    def _score(self, least: Vector, odds: Floats | float, typical: float, p: RayParameters) -> Floats:
        weight = p.region_weight / max(typical, 10.0)
        return score_rays(self.edges, np.asarray(odds), self.last, least, weight, p.exit_score)


def score_rays(
    edges: Floats, odds: Floats, last: NDArray[np.intp], least: Vector, weight: float, leaving: float
) -> Floats:
    """What a path gains at every sample (N, M) of N rays; -inf where it may not go.

    That is an edge (N, M), or at the `last` sample (N,), beyond which it may not go, `leaving`; and `weight` times the
    `odds` of all samples so far, which are inside: (N, M), (N, 1) or (). Samples before `least` (N,) are barred.
    """
    rays, samples = edges.shape
    odds = np.broadcast_to(odds, (rays, odds.shape[1] if odds.ndim else 1))
    if odds.shape[1] not in (1, samples) or last.shape != (rays,) or least.shape != (rays,):
        raise ValueError("every ray has odds, a last and a least sample")
    kernels = find_kernels()
    if kernels is None:
        return score_rays_plain(edges, odds, last, least, weight, leaving)
    if rays and not 0 <= last.min() <= last.max() < samples:
        raise ValueError("the last sample of a ray is one of it")
    edges, odds, least = (np.ascontiguousarray(given, np.float64) for given in (edges, odds, least))
    last, score = np.ascontiguousarray(last, np.intp), np.empty((rays, samples))
    given = address(edges), address(odds), int(odds.shape[1] > 1), address(last), address(least)
    kernels.score_rays(*given, rays, samples, weight, leaving, address(score))
    return score


def score_rays_plain(
    edges: Floats, odds: Floats, last: NDArray[np.intp], least: Vector, weight: float, leaving: float
) -> Floats:
    """`score_rays` without a kernel, for odds (N, M) or (N, 1)."""
    rays, samples = edges.shape
    n, m = np.arange(rays), np.arange(samples)
    region = weight * np.cumsum(np.broadcast_to(odds, edges.shape), axis=1, dtype=np.float64)
    score = edges + region
    score[n, last] = leaving + region[n, last]
    barred = (m > last[:, None]) | (m < np.minimum(least, last)[:, None])
    return np.asarray(np.where(barred, -np.inf, score))


def cast_rays(reduced: ReducedPhoto, middle: Mask, extent: Mask, p: RayParameters) -> Rays:
    """Rays from the centre of `middle` (h, w), in a frame in which `extent` (h, w) is about as wide as high."""
    x0, y0, x1, y1 = reduced.window
    rows, columns = np.nonzero(middle)
    origin = np.array([columns.mean(), rows.mean()])
    rows, columns = np.nonzero(extent)
    share = float(extent.mean())
    photo = np.diag([(x1 - x0) ** 2 / 12.0, (y1 - y0) ** 2 / 12.0])
    spread = np.cov(np.stack([columns, rows])) * share + 0.3 * photo * (1 - share)
    values, vectors = np.linalg.eigh(spread)
    axes = (vectors * np.sqrt(np.maximum(values, 1e-6) / values.max())) @ vectors.T
    angle = 2 * np.pi * np.arange(p.rays) / p.rays
    way = np.stack([np.cos(angle), np.sin(angle)], axis=1) @ axes.T
    corners = np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]]) - origin
    longest = np.linalg.norm(corners @ np.linalg.inv(axes).T, axis=1).max() * p.longest
    steps = way * longest / p.samples
    count = np.arange(1, p.samples + 1, dtype=np.float64)
    points = origin + count[None, :, None] * steps[:, None, :]
    x, y = points[..., 0], points[..., 1]
    shown = (x >= x0 - 0.5) & (x <= x1 + 0.5) & (y >= y0 - 0.5) & (y <= y1 + 0.5)
    # The window is convex: what follows a sample outside is outside.
    last = np.maximum(np.where(shown.all(axis=1), p.samples, shown.argmin(axis=1)) - 1, 0)
    places = points.astype(np.float32)
    edges = edge_strength(_sample(reduced.colors, places), reduced.contrast)
    return Rays(origin, steps, places, edges, last)


def _sample(image: Floats, places: NDArray[np.float32]) -> NDArray[np.float32]:
    return take_values(np.asarray(image, np.float32), places, cv2.INTER_LINEAR, cv2.BORDER_REPLICATE)


def edge_strength(colors: Floats, contrast: float) -> Floats:
    """(N, M) 0-1: how clearly the colour of `colors` (N, M, 3), along N rays, changes at every sample; `contrast`
    counts half."""
    rays = len(colors)
    wrapped = np.concatenate([colors[-2:], colors, colors[:2]])
    smooth = np.asarray(cv2.blur(wrapped, (2, 3), anchor=(0, 1)))[2 : rays + 2]
    difference = np.zeros(colors.shape[:2])
    difference[:, 2:-2] = length_of_channels(smooth[:, 3:-1] - smooth[:, :-4])
    squared = difference**2
    return np.asarray(squared / (squared + contrast**2))

"""Closed curves that may be the sheet's boundary: paths across rays from the middle of the print."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import Floats, Mask, Points, Vector
from services.sheet.outline.closed_paths import find_closed_path
from services.sheet.outline.reduced_photo import ReducedPhoto


@dataclass(frozen=True, slots=True)
class CandidateParameters:
    """Colour differences are CIE Lab's; lengths are shares of the photo's long side unless told."""

    rays: int = 240
    samples: int = 176
    """Along a ray: about 2 px of the reduced photo."""
    max_shift: int = 7
    """Samples from ray to ray: a side that leans 60 degrees against the ray's normal."""
    shift_cost: float = 0.02
    """A sample's shift, in full edges: sides have few steps."""
    contrast: float = 8.0
    """An edge of this colour difference counts half."""
    exit_score: float = 0.3
    """Of a ray that leaves the photo inside the sheet, in full edges."""
    region_weight: float = 3.0
    """A strip of this share of the radius ... costs as much as an edge, reciprocal."""
    seed_share: float = 0.25
    """Half axes of the ellipse in the photo's middle that is taken for paper where no print was found."""
    print_radius: float = 0.02
    """Print reaches so far round its characters."""
    alternatives: int = 2
    """Curves that are looked for outside of the best one."""


@dataclass(frozen=True, slots=True, eq=False)
class Rays:
    """Points (N, M, 2) of N rays on the reduced photo, outwards; `shown` (N, M) are those inside the photo."""

    points: Floats
    shown: Mask

    def at(self, path: NDArray[np.intp]) -> Points:
        """Points (N, 2) of a path."""
        return np.asarray(self.points[np.arange(len(path)), path], np.float64)


def print_mask(reduced: ReducedPhoto, characters: Points | None, p: CandidateParameters) -> Mask:
    """(h, w) where print, or what is taken for the sheet's middle without it, lies."""
    height, width = reduced.colors.shape[:2]
    mask = np.zeros((height, width), np.uint8)
    if characters is None or len(characters) < 10:
        x0, y0, x1, y1 = reduced.window
        axes = (int(p.seed_share * (x1 - x0)), int(p.seed_share * (y1 - y0)))
        cv2.ellipse(mask, ((x0 + x1) // 2, (y0 + y1) // 2), axes, 0, 0, 360, 1, -1)
        return mask.astype(bool)
    at = np.clip(np.round(reduced.from_photo(characters)).astype(int), 0, [width - 1, height - 1])
    mask[at[:, 1], at[:, 0]] = 1
    radius = max(int(p.print_radius * max(height, width)), 1)
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * radius + 1, 2 * radius + 1))
    mask = np.asarray(cv2.dilate(mask, kernel), np.uint8)
    count, labels, _, _ = cv2.connectedComponentsWithStats(mask)
    held = np.bincount(labels[at[:, 1], at[:, 0]], minlength=count)
    return np.asarray((held >= 0.1 * held.max())[labels] & (mask > 0))


def cast_rays(reduced: ReducedPhoto, mask: Mask, p: CandidateParameters) -> Rays:
    """Rays from the middle of `mask`, in a frame in which print and photo are about as wide as high."""
    x0, y0, x1, y1 = reduced.window
    hull = cv2.convexHull(np.argwhere(mask)[:, ::-1].astype(np.int32))
    (cx, cy), _, _ = cv2.minAreaRect(hull)
    rows, columns = np.nonzero(mask)
    spread = np.cov(np.stack([columns, rows]))
    photo = np.diag([(x1 - x0) ** 2 / 12.0, (y1 - y0) ** 2 / 12.0])
    share = mask.mean()
    values, vectors = np.linalg.eigh(spread * share + 0.3 * photo * (1 - share))
    axes = (vectors * np.sqrt(values / values.max())) @ vectors.T
    angle = 2 * np.pi * np.arange(p.rays) / p.rays
    way = np.stack([np.cos(angle), np.sin(angle)], axis=1) @ axes.T
    corners = np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]]) - [cx, cy]
    longest = np.linalg.norm(corners @ np.linalg.inv(axes).T, axis=1).max() * 1.02
    radius = longest * (np.arange(p.samples) + 1) / p.samples
    points = np.array([cx, cy]) + radius[None, :, None] * way[:, None, :]
    shown = (points >= np.array([x0, y0]) - 0.5).all(axis=2) & (points <= np.array([x1, y1]) + 0.5).all(
        axis=2
    )
    return Rays(points, np.asarray(shown))


def _sample(image: Floats, points: Floats) -> Floats:
    return np.asarray(
        cv2.remap(
            image.astype(np.float32),
            points[..., 0].astype(np.float32),
            points[..., 1].astype(np.float32),
            cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_REPLICATE,
        )
    )


def edge_strength(colors: Floats, p: CandidateParameters) -> Floats:
    """(N, M) 0-1: how clearly the colour of `colors` (N, M, 3) changes along each ray there."""
    rays = len(colors)
    wrapped = np.concatenate([colors[-2:], colors, colors[:2]])
    smooth = np.asarray(cv2.blur(wrapped, (2, 3), anchor=(0, 1)))[2 : rays + 2]
    difference = np.zeros(colors.shape[:2])
    difference[:, 2:-2] = np.linalg.norm(smooth[:, 3:-1] - smooth[:, :-4], axis=2)
    squared = difference**2
    return np.asarray(squared / (squared + p.contrast**2))


def color_log_odds(colors: Floats, inside: Mask, outside: Mask | None) -> Floats:
    """(h, w) log ratio of how often a colour occurs `inside` and `outside` (None: anywhere), limited to -1..1."""
    bins = np.clip((colors / [6.0, 4.0, 4.0] + [0, 32, 32]).astype(np.int64), 0, [17, 63, 63])
    code = (bins[..., 0] * 64 + bins[..., 1]) * 64 + bins[..., 2]
    found = []
    for mask in (inside, outside):
        counts = np.bincount(code.ravel() if mask is None else code[mask], minlength=18 * 64 * 64)
        cube = counts.reshape(18, 64, 64).astype(np.float32)
        for axis in range(3):
            cube = cube + 0.5 * (np.roll(cube, 1, axis) + np.roll(cube, -1, axis))
        found.append(cube / max(float(cube.sum()), 1.0))
    floor = 1e-5
    return np.asarray(np.clip(np.log((found[0] + floor) / (found[1] + floor)), -1, 1).ravel()[code])


def _path_score(edges: Floats, odds: Floats, rays: Rays, typical: float, p: CandidateParameters) -> Floats:
    """(N, M) what a boundary gains at every sample; -inf outside the photo."""
    region = np.cumsum(np.where(rays.shown, odds, 0.0), axis=1)
    # Edge at sample m: what lies before it is inside.
    score = edges + p.region_weight * region / typical
    last = rays.shown.sum(axis=1) - 1
    n = np.arange(len(edges))
    score[n, last] = p.exit_score + p.region_weight * region[n, last] / typical
    return np.where(rays.shown, score, -np.inf)


@dataclass(frozen=True, slots=True, eq=False)
class Candidate:
    """A closed clockwise curve (N, 2) on the reduced photo, with the mean strength of its edge (0-1)."""

    curve: Points
    strength: float


def find_candidates(
    reduced: ReducedPhoto, characters: Points | None, parameters: CandidateParameters | None = None
) -> list[Candidate]:
    """Closed curves that may be the sheet's boundary, inner ones first."""
    p = parameters or CandidateParameters()
    mask = print_mask(reduced, characters, p)
    rays = cast_rays(reduced, mask, p)
    edges = edge_strength(_sample(reduced.colors, rays.points), p)
    printed = _sample(mask.astype(np.float32), rays.points)
    reach = _last_print(printed)
    steps = np.arange(p.samples)[None, :]
    odds_image = color_log_odds(reduced.colors, mask, None)
    typical = max(float(np.median(reach)) * 1.3, 10.0)
    least = 0.5 * reach
    found: list[Candidate] = []

    def search(odds: Floats, least: Vector) -> NDArray[np.intp]:
        score = _path_score(edges, odds, rays, typical, p)
        last = rays.shown.sum(axis=1) - 1
        score[steps < np.minimum(least, last)[:, None]] = -np.inf
        path = find_closed_path(score, p.max_shift, p.shift_cost)
        met = edges[np.arange(len(path)), path]
        found.append(Candidate(rays.at(path), float(met[path < last].mean()) if (path < last).any() else 0.0))
        return path

    for _ in range(2):
        path = search(np.maximum(_sample(odds_image, rays.points), 2 * printed - 1), least)
        typical = max(float(np.median(path)), 10.0)
        inside = np.zeros(mask.shape, np.uint8)
        cv2.fillPoly(inside, [np.round(rays.at(path)).astype(np.int32)], 1)
        if (inside == 0).mean() < 0.01:
            break
        odds_image = color_log_odds(reduced.colors, inside > 0, inside == 0)
    # A sheet is about convex: what the curve passes by (pictures, shadows) belongs to it.
    for _ in range(2):
        hull = _hull_reach(rays, path)
        path = search(np.zeros_like(edges), hull - 3)
    search(np.zeros_like(edges), path * 1.05 + 3)
    return found


def _hull_reach(rays: Rays, path: NDArray[np.intp]) -> Vector:
    """(N,) index of the last sample of every ray inside the convex hull of a path."""
    hull = cv2.convexHull(rays.at(path).astype(np.float32))[:, 0, :].astype(np.float64)
    way = np.roll(hull, -1, axis=0) - hull
    normal = np.column_stack([way[:, 1], -way[:, 0]])
    if (normal * (hull.mean(axis=0) - hull)).sum() > 0:
        normal = -normal
    beyond = (np.einsum("nmk,hk->nmh", rays.points, normal) > (normal * hull).sum(axis=1) + 1e-6).any(axis=2)
    last = np.where(beyond.any(axis=1), np.argmax(beyond, axis=1) - 1, beyond.shape[1] - 1)
    return np.asarray(last, np.float64)


def _last_print(printed: Floats) -> Vector:
    """(N,) index of the last sample on print of every ray (0: none)."""
    there = printed > 0.5
    last = printed.shape[1] - 1 - np.argmax(there[:, ::-1], axis=1)
    return np.where(there.any(axis=1), last, 0).astype(np.float64)

"""Closed curves that may be the sheet's boundary: paths across rays from the middle of the print."""

from collections.abc import Callable
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
    least_characters: int = 10
    """With fewer there is no print to start from."""
    core: float = 1.0
    """Half axes of the print's core, in standard deviations: the sheet holds it, whatever else was taken for print."""
    seed_share: float = 0.25
    """Half axes of the ellipse in the photo's middle that is taken for paper where no print was found."""
    print_radius: float = 0.02
    """Print reaches so far round its characters."""
    concavity: float = 0.08
    """Of the radius: how far creased sheets stay inside of their convex hull."""
    tolerance: float = 3.0
    """Samples by which a curve may stay inside of the hull it is asked to fill."""
    outward: tuple[float, ...] = (0.1, 0.3)
    """Log odds of paper everywhere, when the outer of good edges is looked for."""
    inside: float = 0.8
    """Of the way to the last print on a ray: a boundary lies further out."""
    least_ground: float = 0.01
    """Share of the photo: less than this outside of a curve says nothing about the ground."""
    like_print: float = 0.1
    """Of the commonest density: characters on colours that are rarer among them are no print of the sheet."""


@dataclass(frozen=True, slots=True, eq=False)
class Rays:
    """Points (N, M, 2) of N rays on the reduced photo, outwards; `shown` (N, M) are those inside the photo."""

    points: Floats
    shown: Mask

    def at(self, path: NDArray[np.intp]) -> Points:
        """Points (N, 2) of a path."""
        return np.asarray(self.points[np.arange(len(path)), path], np.float64)


@dataclass(frozen=True, slots=True, eq=False)
class PrintPlace:
    """Where print lies on the reduced photo: `mask` (h, w) round characters, `core` (h, w) an ellipse in their middle.

    `characters` (N, 2) are those on the ground that most of them share. Without print there are none, and both masks
    are an ellipse in the photo's middle.
    """

    mask: Mask
    core: Mask
    characters: Points


def place_print(reduced: ReducedPhoto, characters: Points | None, p: CandidateParameters) -> PrintPlace:
    """Where print, or what is taken for the sheet's middle without it, lies."""
    height, width = reduced.colors.shape[:2]
    if characters is None or len(characters) < p.least_characters:
        x0, y0, x1, y1 = reduced.window
        middle = np.array([(x0 + x1) / 2, (y0 + y1) / 2])
        core = _ellipse((height, width), middle, np.diag([x1 - x0, y1 - y0]) * p.seed_share)
        return PrintPlace(core, core, np.zeros((0, 2)))
    place = reduced.from_photo(characters)
    at = np.clip(np.round(place).astype(int), 0, [width - 1, height - 1])
    code = _color_codes(reduced.colors)[at[:, 1], at[:, 0]]
    density = _color_density(code)[code]
    kept = density >= p.like_print * np.percentile(density, 90)
    place, at = place[kept], at[kept]
    mask = np.zeros((height, width), np.uint8)
    mask[at[:, 1], at[:, 0]] = 1
    radius = max(int(p.print_radius * max(height, width)), 1)
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * radius + 1, 2 * radius + 1))
    mask = np.asarray(cv2.dilate(mask, kernel), np.uint8)
    count, labels, _, _ = cv2.connectedComponentsWithStats(mask)
    held = np.bincount(labels[at[:, 1], at[:, 0]], minlength=count)
    large = held >= 0.1 * held.max()
    large[0] = False
    chosen = large[labels]
    place = place[chosen[at[:, 1], at[:, 0]]]
    middle, axes = _middle(place)
    core = _ellipse((height, width), middle, p.core * axes)
    return PrintPlace(np.asarray(chosen), core | ~chosen.any(), place)


def _middle(points: Points) -> tuple[Vector, Floats]:
    """Centre (2,) and matrix (2, 2) of the ellipse of one standard deviation, of the inner half of `points`, grown."""
    centre = np.median(points, axis=0)
    cov = np.cov(points.T) + np.eye(2)
    for _ in range(3):
        away = np.einsum("ni,ij,nj->n", points - centre, np.linalg.inv(cov), points - centre)
        inner = points[away <= np.median(away)]
        centre, cov = inner.mean(axis=0), np.cov(inner.T) * 3.0 + np.eye(2)
    values, vectors = np.linalg.eigh(cov)
    return centre, np.asarray((vectors * np.sqrt(values)) @ vectors.T)


def _ellipse(shape: tuple[int, int], centre: Vector, axes: Floats) -> Mask:
    """(h, w) inside of the ellipse centre + axes @ unit circle."""
    angle = np.linspace(0, 2 * np.pi, 60, endpoint=False)
    points = centre + np.stack([np.cos(angle), np.sin(angle)], axis=1) @ axes.T
    mask = np.zeros(shape, np.uint8)
    cv2.fillPoly(mask, [np.round(points).astype(np.int32)], 1)
    return mask.astype(bool)


def cast_rays(reduced: ReducedPhoto, mask: Mask, core: Mask, p: CandidateParameters) -> Rays:
    """Rays from the middle of `core`, in a frame in which print and photo are about as wide as high."""
    x0, y0, x1, y1 = reduced.window
    rows, columns = np.nonzero(core)
    cx, cy = float(columns.mean()), float(rows.mean())
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


_COLOR_BINS = (18, 32, 32)


def _color_codes(colors: Floats) -> NDArray[np.int64]:
    """Index of the colour bin of every pixel."""
    bins = (colors / np.array([6.0, 6.0, 6.0], np.float32) + np.array([0, 16, 16], np.float32)).astype(
        np.int64
    )
    bins = np.clip(bins, 0, np.array(_COLOR_BINS) - 1)
    return np.asarray((bins[..., 0] * _COLOR_BINS[1] + bins[..., 1]) * _COLOR_BINS[2] + bins[..., 2])


def _color_density(codes: NDArray[np.int64]) -> Floats:
    """Share of `codes` in every colour bin, smoothed over neighbours."""
    cube = (
        np.bincount(codes.ravel(), minlength=int(np.prod(_COLOR_BINS)))
        .reshape(_COLOR_BINS)
        .astype(np.float32)
    )
    for axis in range(3):
        cube = cube + 0.5 * (np.roll(cube, 1, axis) + np.roll(cube, -1, axis))
    return np.asarray(cube.ravel() / max(float(cube.sum()), 1.0))


def color_log_odds(colors: Floats, inside: Mask, outside: Mask | None) -> Floats:
    """(h, w) log ratio of how often a colour occurs `inside` and `outside` (None: anywhere), limited to -1..1."""
    codes = _color_codes(colors)
    floor = 1e-5
    within = _color_density(codes[inside]) + floor
    beyond = _color_density(codes if outside is None else codes[outside]) + floor
    return np.asarray(np.clip(np.log(within / beyond), -1, 1)[codes])


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
    """A closed clockwise curve (N, 2) on the reduced photo, its samples `path` (N,) on the rays, and its rating."""

    curve: Points
    path: NDArray[np.intp]
    rating: float


def find_candidates(
    reduced: ReducedPhoto,
    place: PrintPlace,
    rate: Callable[[Points], float],
    parameters: CandidateParameters | None = None,
) -> list[Candidate]:
    """Closed curves that may be the sheet's boundary; `rate` rates a curve (N, 2) on the reduced photo."""
    p = parameters or CandidateParameters()
    rays = cast_rays(reduced, place.mask, place.core, p)
    edges = edge_strength(_sample(reduced.colors, rays.points), p)
    reach, core = (
        _last_print(_sample(mask.astype(np.float32), rays.points)) for mask in (place.mask, place.core)
    )
    steps = np.arange(p.samples)[None, :]
    last = rays.shown.sum(axis=1) - 1
    none = np.zeros_like(edges)
    found: list[Candidate] = []

    def search(odds: Floats, least: Vector, typical: float) -> NDArray[np.intp]:
        score = _path_score(edges, odds, rays, max(typical, 10.0), p)
        score[steps < np.minimum(least, last)[:, None]] = -np.inf
        path = find_closed_path(score, p.max_shift, p.shift_cost)
        curve = rays.at(path)
        found.append(Candidate(curve, path, rate(curve)))
        return path

    # By colour: what is like the paper round the print, then what is like the inside of the first curve.
    odds_image = color_log_odds(reduced.colors, place.mask, None)
    typical = 1.3 * float(np.median(reach))
    for _ in range(2):
        path = search(_sample(odds_image, rays.points), p.inside * reach, typical)
        typical = float(np.median(path))
        inside = np.zeros(place.mask.shape, np.uint8)
        cv2.fillPoly(inside, [np.round(rays.at(path)).astype(np.int32)], 1)
        if (inside == 0).mean() < p.least_ground:
            break
        odds_image = color_log_odds(reduced.colors, inside > 0, inside == 0)
    # By edges alone.
    search(none, p.inside * _hull_reach(rays, reach), typical)
    # A sheet is about convex: what a curve passes by (pictures, shadows) belongs to it.
    search(none, core.astype(np.float64), typical)
    for start in sorted(found[1:], key=lambda c: -c.rating)[:2]:
        path = search(none, (1 - p.concavity) * _hull_reach(rays, start.path), typical)
        search(none, _hull_reach(rays, path) - p.tolerance, typical)
    # Of edges that are about as clear the outer ones are the sheet's.
    for outward in p.outward:
        best = max(found, key=lambda c: c.rating)
        search(none + outward, best.path - p.tolerance, typical)
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


def _last_print(printed: Floats) -> NDArray[np.intp]:
    """(N,) index of the last sample on print of every ray (0: none)."""
    there = printed > 0.5
    last = printed.shape[1] - 1 - np.argmax(there[:, ::-1], axis=1)
    return np.asarray(np.where(there.any(axis=1), last, 0), np.intp)

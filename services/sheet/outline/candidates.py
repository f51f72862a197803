"""Closed curves that may be the sheet's boundary: paths across rays from the middle of the print."""

from collections.abc import Callable
from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import Floats, Mask, Points, Vector
from services.sheet.outline.colors import Codes, Counts, color_log_odds, count_colors
from services.sheet.outline.corners import split_sides
from services.sheet.outline.edges import outward_normals, resample_closed
from services.sheet.outline.print_place import PrintPlace
from services.sheet.outline.rays import RayParameters, Rays, cast_rays
from services.sheet.outline.reduced_photo import ReducedPhoto

PARTED = 0.3
"""Weight, in ratings, of how well a curve parts the colours: one that leaves the sheet's edge along a band of the page,
or along the grain of the desk, has the same ground on both sides there. Right curves part them by 0.05 to 0.2
more; with 0.5 a frame on a page was taken for its end."""
BY_COLORS = 0.3
"""Of the radius of the best curve, by which one that is sought by its colours may be inside of it."""
BESIDE_PX = 3
"""Of the reduced photo: colours are looked at so far inside and outside of a curve."""


@dataclass(frozen=True, slots=True)
class CandidateParameters:
    """Where boundaries are searched."""

    rays: RayParameters = field(default_factory=RayParameters)
    inside: float = 0.8
    """Share of the distance to the last print on a ray; a boundary is further out. What is taken for print may lie
    beyond the sheet: without this the edge of a board was lost, and its view was skewed."""
    concavity: float = 0.08
    """Distance of creased sheets from their convex hull, as a share of the radius."""
    tolerance: float = 3.0
    """Samples by which a curve may be inside of one that it should contain."""
    outward: float = 0.15
    """Log odds of paper at all samples, if the outer one of good edges is searched."""
    extension: float = 1.04
    """A side is searched again beyond this multiple of its radius."""
    extended_share: float = 0.6
    """Share of a side's rays, in its middle, on which the new side must be further out."""
    most_cut: float = 1.0
    """Largest share of rays that leave the photo inside of the sheet. If by its colours the sheet has a larger one, no
    other curves are sought: 1 finds also the sides that are left."""


@dataclass(frozen=True, slots=True, eq=False)
class Candidate:
    """A closed clockwise curve (N, 2) on the reduced photo, its rating, and the share `cut` off by the border.

    Curves of one photo are compared by their `rank`: the rating, and how well the curve parts the colours.
    """

    curve: Points
    rating: float
    cut: float
    rank: float = 0.0


@dataclass(slots=True, eq=False)
class _Search:
    """Paths across one set of rays, and the candidates that they gave."""

    rays: Rays
    rate: Callable[[Points], float]
    parameters: CandidateParameters
    typical: float
    codes: Codes
    parted: float
    paths: list[NDArray[np.intp]] = field(default_factory=list)
    found: list[Candidate] = field(default_factory=list)
    counts: Counts = field(init=False)

    def __post_init__(self) -> None:
        self.counts = count_colors(self.codes)

    def add(self, *sought: tuple[Vector, Floats | float]) -> None:
        """The best paths, each beyond samples (N,) and with log odds of paper; all of them are sought together."""
        for path in self.rays.search(sought, self.typical, self.parameters.rays):
            # Several searches find the same path: it is rated once.
            same = (c for known, c in zip(self.paths, self.found, strict=True) if np.array_equal(known, path))
            self.found.append(next(same, None) or self._rated(path))
            self.paths.append(path)

    def _rated(self, path: NDArray[np.intp]) -> Candidate:
        """The candidate of a path (N,)."""
        curve = self.rays.at(path)
        rating = self.rate(curve)
        parted = parted_colors(self.codes, self.counts, curve) if self.parted else 0.0
        rank = rating + self.parted * parted
        return Candidate(curve, rating, float((path >= self.rays.last).mean()), rank)

    def odds_of(self, inside: Mask) -> Vector:
        """Log odds of the colour bins (K,) `inside` (h, w) and outside."""
        within = count_colors(self.codes, inside)
        return color_log_odds(within, self.counts - within)

    def best(self, count: int, first: int = 0) -> list[NDArray[np.intp]]:
        """Paths of the `count` best candidates from number `first` on, or fewer if some are the same."""
        order = sorted(range(first, len(self.found)), key=lambda k: -self.found[k].rank)
        return list({self.paths[k].tobytes(): self.paths[k] for k in order[:count]}.values())


def find_candidates(
    reduced: ReducedPhoto,
    place: PrintPlace,
    rate: Callable[[Points], float],
    p: CandidateParameters,
    parted: float = PARTED,
) -> list[Candidate]:
    """Closed curves that may be the sheet's boundary; `rate` rates a curve (N, 2) on the reduced photo.

    How well a curve parts the colours counts with the weight `parted`.
    """
    rays = cast_rays(reduced, place.core, place.mask, p.rays)
    reach = rays.reach_of_mask(place.mask)
    # By colour: what is like the ground of the print, then what is like the inside of the first curve.
    search = _Search(rays, rate, p, 1.3 * float(np.median(reach)), reduced.codes, parted)
    odds = color_log_odds(count_colors(search.codes, place.mask), search.counts)
    for _ in range(2):
        search.add((p.inside * reach, rays.sample(odds[search.codes])))
        path = search.paths[-1]
        search.typical = float(np.median(path))
        inside = _filled(rays.at(path), place.mask.shape)
        if inside.all():
            break
        odds = search.odds_of(inside)
    if search.found[-1].cut > p.most_cut:
        return search.found
    # By edges alone, beyond the print, or beyond its core if texture of a desk was found as print.
    core = rays.reach_of_mask(place.core).astype(np.float64)
    search.add((p.inside * rays.reach_of_hull(rays.at(reach)), 0.0), (core, 0.0))
    # A sheet is nearly convex: what lies in a notch of the curve (pictures, shadows) belongs to it.
    best = search.best(2, first=1)
    search.add(*(((1 - p.concavity) * rays.reach_of_hull(rays.at(path)), 0.0) for path in best))
    return search.found


def improve_candidate(
    reduced: ReducedPhoto,
    start: Candidate,
    rate: Callable[[Points], float],
    p: CandidateParameters,
    parted: float = PARTED,
) -> list[Candidate]:
    """Curves near and outside of `start`, searched on rays from its own middle; see `find_candidates`."""
    inside = _filled(start.curve, reduced.colors.shape[:2])
    if inside.sum() < 50:
        return []
    rays = cast_rays(reduced, inside, inside, p.rays)
    reach = rays.reach_of_mask(inside)
    search = _Search(rays, rate, p, float(np.median(reach)), reduced.codes, parted)
    odds = rays.sample(search.odds_of(inside)[reduced.codes])
    search.add(
        ((1 - p.concavity) * reach, 0.0), (reach - p.tolerance, p.outward), ((1 - BY_COLORS) * reach, odds)
    )
    path = search.best(1)[0]
    search.add((rays.reach_of_hull(rays.at(path)) - p.tolerance, 0.0))
    _extend_sides(search, path)
    return search.found


def _extend_sides(search: _Search, path: NDArray[np.intp]) -> None:
    """Paths that leave three sides where they are and go beyond the fourth: a heading on a ground of its own."""
    p = search.parameters
    inner = path < search.rays.last - 1
    corners = split_sides(search.rays.at(path), np.asarray(inner))
    if corners is None:
        return
    count = len(path)
    sought: list[tuple[Vector, Floats | float]] = []
    for start, end in zip(corners.indices, np.roll(corners.indices, -1), strict=True):
        length = int(end - start) % count
        margin = int(0.5 * (1 - p.extended_share) * length)
        middle = (start + np.arange(margin, length - margin + 1)) % count
        if not inner[middle].any():
            continue
        least = path - p.tolerance
        least[middle] = p.extension * path[middle] + p.tolerance
        # Between the corners of the old side and the new one, the outer of two good edges is the sheet's.
        outward = np.zeros((count, 1))
        outward[(start - margin + np.arange(length + 2 * margin + 1)) % count] = p.outward
        sought.append((least, outward))
    if sought:
        search.add(*sought)


def parted_colors(codes: Codes, counts: Counts, curve: Points) -> float:
    """How well a `curve` (N, 2) parts the colours of a photo with `codes` (h, w) next to it, -1 to 1.

    `counts` are the numbers of pixels in all bins.
    """
    inside = _filled(curve, codes.shape)
    within = count_colors(codes, inside)
    beyond = counts - within
    if not within.any() or not beyond.any():
        return 0.0
    points = resample_closed(curve, 200)
    normals = outward_normals(points, 3)
    high = np.array(codes.shape[::-1]) - 1
    shown = ((points > BESIDE_PX) & (points < high - BESIDE_PX)).all(axis=1)
    if not shown.any():
        return 0.0
    sides = np.concatenate([(points + way * normals)[shown] for way in (-BESIDE_PX, BESIDE_PX)])
    at = np.clip(np.round(sides).astype(int), 0, high)
    odds = color_log_odds(within, beyond, codes[at[:, 1], at[:, 0]])
    return float(np.sum(odds[: shown.sum()] - odds[shown.sum() :])) / (2 * len(points))


def _filled(curve: Points, shape: tuple[int, ...]) -> Mask:
    """(h, w) inside of a curve (N, 2)."""
    mask = np.zeros(shape[:2], np.uint8)
    cv2.fillPoly(mask, [np.round(curve).astype(np.int32)], 1)
    return mask.astype(bool)

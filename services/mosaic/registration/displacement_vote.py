"""The vote over scale and displacement (4.3).

Between two rectified views a true match (p, q) has p = s q + d, the same scale s and displacement d as every other
true match; we say that they are *compatible*. Text repeats itself, so nine matches of ten are false, which defeats
sampling; but false matches agree with each other by chance only. For every scale of a range the displacements p - s q
fill a histogram: at the true scale the true matches share one bin, the *compatible group*, and at others they scatter.
The largest group over all scales gives the scale, the displacement and the true matches at once.

Three things are added to the dissertation's procedure. A feature has a size, and the sizes of a true match tell its
scale: a match votes for scales near the one it measures only, which takes most of the false votes away. False matches
crowd at displacements under which the views overlap much, and hide the groups of small overlaps: groups are ranked by
how far they stand out from their surroundings in the histogram. And several are returned, because the first of a small
overlap may be a chance one; what follows verifies them.
"""

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import Floats, Vector
from services.mosaic.registration.features import FeatureMatches

SURROUNDINGS = 13
"""Bins across of what a group is compared with; 21 does as well."""


@dataclass(frozen=True, slots=True)
class VoteParameters:
    """The range is what photos taken by hand differ by; the rest was measured on simulated and real sets."""

    least_scale: float = 0.55
    greatest_scale: float = 1.8
    scales: int = 41
    """Steps of 3 %: within half a step, a match half a view off the middle moves by less than a bin. Where text sizes
    tell that scales differ by more, the range goes on to them in the same steps."""
    bins_per_diagonal: float = 90.0
    """Bins are a's diagonal over this wide. The dissertation says 20 and that it is not critical; finer bins hold
    fewer false matches: of pairs that share less than 8 % of the page, 90 rank the truth higher than 60, as 130 do."""
    size_tolerance: float = math.log(1.4)
    """A match votes for scales within this (logarithm) of its sizes' quotient."""
    reach: float = 2.5
    """Bins round a group's middle that are the same place."""
    groups: int = 4
    """Returned groups."""
    least_votes: int = 3
    """Smaller groups are chance."""


@dataclass(frozen=True, slots=True, eq=False)
class CompatibleGroup:
    """Matches `members` (indices) that agree in point_a = scale * point_b + displacement."""

    scale: float
    displacement: Vector
    members: NDArray[np.intp]

    @property
    def votes(self) -> int:
        """How many agree."""
        return len(self.members)


def vote_displacements(
    matches: FeatureMatches,
    diagonal: float,
    parameters: VoteParameters | None = None,
    expected_scale: float = 1.0,
) -> tuple[CompatibleGroup, ...]:
    """Compatible groups in places that differ, the one that stands out most first; `diagonal` of view a in pixels.

    `expected_scale` is what the sizes of text in a and b say; headings and notes may make it wrong.
    """
    p = parameters or VoteParameters()
    scales = _scales(p, expected_scale)
    bin_px = diagonal / p.bins_per_diagonal
    # (scales, matches, 2), in bins, from the least displacement on with one empty bin as a border.
    bins = (matches.points_a - scales[:, None, None] * matches.points_b) / bin_px
    measured = np.log(np.maximum(matches.sizes_a, 1e-9) / np.maximum(matches.sizes_b, 1e-9))
    voting = np.abs(measured - np.log(scales)[:, None]) < p.size_tolerance
    groups: list[CompatibleGroup] = []
    while len(groups) < p.groups and np.count_nonzero(voting):
        row, middle = _outstanding_bin(bins, voting)
        away = np.max(np.abs(bins[row] - middle), axis=1)
        members = np.flatnonzero((away <= 1.5) & voting[row])
        if len(members) < p.least_votes:
            break
        scale = float(scales[row])
        displacement = np.median(matches.points_a[members] - scale * matches.points_b[members], axis=0)
        groups.append(CompatibleGroup(scale, displacement, members))
        voting = voting & (away > p.reach)
    return tuple(groups)


def _scales(p: VoteParameters, expected: float) -> Vector:
    """The range and, as far beyond, what is expected."""
    least, greatest = p.least_scale * min(expected, 1.0), p.greatest_scale * max(expected, 1.0)
    step = math.log(p.greatest_scale / p.least_scale) / (p.scales - 1)
    return np.geomspace(least, greatest, 1 + round(math.log(greatest / least) / step))


def _outstanding_bin(bins: Floats, voting: NDArray[np.bool_]) -> tuple[int, Vector]:
    """Scale (its row) and middle (2,), in bins, of the sum over 3 x 3 bins that stands out most."""
    row, match = np.nonzero(voting)
    at = np.floor(bins[row, match]).astype(np.intp)
    low = at.min(axis=0)
    columns, rows = at.max(axis=0) - low + 1
    # The histograms of all scales lie below each other, far enough apart not to see each other.
    pitch = rows + SURROUNDINGS
    flat = (row * pitch + at[:, 1] - low[1]) * columns + at[:, 0] - low[0]
    counts = np.bincount(flat, minlength=len(bins) * pitch * columns).astype(np.float32)
    surprise = _surprise(counts.reshape(len(bins) * pitch, columns))
    y, x = np.unravel_index(int(np.argmax(surprise)), surprise.shape)
    return int(y) // int(pitch), np.array([x, y % pitch]) + low + 0.5


def _surprise(histograms: NDArray[np.float32]) -> NDArray[np.float32]:
    """By how many deviations of a Poisson count each sum over 3 x 3 bins exceeds what lies round it."""
    near, wide = (
        np.asarray(cv2.boxFilter(histograms, -1, (n, n), normalize=False, borderType=cv2.BORDER_CONSTANT))
        for n in (3, SURROUNDINGS)
    )
    expected = (wide - near) * (9 / (SURROUNDINGS**2 - 9))
    return np.asarray((near - expected) / np.sqrt(np.maximum(expected, 0) + 1), np.float32)

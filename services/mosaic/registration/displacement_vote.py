"""Vote over scale and displacement (4.3).

Between two rectified views, a true match (p, q) satisfies p = s q + d, with the same scale s and displacement d for all
true matches; such matches are *compatible*. Text repeats itself, so nine of ten matches are false: too many for
random sampling. But false matches agree with each other only by chance. For every scale of a range, the displacements p
- s q are counted in a histogram. At the true scale the true matches fall into one bin, the *compatible group*; at other
scales they scatter. The largest group over all scales gives the scale, the displacement and the true matches together.

Three things extend the dissertation's procedure. First, features have sizes, so a match has a scale. It votes only for
scales near its own, which removes most false votes. Second, groups are ranked by how much they exceed their
surroundings in the histogram, because false matches concentrate at displacements with a large overlap and would hide
the groups of small overlaps. Third, several groups are returned and verified later, because in a small overlap the
first may be false.
"""

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import Floats, Vector
from services.kernels.library import address, find_kernels
from services.mosaic.registration.features import FeatureMatches

SURROUNDINGS = 13
"""Width, in bins, of the surroundings with which a group is compared; 21 works equally well."""


# The range covers photos taken by hand; the other values were measured on simulated and real sets.
LEAST_SCALE = 0.55
GREATEST_SCALE = 1.8
SCALES = 41
"""Steps of 3 %: within half a step, a match at half a view from the centre moves by less than a bin. If text sizes
indicate a larger difference of scales, the range is extended in the same steps."""
BINS_PER_DIAGONAL = 90.0
"""Bins per diagonal of a. The dissertation uses 20 and calls it uncritical. Smaller bins contain fewer false
matches: for pairs that share less than 8 % of the page, 90 ranks the truth higher than 60, as does 130."""
SIZE_TOLERANCE = math.log(1.4)
"""Largest difference between the logarithms of a match's own scale and of the scale that it votes for."""
GROUP_REACH = 1.5
"""Distance of a group's members from its centre along each axis, bins: they are counted in 3 x 3 bins."""
REACH = 2.5
"""Radius around a group's centre, in bins, that counts as the same place."""
GROUPS = 4
"""Number of returned groups."""


FARTHEST = 1e9
"""Bins of a displacement, at most."""
LEAST_VOTES = 3
"""Least size of a group; smaller ones occur by chance."""


@dataclass(frozen=True, slots=True, eq=False)
class CompatibleGroup:
    """Matches `members` (indices) that agree in point_a = scale * point_b + displacement."""

    scale: float
    displacement: Vector
    members: NDArray[np.intp]

    @property
    def votes(self) -> int:
        """Number of matches in the group."""
        return len(self.members)


def vote_displacements(
    matches: FeatureMatches,
    diagonal: float,
    expected_scale: float = 1.0,
) -> tuple[CompatibleGroup, ...]:
    """Compatible groups at different places, most significant first; `diagonal` of view a in pixels.

    `expected_scale` is the ratio of text sizes in a and b; headings and notes may make it wrong.
    """
    scales = _scales(expected_scale)
    bin_px = diagonal / BINS_PER_DIAGONAL
    # (scales, matches, 2), in bins, from the least displacement on with one empty bin as a border.
    bins = (matches.points_a - scales[:, None, None] * matches.points_b) / bin_px
    measured = np.log(np.maximum(matches.sizes_a, 1e-9) / np.maximum(matches.sizes_b, 1e-9))
    voting = np.abs(measured - np.log(scales)[:, None]) < SIZE_TOLERANCE
    groups: list[CompatibleGroup] = []
    while len(groups) < GROUPS and np.count_nonzero(voting):
        row, middle = outstanding_bin(bins, voting)
        away = np.max(np.abs(bins[row] - middle), axis=1)
        members = np.flatnonzero((away <= GROUP_REACH) & voting[row])
        if len(members) < LEAST_VOTES:
            break
        scale = float(scales[row])
        displacement = np.median(matches.points_a[members] - scale * matches.points_b[members], axis=0)
        groups.append(CompatibleGroup(scale, displacement, members))
        voting = voting & (away > REACH)
    return tuple(groups)


def _scales(expected: float) -> Vector:
    """The scales of the range, extended to the expected scale."""
    least, greatest = LEAST_SCALE * min(expected, 1.0), GREATEST_SCALE * max(expected, 1.0)
    step = math.log(GREATEST_SCALE / LEAST_SCALE) / (SCALES - 1)
    return np.geomspace(least, greatest, 1 + round(math.log(greatest / least) / step))


def outstanding_bin(bins: Floats, voting: NDArray[np.bool_]) -> tuple[int, Vector]:
    """Scale (its row) and centre (2,), in bins, of the most significant sum over 3 x 3 bins.

    `bins` (scales, matches, 2) are displacements, of which those `voting` (scales, matches) count, one at least.
    """
    if bins.shape != (*voting.shape, 2) or not voting.any() or not np.abs(bins).max() < FARTHEST:
        raise ValueError("matches vote for displacements at scales")
    kernels = find_kernels()
    if kernels is None:
        return outstanding_bin_plain(bins, voting)
    places, votes = np.ascontiguousarray(bins, np.float64), np.ascontiguousarray(voting)
    found = np.zeros(3, np.int64)
    if not kernels.outstanding_bin(address(places), address(votes), *votes.shape, address(found)):
        raise MemoryError
    return int(found[0]), found[1:] + 0.5


def outstanding_bin_plain(bins: Floats, voting: NDArray[np.bool_]) -> tuple[int, Vector]:
    """`outstanding_bin` by NumPy and OpenCV: the same."""
    row, match = np.nonzero(voting)
    at = np.floor(bins[row, match]).astype(np.intp)
    low = at.min(axis=0)
    columns, rows = at.max(axis=0) - low + 1
    # The histograms of all scales are stacked with gaps, so that windows do not overlap two of them.
    pitch = rows + SURROUNDINGS
    flat = (row * pitch + at[:, 1] - low[1]) * columns + at[:, 0] - low[0]
    counts = np.bincount(flat, minlength=len(bins) * pitch * columns).astype(np.uint16)
    y, x = _most_surprising(counts.reshape(len(bins) * pitch, columns))
    return y // int(pitch), np.array([x, y % pitch]) + low + 0.5


def _most_surprising(histograms: NDArray[np.uint16]) -> tuple[int, int]:
    """Row and column whose 3 x 3 bins exceed their surroundings most, in standard deviations of a Poisson count."""
    near, wide = (
        np.asarray(cv2.boxFilter(histograms, -1, (n, n), normalize=False, borderType=cv2.BORDER_CONSTANT))
        for n in (3, SURROUNDINGS)
    )
    some = np.flatnonzero(near > 0)  # what most bins are not
    counted, around = near.ravel()[some], wide.ravel()[some]
    expected = (around - counted) * np.float32(9 / (SURROUNDINGS**2 - 9))
    surprise = (counted - expected) / np.sqrt(expected + 1)
    place, columns = int(some[np.argmax(surprise)]), histograms.shape[1]
    return place // columns, place % columns

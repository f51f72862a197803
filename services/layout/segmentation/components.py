"""Classification of components (glyphs, rules, other ink), and pairs of neighbouring boxes."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from services.layout.segmentation.ink import InkComponents

LEAST_GLYPH = 0.4
"""Least height of what makes lines, in units: small print's x-height."""
_LARGEST_GLYPH = 6.0
"""Largest one: a large heading's capitals."""
_RULE_ASPECT = 9.0
"""Least ratio of a rule's length to its thickness."""
_RULE_THICKNESS = 0.5
"""Rules are thinner than this, in units."""


Boxes = NDArray[np.float64]
"""(N, 4) x0, y0, x1, y1 in pixels of the working copy."""
Indices = NDArray[np.intp]

_MOST_PAIRS = 4_000_000
"""Pairs that are processed together; a page of print has 0.5 million."""


@dataclass(frozen=True, slots=True, eq=False)
class Kinds:
    """Masks (N,) of components: what may be glyphs, rules along the rows or columns, and other large ink."""

    glyphs: NDArray[np.bool_]
    rules: NDArray[np.bool_]
    large: NDArray[np.bool_]


def classify_components(components: InkComponents, unit: float, slope: float) -> Kinds:
    """Kinds by size relative to `unit`, the page's glyph height in px; components of no kind are specks."""
    width, height, area = components.width, components.height, components.area
    # A slanting rule's box is higher than the rule.
    level = np.maximum(height - abs(slope) * width, 1.0), np.maximum(width - abs(slope) * height, 1.0)
    thickness = np.minimum(*level)
    length = np.maximum(width, height)
    rules = (length > _RULE_ASPECT * thickness) & (length > 4 * unit)
    rules &= (area / length < _RULE_THICKNESS * unit) & (thickness < unit)
    glyphs = (height >= LEAST_GLYPH * unit) & (height <= _LARGEST_GLYPH * unit)
    glyphs &= ~rules & (height < 12 * width) & (width < 60 * height)
    solid = area > 0.85 * width * height
    glyphs &= ~(solid & (height > 2.0 * unit) & (width > 2.0 * unit))
    large = ~rules & ~glyphs & (length > unit)
    return Kinds(glyphs, rules, large)


def near_pairs(low: NDArray[np.float64], high: NDArray[np.float64]) -> tuple[Indices, Indices]:
    """Pairs (i, j), i != j, of intervals [low, high] (N,) that overlap; each pair once, in no special order."""
    order = np.argsort(low)
    ends = np.searchsorted(low[order], high[order], side="left")
    counts = np.maximum(ends - np.arange(len(low)) - 1, 0)
    total = np.cumsum(counts)
    if len(total) and total[-1] > _MOST_PAIRS:
        # Only dirt has this many overlaps; there the nearest neighbours are enough.
        counts = np.minimum(counts, _MOST_PAIRS // len(low))
        total = np.cumsum(counts)
    first = np.repeat(np.arange(len(low)), counts)
    second = np.arange(len(first)) - np.repeat(total - counts, counts) + first + 1
    return order[first], order[second]


def members_of(groups: Indices) -> list[Indices]:
    """Items of each group, of the numbers of all items' groups (N,); negative ones are none."""
    order = np.argsort(groups, kind="stable")
    order = order[groups[order] >= 0]
    return np.split(order, np.flatnonzero(np.diff(groups[order])) + 1)

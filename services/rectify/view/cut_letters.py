"""Print that the border of the photo cuts: letters in a row along it, and lines that end at it in a cut letter."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from services.arrays import Floats, Points, Vector
from services.geometry.homographies import from_resized
from services.rectify.shape_choice.shaped_page import ShapedPage
from services.rectify.view.outside_text import REACH as LETTER_REACH
from services.rectify.view.print_kept import REACH, WORD
from services.sheet.outline.results import BELIEVED_CONFIDENCE
from services.texture_flow.text_identification import ALIGNMENT, SIZE_RATIO

LEAST_SEEN = 0.25
"""Text heights of a cut letter that must be in the photo, ..."""
LARGEST_LETTER = 1.5
"""... and its largest extent: what is longer is a rule, a shadow or a desk."""
STEEP = float(np.cos(np.deg2rad(30.0)))
"""A line that ends at the border runs within 30 degrees of the way into the photo."""
LINE = 8.0
"""Text heights of a line that are looked at from its end."""


def count_cut_letters(page: ShapedPage, boxes: Floats) -> int:
    """Letters of `page` in rows that the photo's border cuts, the most at one border; `boxes` (N, 4, 2) are its print.

    A row along the border counts with its cut letters, a line that ends there in one counts whole. A cut letter is ink
    that reaches the border, of the size of letters, beside print of the page. No character is among them: a cut letter
    is no evidence of anything else.
    """
    analysis = page.analysis
    if analysis is None or not len(boxes):
        return 0
    labels, height = analysis.text.label_image, page.text_height_px
    sides = np.linalg.norm(boxes[:, [1, 3]] - boxes[:, [0]], axis=2)
    printed = _Print(boxes.mean(axis=1), np.sqrt(sides.prod(axis=1)))
    depth = int(np.ceil(LARGEST_LETTER * printed.sizes.max() * analysis.factor))
    most = 0
    for turns in range(4):
        places, deep, wide = _ink_at_first_row(np.rot90(labels, turns), depth)
        whole = deep <= depth
        inward = np.array([[0.0, 1.0]])
        for k in reversed(range(turns)):
            # Back by a quarter turn, which takes (x, y) of an array of W columns to (y, W - 1 - x).
            places = np.column_stack([labels.shape[(k + 1) % 2] - 1 - places[:, 1], places[:, 0]])
            inward = np.column_stack([-inward[:, 1], inward[:, 0]])
        at, deep, wide = from_resized(places, analysis.factor), deep / analysis.factor, wide / analysis.factor
        if page.outline is not None and page.outline.confidence >= BELIEVED_CONFIDENCE:
            whole &= page.outline.holds(at)
        beside = np.isfinite(printed.tree.query(at, distance_upper_bound=REACH * height)[0])
        large = np.maximum(deep, wide)
        specks = beside & (large < LEAST_SEEN * height)
        letters = beside & (deep >= LEAST_SEEN * height) & (large <= LARGEST_LETTER * height)
        # Grain of a desk is mostly specks.
        if letters.sum() > specks.sum():
            most = max(most, int(letters.sum()))
        most = max(most, printed.count_in_lines(at[whole], deep[whole], large[whole], inward[0]))
    return most


class _Print:
    """Characters with their `centres` (N, 2) and `sizes` (N,), photo pixels."""

    def __init__(self, centres: Points, sizes: Vector) -> None:
        self.sizes = sizes
        self.tree = cKDTree(centres)
        self._centres = centres

    def count_in_lines(self, ink: Points, deep: Vector, large: Vector, inward: Vector) -> int:
        """Letters of lines that end in a cut one; `ink` (M, 2) reaches the border of the photo, `deep` (M,) into it.

        `large` (M,) are the largest extents of that ink, `inward` (2,) is the way into the photo. None where more of
        the ink beside print ends no line: that is texture.
        """
        found, others = [], 0
        for place, depth, extent in zip(ink, deep, large, strict=True):
            near = self.tree.query(place, k=min(12, len(self.sizes)))
            count, is_beside, is_line = 0, False, False
            for distance, k in zip(*(np.atleast_1d(each) for each in near), strict=True):
                size = self.sizes[k]
                is_beside |= bool(distance <= REACH * size)
                if not 0 < distance <= LETTER_REACH * size or extent > LARGEST_LETTER * size:
                    continue
                along = (self._centres[k] - place) / distance
                letters = self._letters_along(place, along, size) if along @ inward >= STEEP else 0
                is_line |= letters >= WORD
                # A sliver of a letter may be grain: it says nothing.
                count = max(count, letters) if depth >= LEAST_SEEN * size else count
            if count >= WORD:
                found.append(count)
            elif is_beside and not is_line:
                others += 1
        return sum(found) if len(found) > others else 0

    def _letters_along(self, place: Points, along: Vector, size: float) -> int:
        """Letters like one of `size` in a row from `place` (2,) on in the direction `along` (2,), without a gap."""
        row = np.array(self.tree.query_ball_point(place, LINE * size), int)
        ways = self._centres[row] - place
        ahead, aside = ways @ along, np.abs(ways[:, 0] * along[1] - ways[:, 1] * along[0])
        like = np.maximum(self.sizes[row] / size, size / self.sizes[row]) < SIZE_RATIO
        steps = np.sort(ahead[(ahead > 0) & (aside < ALIGNMENT * size) & like])
        gaps = np.flatnonzero(np.diff(steps) > REACH * size)
        return int(gaps[0]) + 1 if len(gaps) else len(steps)


def _ink_at_first_row(labels: NDArray[np.int32], depth: int) -> tuple[Points, Vector, Vector]:
    """Middles (N, 2), depths (N,) and widths (N,) of the components of `labels` (H, W) that reach the first row.

    They are seen down to `depth` rows.
    """
    strip = labels[: depth + 1]
    found = np.unique(strip[0][strip[0] > 0])
    rows, columns = np.nonzero(np.isin(strip, found) & (strip > 0))
    index = np.searchsorted(found, strip[rows, columns])
    low, high, deep = (
        np.full(len(found), strip.shape[1]),
        np.zeros(len(found), int),
        np.zeros(len(found), int),
    )
    np.minimum.at(low, index, columns)
    np.maximum.at(high, index, columns)
    np.maximum.at(deep, index, rows)
    return np.column_stack([0.5 * (low + high), 0.5 * deep]), deep + 1.0, high - low + 1.0

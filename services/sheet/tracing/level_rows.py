"""Rows of characters that are straight and level: what print has and texture has not."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from services.arrays import Mask, Vector
from services.order_statistics import median
from services.robust import geman_mcclure_weights
from services.sheet.tracing.baselines import EDGE_ROUNDS, MIN_LENGTH, CharacterRows, chain_characters

# When rows of characters are those of print. Lengths are multiples of a row's character height.
LEVEL_RAD = 0.05
NEAR = 0.12
"""Distance from the row's line up to which a character stands, or ends, on it ..."""
ON_LINE = 0.6
"""... as this share of the row's characters does: the others have descenders, or ascenders."""
ROWS = 2
SHARE = 0.15
"""Of the components, those in level rows. Pages have 0.25 (a blurred table) to 0.99, pictures up to 0.1."""
UPRIGHT_SHARE = 1 / 3
"""Of the components in level rows, at most so many are in upright ones too ..."""
PITCH = 0.75
"""... or level rows are denser by this: letters are nearer to each other than lines, tiles of a grid are not."""
LONG_ROW = 20
"""A single row of so many characters is enough."""


@dataclass(frozen=True, slots=True)
class LevelRows:
    """Number of straight level `rows`, and how many of all `components` are `characters` in them.

    `pitch_px` is the median step from a character of a row to the next one; infinite without rows.
    """

    rows: int
    characters: int
    components: int
    pitch_px: float

    @property
    def share(self) -> float:
        """Share of the components that are in rows, 0-1."""
        return self.characters / max(self.components, 1)


def count_level_rows(ink: Mask) -> LevelRows:
    """Rows of components of `ink` (H, W) that stand on a straight line, or end at one, within 3 degrees of level."""
    found, level = find_level_rows(ink)
    steps = np.concatenate([np.zeros(0), *(np.diff(np.sort(found.left[members])) for members in level)])
    pitch = median(steps) if len(steps) else float("inf")
    return LevelRows(len(level), sum(map(len, level)), len(found.left), pitch)


def find_level_rows(ink: Mask) -> tuple[CharacterRows, list[NDArray[np.intp]]]:
    """Components of `ink` (H, W), and those of its rows that are straight and level: the numbers of their members."""
    found = chain_characters(ink)
    return found, [members for members in found.rows if _is_level(found, members)]


def shows_print(ink: Mask) -> bool:
    """Whether `ink` (H, W) has level rows as text has: enough, and more than upright ones."""
    level = count_level_rows(ink)
    if level.share < SHARE or (level.rows < ROWS and level.characters < LONG_ROW):
        return False
    upright = count_level_rows(np.ascontiguousarray(ink.T))
    few = upright.characters <= UPRIGHT_SHARE * level.characters
    return few or level.pitch_px < PITCH * upright.pitch_px


def _is_level(found: CharacterRows, members: NDArray[np.intp]) -> bool:
    """Whether the characters `members` (n,) stand on a level line, or end at one."""
    top, bottom = found.top[members], found.bottom[members]
    height = median(bottom - top)
    x = 0.5 * (found.left[members] + found.right[members])
    if float(np.ptp(x)) < MIN_LENGTH * height:
        return False
    x = (x - x.mean()) / height
    return any(_on_line(x, (edge - median(edge)) / height) for edge in (bottom, top))


def _on_line(x: Vector, y: Vector) -> bool:
    """Whether most points (x, y), both (n,), lie on a level line."""
    rest, slope = y, 0.0
    for _ in range(EDGE_ROUNDS):
        weights = geman_mcclure_weights(rest, NEAR)
        weights = weights / weights.sum()
        along = x - weights @ x
        slope = float((weights * along) @ y / ((weights * along) @ along))
        rest = y - weights @ y - slope * along
    return abs(slope) < LEVEL_RAD and float((np.abs(rest) < NEAR).mean()) > ON_LINE

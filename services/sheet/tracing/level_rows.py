"""Rows of characters that are straight and level: what print has and texture has not."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from services.arrays import Mask, Vector
from services.order_statistics import median
from services.robust import geman_mcclure_weights
from services.sheet.tracing.baselines import CharacterRows, chain_characters


@dataclass(frozen=True, slots=True)
class LevelRowParameters:
    """When rows of characters are those of print. Lengths are multiples of a row's character height."""

    level_rad: float = 0.05
    near: float = 0.12
    """Distance from the row's line up to which a character stands, or ends, on it ..."""
    on_line: float = 0.6
    """... as this share of the row's characters does: the others have descenders, or ascenders."""
    length: float = 6.0
    rounds: int = 8
    rows: int = 2
    share: float = 0.15
    """Of the components, those in level rows. Pages have 0.25 (a blurred table) to 0.99, pictures up to 0.1."""
    upright_share: float = 1 / 3
    """Of the components in level rows, at most so many are in upright ones too ..."""
    pitch: float = 0.75
    """... or level rows are denser by this: letters are nearer to each other than lines, tiles of a grid are not."""
    long_row: int = 20
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


def count_level_rows(ink: Mask, parameters: LevelRowParameters | None = None) -> LevelRows:
    """Rows of components of `ink` (H, W) that stand on a straight line, or end at one, within 3 degrees of level."""
    p = parameters or LevelRowParameters()
    found = chain_characters(ink)
    level = [members for members in found.rows if _is_level(found, members, p)]
    steps = np.concatenate([np.zeros(0), *(np.diff(np.sort(found.left[members])) for members in level)])
    pitch = median(steps) if len(steps) else float("inf")
    return LevelRows(len(level), sum(map(len, level)), len(found.left), pitch)


def shows_print(ink: Mask, parameters: LevelRowParameters | None = None) -> bool:
    """Whether `ink` (H, W) has level rows as text has: enough, and more than upright ones."""
    p = parameters or LevelRowParameters()
    level = count_level_rows(ink, p)
    if level.share < p.share or (level.rows < p.rows and level.characters < p.long_row):
        return False
    upright = count_level_rows(np.ascontiguousarray(ink.T), p)
    few = upright.characters <= p.upright_share * level.characters
    return few or level.pitch_px < p.pitch * upright.pitch_px


def _is_level(found: CharacterRows, members: NDArray[np.intp], p: LevelRowParameters) -> bool:
    """Whether the characters `members` (n,) stand on a level line, or end at one."""
    top, bottom = found.top[members], found.bottom[members]
    height = median(bottom - top)
    x = 0.5 * (found.left[members] + found.right[members])
    if float(np.ptp(x)) < p.length * height:
        return False
    x = (x - x.mean()) / height
    return any(_on_line(x, (edge - median(edge)) / height, p) for edge in (bottom, top))


def _on_line(x: Vector, y: Vector, p: LevelRowParameters) -> bool:
    """Whether most points (x, y), both (n,), lie on a level line."""
    terms = np.column_stack([np.ones(len(x)), x])
    rest, slope = y, 0.0
    for _ in range(p.rounds):
        weights = np.sqrt(geman_mcclure_weights(rest, p.near))
        level, slope = np.linalg.lstsq(terms * weights[:, None], y * weights, rcond=None)[0]
        rest = y - level - slope * x
    return abs(slope) < p.level_rad and float((np.abs(rest) < p.near).mean()) > p.on_line

"""The heights of sheets that were folded crosswise, and of crumpled ones."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import LinearNDInterpolator

from simulation.flat_page import Points


@dataclass(frozen=True, slots=True)
class Crossed:
    """Folded in half from top to bottom, then from side to side, and opened.

    The first crease turns by `first_deg` along its whole length, the second by `second_deg` above the first
    and, as both layers were folded at once, by as much the other way below (`alike`: the same way, where it was
    opened between the folds). `centre` is where the creases meet, `skew_deg` how far they miss the sheet's axes.
    """

    half_height: float
    first_deg: float
    second_deg: float
    alike: bool = False
    centre: tuple[float, float] = (0.0, 0.0)
    skew_deg: float = 0.0

    def wanted(self, sheet: Points) -> NDArray[np.float64]:
        """See `Heights`."""
        turn = np.radians(self.skew_deg)
        c, s = np.cos(turn), np.sin(turn)
        across, down = ((sheet - np.array(self.centre)) @ np.array([[c, -s], [s, c]])).T
        first, second = (float(np.tan(np.radians(angle) / 2)) for angle in (self.first_deg, self.second_deg))
        side = np.ones(len(sheet)) if self.alike else np.sign(-down)
        # Positive turns rise towards the viewer on both sides of the crease. Where the second crease changes
        # its sign the sheet is flat: its height grows with the distance from the first.
        grown = 1.0 if self.alike else np.tanh(np.abs(down) / 0.4)
        return np.asarray(-first * np.abs(down) - second * side * grown * np.abs(across), np.float64)


@dataclass(frozen=True, slots=True)
class Crumpled:
    """Facets between random points: `facets` of them across the page, steep by about `angle_deg`."""

    half_height: float
    seed: int
    angle_deg: float = 10.0
    facets: float = 4.0

    def wanted(self, sheet: Points) -> NDArray[np.float64]:
        """See `Heights`."""
        rng = np.random.default_rng(self.seed)
        cell = 2.0 / self.facets
        columns = int(np.ceil((2.0 + 2 * cell) / cell)) + 1
        rows = int(np.ceil((2.0 * self.half_height + 2 * cell) / cell)) + 1
        grid = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=-1).reshape(-1, 2)
        corners = (grid - np.array([columns - 1, rows - 1]) / 2 + rng.uniform(-0.45, 0.45, grid.shape)) * cell
        heights = rng.uniform(-1.0, 1.0, len(corners)) * np.tan(np.radians(self.angle_deg)) * cell / 1.2
        frame = np.abs(corners).max() * 2 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
        facets = LinearNDInterpolator(
            np.concatenate([corners, frame]), np.concatenate([heights, np.zeros(4)])
        )
        return np.asarray(facets(sheet), np.float64)

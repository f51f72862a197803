"""What is known of a page's rulings, in centred unit coordinates of the photo."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from services.arrays import Floats, Points, Vector


@dataclass(frozen=True, slots=True, eq=False)
class ProjectedRulings:
    """Rulings in the photo, in order across the page (3.3.3).

    `points` (N, 2) are the reference points of Appendix B, `angles` (N,) the directions, rad in [0, pi),
    `qualities` (N,) the convergence quality at the chosen direction (0: perfect), `curved` (N,) tells where the
    surface bends enough to show its ruling; the others took theirs from these.
    """

    points: Points
    angles: Vector
    qualities: Vector
    curved: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.angles)


@dataclass(frozen=True, slots=True, eq=False)
class RulingVanishingPoints:
    """Vanishing points of the rulings from line spacing (3.3.4).

    `directions` (N, 3) are homogeneous unit vectors (a zero third coordinate: at infinity), `deviations` (N,) the
    standard deviation, in radians, of the vanishing point as seen from the camera when the focal length is 1 unit;
    infinite where the ruling crosses too few lines of equal spacing.
    """

    directions: Floats
    deviations: Vector

"""What an experiment on simulated photos is."""

from dataclasses import dataclass

from simulation.scenes import POSES, SKEWS_RAD, View
from simulation.sheets import Staging
from simulation.surfaces import Shape


@dataclass(frozen=True, slots=True)
class Experiment:
    """Every page in every one of these shapes, poses and skews (radians).

    With `stagings` it is of whole sheets: each shape once, while pages, poses, stagings and skews take turns.
    """

    name: str
    shapes: tuple[Shape, ...]
    views: tuple[View, ...] = POSES
    skews_rad: tuple[float, ...] = SKEWS_RAD
    stagings: tuple[Staging, ...] = ()

    def file_name(self, *, degraded: bool) -> str:
        """What its figures are filed under."""
        return f"rectify_{self.name}" + ("_degraded" if degraded else "")

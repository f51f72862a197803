"""What an experiment on simulated photos is."""

from dataclasses import dataclass

from simulation.cropping import Cut
from simulation.scenes import POSES, SKEWS_RAD, View
from simulation.sheets import Staging
from simulation.surfaces import Shape


@dataclass(frozen=True, slots=True)
class Experiment:
    """Every page in every one of these shapes, poses and skews (radians).

    once: each shape once, while pages, poses, stagings, cuts and skews take turns.
    stagings: whole sheets on something, in turns; without any the page fills the photo, clean on black.
    pages: names of its own pages; without any those that the run is asked for.
    cuts: what is cut away from the photos, in turns.
    is_spread: the shapes are opened books; a case is one of two pages, left and right in turns.
    """

    name: str
    shapes: tuple[Shape, ...]
    views: tuple[View, ...] = POSES
    skews_rad: tuple[float, ...] = SKEWS_RAD
    once: bool = False
    stagings: tuple[Staging, ...] = ()
    pages: tuple[str, ...] = ()
    cuts: tuple[Cut, ...] = ()
    is_spread: bool = False

    def file_name(self, *, degraded: bool) -> str:
        """What its figures are filed under."""
        return f"rectify_{self.name}" + ("_degraded" if degraded else "")

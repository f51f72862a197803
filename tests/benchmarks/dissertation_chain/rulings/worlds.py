"""Curved pages without a photo: exact flows at any point, and text that fills the page."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from benchmarks.dissertation_chain.rulings.convergence import Directions
from services.arrays import Floats, Points, Vector
from services.texture_flow.field import FlowField
from simulation.cone import Cone
from simulation.pages import own_pages
from simulation.scenes import BOOK, POSES, WAVE
from simulation.surfaces import Shape
from simulation.truth import Truth

SHAPES: dict[str, Shape] = {
    "book": BOOK,
    "wave": WAVE,
    "cone": Cone((0.4, -4.0), 0.55),
    "hollow cone": Cone((-1.0, 5.0), 0.45, -1),
}


@dataclass(frozen=True, eq=False)
class World:
    """A page of a `shape` at a pose and skew, in centred unit coordinates of its photo."""

    shape: str
    pose: int = 0
    skew_deg: float = 0.0

    @cached_property
    def truth(self) -> Truth:
        page, view, shape = own_pages(200, 312)[0], POSES[self.pose], SHAPES[self.shape]
        camera = view.camera(525, 675)
        return Truth(page, shape, float(np.radians(self.skew_deg)), view.pose(page, shape, camera), camera)

    @property
    def unit_px(self) -> float:
        return float(np.hypot(525, 675)) / 2

    @property
    def focal(self) -> float:
        return self.truth.focal_length_px / self.unit_px

    def to_px(self, points: Points) -> Points:
        return np.asarray(points * self.unit_px + self.truth.camera.principal_point)

    def to_unit(self, points_px: Points) -> Points:
        return np.asarray((points_px - self.truth.camera.principal_point) / self.unit_px)

    @cached_property
    def text(self) -> Points:
        """Characters (600, 2), all over the page but for its margin."""
        sheet = np.random.default_rng(0).uniform(-0.8, 0.8, (600, 2)) * [1.0, 1.5]
        return self.to_unit(self.truth.sheet_to_photo(sheet))

    @cached_property
    def major(self) -> Directions:
        return self._dense(self.truth.major_flow)

    @cached_property
    def minor(self) -> Directions:
        return self._dense(self.truth.minor_flow)

    def _dense(self, exact: Directions) -> Directions:
        """The exact flow, tabulated finely over the photo: a hundred times as fast."""
        x, y = np.arange(-60.0, 586.0, 5.0), np.arange(-60.0, 736.0, 5.0)
        angles = np.nan_to_num(exact(np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)))
        doubled = np.stack([np.cos(2 * angles), np.sin(2 * angles)], axis=-1)
        field = FlowField(doubled.reshape(len(y), len(x), 2), (-60.0, -60.0), 5.0)
        return lambda points: field.at(self.to_px(points))

    def rulings(self, points: Points) -> Vector:
        return self.truth.rulings(self.to_px(points))

    def rulings_3d(self, points: Points) -> Floats:
        return self.truth.rulings_3d(self.to_px(points))


def noisy(directions: Directions, deviation_deg: float, seed: int) -> Directions:
    """`directions` with smooth errors of `deviation_deg`, as dense fields have them."""
    rng = np.random.default_rng(seed)
    waves = rng.normal(0.0, 6.0, (12, 2))
    phases = rng.uniform(0.0, 2 * np.pi, 12)

    def at(points: Points) -> Vector:
        error = np.cos(points @ waves.T + phases).sum(axis=1) * np.sqrt(2 / 12)
        return np.asarray(directions(points) + np.radians(deviation_deg) * error)

    return at

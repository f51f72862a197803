"""Small scenes that the tests of the simulator share."""

import numpy as np

from simulation.camera import Camera, Pose
from simulation.cone import Cone
from simulation.flat_page import Page, PageWord
from simulation.folded import Crease, Folded
from simulation.surfaces import Cylinder, Plane, Shape
from simulation.truth import Truth

SHAPES: dict[str, Shape] = {
    "plane": Plane(),
    "cylinder": Cylinder((0.05, 0.1, -0.4, -0.1, 0.2)),
    "hump": Cone((0.4, -4.0), float(np.radians(25.0)), 1),
    "hollow": Cone((-3.5, 1.0), float(np.radians(35.0)), -1),
    "folded": Folded((Crease(-0.4, 0.3, 0.2), Crease(0.45, -0.4, 0.15)), 1.5, 0.05, (0.1, 0.0, -0.1)),
}
CAMERA = Camera(520.0, 420, 540)
POSE = Pose(0.45, 1.1, -0.15, (0.1, 0.05, 3.4))


def blank_page(width: int = 320, height: int = 440) -> Page:
    """White paper with one word in its middle and one at its corner."""
    middle = PageWord("middle", (width / 2 - 30, height / 2 - 8, width / 2 + 30, height / 2 + 8))
    corner = PageWord("corner", (2.0, 2.0, 40.0, 14.0))
    return Page(np.full((height, width), 255, np.uint8), ((corner,), (middle,)))


def truth_of(shape: Shape, skew_rad: float = 0.2) -> Truth:
    """The truth of `shape` in the tests' common pose."""
    return Truth(blank_page(), shape, skew_rad, POSE, CAMERA)


def page_grid(count: int = 9) -> np.ndarray:
    """Page points spread over the middle 80 % of `blank_page`, (count^2, 2)."""
    x = np.linspace(0.1, 0.9, count) * 319
    y = np.linspace(0.1, 0.9, count) * 439
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)

"""The poses, shapes and skews of the dissertation's experiments (2.4, 3.4.2), as far as the text tells them.

Its numbers are not printed; these are chosen after its figures and remarks: four poses that lean in
different directions by 20 to 35 degrees, poses 1 and 2 such that at -15 degrees of skew the text lines come
out almost parallel in the photo (there the focal length can hardly be seen).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from simulation.camera import Camera, Pose
from simulation.cone import Cone
from simulation.degradation import Degradation, degrade, desk_texture
from simulation.flat_page import Page, Points
from simulation.photo import SimulatedPhoto, simulate_photo
from simulation.surfaces import Cylinder, Plane, Shape
from simulation.truth import Truth

PHOTO_SIZE = (2100, 2700)
"""Width and height of the experiments' photos, px."""
PAGE_SIZE = (1600, 2500)
"""Width and height of the experiments' pages, px (2.4)."""
SKEWS_RAD = (0.0, float(np.radians(15.0)), float(np.radians(-15.0)))


@dataclass(frozen=True, slots=True)
class View:
    """A focal length (px, for `PHOTO_SIZE`) and the three angles (degrees) of a pose."""

    name: str
    focal_length_px: float
    tilt_deg: float
    azimuth_deg: float
    roll_deg: float

    def camera(self, width: int = PHOTO_SIZE[0], height: int = PHOTO_SIZE[1]) -> Camera:
        """The view's camera; for another size, with the same field of view."""
        diagonal = float(np.hypot(width - 1, height - 1) / np.hypot(PHOTO_SIZE[0] - 1, PHOTO_SIZE[1] - 1))
        return Camera(self.focal_length_px * diagonal, width, height)

    def pose(self, page: Page, shape: Shape, camera: Camera, margin: float = 0.02) -> Pose:
        """The pose at which the page just fits into the photo, less `margin` of its size on each side."""
        return fitting_pose(
            self, lambda pose: Truth(page, shape, 0.0, pose, camera).outline(), camera, margin
        )


def fitting_pose(view: View, outline: Callable[[Pose], Points], camera: Camera, margin: float = 0.02) -> Pose:
    """The pose of `view` at which the photo points of `outline` just fit into the photo, less `margin` on each side."""
    angles = np.radians([view.tilt_deg, view.azimuth_deg, view.roll_deg])
    at = np.array([0.0, 0.0, 4.0 * camera.focal_length_px / min(camera.width, camera.height)])
    room = np.array([camera.width, camera.height]) * (1.0 - 2.0 * margin)
    for _ in range(60):
        centre = (float(at[0]), float(at[1]), float(at[2]))
        pose = Pose(float(angles[0]), float(angles[1]), float(angles[2]), centre)
        points = outline(pose)
        low, high = np.nanmin(points, axis=0), np.nanmax(points, axis=0)
        growth = float(np.min(room / (high - low)))
        middle = (low + high) / 2 - camera.principal_point
        at[:2] -= middle * at[2] / camera.focal_length_px
        at[2] /= growth**0.7
    return pose


POSES = (
    View("1", 2300.0, 25.0, 72.0, -4.0),
    View("2", 2700.0, 30.0, 257.0, 6.0),
    View("3", 2100.0, 22.0, 150.0, 3.0),
    View("4", 2500.0, 32.0, 25.0, -14.0),
)
"""The four poses of the 60 photos (Figure 2.5 b)."""

TILT_SERIES = tuple(View(str(i + 1), 2500.0, 10.0 + 8.0 * i, 60.0, 3.0) for i in range(7))
"""Seven poses with increasing tilt, 10 to 58 degrees (Figure 3.19)."""

BOOK = Cylinder((0.0, 0.12, -0.55, -0.10, 0.33))
"""A book page that rises out of its gutter (Figure 2.5 d, shape 1)."""
WAVE = Cylinder((0.0, 0.34, 0.0, -0.42))
"""A sheet with a hollow and a hump (shape 2)."""
CURVED_SHAPES = (BOOK, WAVE)

CURVATURE_SERIES = tuple(Cylinder((0.0, 0.0, 0.06 * (i + 1), 0.0, 0.01 * (i + 1))) for i in range(7))
"""Seven shapes alike, each more curved than the last (Figure 3.18); they bulge towards the viewer."""

CONE = Cone((0.8, -4.0), float(np.radians(40.0)))
"""A sheet whose rulings meet above its head and to the right: the head is bent by 47 degrees from side to
side, the foot by 24. The dissertation photographed cylinders only."""

PLANE = Plane()


def photograph(
    page: Page,
    view: View,
    skew_rad: float,
    shape: Shape = PLANE,
    *,
    dirt: Degradation | None = None,
    rng: np.random.Generator | None = None,
    size: tuple[int, int] = PHOTO_SIZE,
) -> SimulatedPhoto:
    """A photo of an experiment: clean on black, or with `dirt` on a desk (both drawn from `rng`).

    Raises
    ------
    ValueError
        When there is dirt but no generator, or the shape hides itself in this view.
    """
    camera = view.camera(*size)
    pose = view.pose(page, shape, camera)
    if dirt is None:
        return simulate_photo(page, shape, skew_rad, pose, camera)
    if rng is None:
        raise ValueError("dirt needs a seeded generator")
    desk = desk_texture(camera.width, camera.height, rng)
    photo = simulate_photo(page, shape, skew_rad, pose, camera, background=desk)
    return SimulatedPhoto(degrade(photo.image, dirt, rng), photo.truth)

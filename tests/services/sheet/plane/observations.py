"""What a camera sees of a printed plane, without any pixels: flows, line ends, paragraphs, margins."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from services.arrays import Floats, Homography, Points
from services.geometry.photo_frame import PhotoFrame
from services.geometry.planar import PagePlane
from services.sheet.plane.flat_lines import FlatObservations, RefinementParameters, observe_lines
from services.sheet.tracing.baselines import Baselines
from services.texture_flow.field import FlowSamples
from simulation.camera import Camera
from simulation.flat_page import Page
from simulation.scenes import View
from simulation.surfaces import Plane
from simulation.truth import Truth

SLANT_RAD = float(np.radians(0.2))
"""How far the type leans; about what is expected of roman type."""


@dataclass(frozen=True, slots=True, eq=False)
class PrintedPlane:
    """A page of level lines, 800 x 1250 px, photographed in `view`."""

    truth: Truth

    @property
    def frame(self) -> PhotoFrame:
        """The photo's size."""
        return PhotoFrame(self.truth.camera.width, self.truth.camera.height)

    @property
    def focal(self) -> float:
        """Focal length over half the diagonal."""
        return self.truth.focal_length_px / self.frame.unit_px

    @property
    def rotation(self) -> Floats:
        """Columns: where lines, strokes and the normal point to in the camera frame."""
        centre = self.truth.sheet_to_photo(np.zeros((1, 2)))
        axes = [
            f(centre)[0] for f in (self.truth.major_flow_3d, self.truth.minor_flow_3d, self.truth.normals)
        ]
        return np.stack(axes, axis=1)

    @property
    def H_centred_page(self) -> Homography:
        """From the page's pixels to centred photo coordinates."""
        return np.asarray(np.linalg.inv(self.frame.H_photo_centred) @ self.truth.H_photo_page())

    def flow(
        self, lean_rad: float, noise_rad: float, rng: np.random.Generator, columns: int = 12, rows: int = 18
    ) -> FlowSamples:
        """Centred samples of the direction that leans by `lean_rad` from the page's x axis, seen at a grid."""
        x, y = np.linspace(80, 720, columns), np.linspace(100, 1150, rows)
        page = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        step = 0.01 * np.array([np.cos(lean_rad), np.sin(lean_rad)])
        way = self.truth.page_to_photo(page + step) - self.truth.page_to_photo(page - step)
        angles = np.arctan2(way[:, 1], way[:, 0]) + rng.normal(0, noise_rad, len(page))
        seen = FlowSamples(self.truth.page_to_photo(page), angles, np.full(len(page), 1.0))
        return seen.centred(self.frame)

    def lines(self, noise_px: float, rng: np.random.Generator) -> FlatObservations:
        """36 justified lines in two paragraphs of one leading, their ends known to `noise_px`."""
        y = np.concatenate([100 + 29.0 * np.arange(20), 100 + 29.0 * np.arange(21, 37)])
        starts = np.stack([np.full(36, 65.0), y], axis=1) + rng.normal(0, noise_px, (36, 2))
        ends = np.stack([np.full(36, 735.0), y], axis=1) + rng.normal(0, noise_px, (36, 2))
        ends[[19, 35], 0] -= 300.0  # the paragraphs' last lines are short
        lines = Baselines(starts, ends, np.full(36, 12.0), np.full(36, max(noise_px, 0.1)))
        return observe_lines(lines, self.H_centred_page, RefinementParameters())

    def wrong(self, turn_deg: Points, focal_factor: float) -> PagePlane:
        """The true plane turned by an axis-angle vector (3,) and with another focal length."""
        turn = Rotation.from_rotvec(turn_deg, degrees=True).as_matrix()
        return PagePlane(self.rotation @ turn, self.focal * focal_factor)

    def error_deg(self, plane: PagePlane) -> float:
        """Angle of the turn from the true pose to that of `plane`."""
        return float(np.degrees(Rotation.from_matrix(self.rotation.T @ plane.rotation).magnitude()))


def photograph_plane(
    view: View, skew_rad: float = 0.0, width: int = 1050, height: int = 1350
) -> PrintedPlane:
    """The printed plane in a view that holds it whole."""
    page, camera = Page(np.full((1250, 800), 255, np.uint8)), view.camera(width, height)
    pose = view.pose(page, Plane(), camera)
    return PrintedPlane(Truth(page, Plane(), skew_rad, pose, Camera(camera.focal_length_px, width, height)))

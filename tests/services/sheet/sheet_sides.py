"""A sheet's outline as the simulator's truth or an analytic camera shows it, with noise."""

import numpy as np

from services.arrays import Floats, Points
from services.geometry.camera import plane_to_image, rotation_from_vector
from services.geometry.homographies import transform_points
from services.geometry.photo_frame import PhotoFrame
from services.sheet.outline.results import SheetOutline, SheetSide
from simulation.truth import Truth

FRAME = PhotoFrame(1500, 2000)
ALL = (0, 1, 2, 3)


def outline_of(
    corners: Points, noise_px: float, rng: np.random.Generator, seen: tuple[int, ...] = ALL, points: int = 60
) -> SheetOutline:
    """Straight sides between `corners` (4, 2) photo pixels; sides that are not `seen` have no points."""
    top_left = int(np.argmin(corners.sum(axis=1)))
    corners = np.roll(corners, -top_left, axis=0)
    places = np.linspace(0.02, 0.98, points)[:, None]
    sides = []
    for k in ALL:
        a, b = corners[k], corners[(k + 1) % 4]
        along = a + places * (b - a) + rng.normal(0, noise_px, (points, 2)) if k in seen else np.zeros((0, 2))
        deviations = np.full(len(along), max(noise_px, 1e-7))
        sides.append(SheetSide(along, deviations, float(k in seen), noise_px))
    return SheetOutline(corners, (sides[0], sides[1], sides[2], sides[3]), 0.95, corners)


def outline_of_truth(truth: Truth, noise_px: float, rng: np.random.Generator) -> SheetOutline:
    """The simulated sheet's; its sides are straight where the sheet is flat."""
    x, y = 1.0, truth.page.half_height_units
    return outline_of(truth.sheet_to_photo(np.array([[-x, -y], [x, -y], [x, y], [-x, y]])), noise_px, rng)


def seen_rectangle(aspect: float, rotation: Floats, focal: float, at: tuple[float, float] = (0, 0)) -> Points:
    """Corners (4, 2) in the photo `FRAME` of a rectangle that an analytic camera sees."""
    rectangle = 0.3 * np.array([[-aspect, -1], [aspect, -1], [aspect, 1], [-aspect, 1]]) + np.array(at)
    return transform_points(FRAME.H_photo_centred @ plane_to_image(rotation, focal), rectangle)


def leaning(tilt_deg: float, azimuth_deg: float, roll_deg: float) -> Floats:
    """A page's rotation (3, 3): tilted about an axis in its plane, then rolled."""
    tilt, azimuth, roll = np.radians([tilt_deg, azimuth_deg, roll_deg])
    tilted = rotation_from_vector(tilt * np.array([np.cos(azimuth), np.sin(azimuth), 0.0]))
    return np.asarray(rotation_from_vector(np.array([0.0, 0.0, roll])) @ tilted)


def bent_outline_of_truth(
    truth: Truth, noise_px: float, rng: np.random.Generator, points: int = 60
) -> SheetOutline:
    """The simulated sheet's, whose sides follow its edges."""
    x, y = 1.0, truth.page.half_height_units
    sheet = np.array([[-x, -y], [x, -y], [x, y], [-x, y]])
    corners = truth.sheet_to_photo(sheet)
    first = int(np.argmin(corners.sum(axis=1)))
    sheet, corners = np.roll(sheet, -first, axis=0), np.roll(corners, -first, axis=0)
    places = np.linspace(0.01, 0.99, points)[:, None]
    sides = []
    for k in ALL:
        edge = truth.sheet_to_photo(sheet[k] + places * (sheet[(k + 1) % 4] - sheet[k]))
        edge = edge + rng.normal(0, noise_px, edge.shape)
        straightness = float(
            np.linalg.svd(edge - edge.mean(axis=0), compute_uv=False)[1] / np.sqrt(len(edge))
        )
        sides.append(SheetSide(edge, np.full(points, max(noise_px, 1e-7)), 1.0, straightness))
    polygon = np.concatenate(
        [np.vstack([corner, side.points]) for corner, side in zip(corners, sides, strict=True)]
    )
    return SheetOutline(corners, (sides[0], sides[1], sides[2], sides[3]), 0.95, polygon)

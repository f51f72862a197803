"""Errors of what was estimated, against the simulator's truth."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from services.sheet.surfaces import MeshSurface, PlaneSurface, StripsSurface
from simulation.camera import half_field_of_view
from simulation.flat_page import Points
from simulation.truth import Truth

_FEWEST_NODES = 12
_RULING_STEPS = 400
"""Points along each ruling, over twice the photo's diagonal; those in the text count."""


@dataclass(frozen=True, slots=True)
class RulingErrors:
    """Mean direction errors of the rulings (3.4.1), degrees: in the photo (2D) and in space (3D)."""

    photo_deg: float
    space_deg: float


def fit_similarity(source: Points, target: Points) -> tuple[complex, complex]:
    """Scale-and-turn `a` and shift `b` (as complex numbers) that minimise sum |a z + b - w|^2.

    Rotation, scale and translation, no mirroring. Points are (N, 2), N >= 2.
    """
    z, w = source @ np.array([1, 1j]), target @ np.array([1, 1j])
    zc, wc = z - z.mean(), w - w.mean()
    a = complex((np.conj(zc) @ wc) / np.sum(np.abs(zc) ** 2))
    return a, complex(w.mean() - a * z.mean())


def similarity_residual(source: Points, target: Points) -> float:
    """RMS distance, in the target's unit, that the best similarity leaves."""
    a, b = fit_similarity(source, target)
    left = a * (source @ np.array([1, 1j])) + b - target @ np.array([1, 1j])
    return float(np.sqrt(np.mean(np.abs(left) ** 2)))


def mesh_on_page(mesh: NDArray[np.float64], width: int, height: int, truth: Truth) -> tuple[Points, Points]:
    """Points of the output image (width x height) that show the page, and the page points they should be.

    `mesh` (rows, columns, 2) holds photo points, as in `RectifyResult`. Where few of its nodes are on the
    page, it is first interpolated to a finer one.
    """
    for _ in range(5):
        rows, columns = mesh.shape[:2]
        grid = np.stack(
            np.meshgrid(np.linspace(0, width - 1, columns), np.linspace(0, height - 1, rows)), axis=-1
        )
        photo = mesh.reshape(-1, 2)
        kept = truth.on_page(photo)
        kept &= np.all((photo >= 0) & (photo <= [truth.camera.width - 1, truth.camera.height - 1]), axis=1)
        if kept.sum() >= _FEWEST_NODES:
            break
        mesh = _halved(mesh)
    return grid.reshape(-1, 2)[kept], truth.photo_to_page(photo[kept])


def mesh_residual_percent(mesh: NDArray[np.float64], width: int, height: int, truth: Truth) -> float:
    """RMS residual of the mesh after the best similarity, percent of the page's width; NaN off the page."""
    output, page = mesh_on_page(mesh, width, height, truth)
    if len(output) < 3:
        return float("nan")
    return 100.0 * similarity_residual(output, page) / truth.page.width


def is_upright(mesh: NDArray[np.float64], width: int, height: int, truth: Truth) -> bool:
    """Whether the output shows the page within 45 degrees of upright, and not mirrored."""
    output, page = mesh_on_page(mesh, width, height, truth)
    if len(output) < 3:
        return False
    mirrored = output * np.array([-1.0, 1.0])
    turn, _ = fit_similarity(output, page)
    straight = similarity_residual(output, page) <= similarity_residual(mirrored, page)
    return straight and abs(float(np.angle(turn))) < np.pi / 4


def field_of_view_error_deg(focal_length_px: float, truth: Truth) -> float:
    """Error of the half field of view: optical axis to image corner (3.4.1)."""
    camera = truth.camera
    estimated = half_field_of_view(focal_length_px, camera.width, camera.height)
    return abs(float(np.degrees(estimated - camera.half_field_of_view_rad)))


def normal_error_deg(normals: NDArray[np.float64], truth: Truth, points: Points) -> float:
    """Mean angle between normals (N, 3), of either sign and any length, and the true ones at photo points."""
    if not len(points):
        return float("nan")
    return float(np.degrees(_angles_between(normals, truth.normals(points)).mean()))


def normals_at(
    surface: PlaneSurface | StripsSurface | MeshSurface, points: Points
) -> NDArray[np.float64] | None:
    """The estimated normal (N, 3) at photo points (N, 2); None where the shape is not known."""
    if isinstance(surface, StripsSurface):
        return surface.normals[strip_of(surface, points)]
    if isinstance(surface, MeshSurface):
        p = surface.points
        centres = 0.25 * (p[1:, 1:] + p[1:, :-1] + p[:-1, 1:] + p[:-1, :-1])
        _, nearest = cKDTree(centres.reshape(-1, 2)).query(points)
        return surface.normals.reshape(-1, 3)[nearest]
    if surface.normal is None:
        return None
    return np.broadcast_to(np.array(surface.normal), (len(points), 3))


def strip_of(surface: StripsSurface, points: Points) -> NDArray[np.intp]:
    """Which strip (N,) each photo point lies in: the number of rulings passed, the first not counted.

    What lies before the first ruling or beyond the last belongs to the outermost strips.
    """
    across = np.column_stack([-np.sin(surface.angles_rad), np.cos(surface.angles_rad)])
    # A ruling has no direction: its normal is turned to where the strips go on.
    across *= np.where(across @ (surface.points[-1] - surface.points[0]) < 0, -1.0, 1.0)[:, None]
    passed = points @ across.T > np.einsum("ij,ij->i", across, surface.points)
    return np.asarray(np.clip(passed.sum(axis=1) - 1, 0, len(surface.normals) - 1), np.intp)


def ruling_errors(
    points: Points,
    angles_rad: NDArray[np.float64],
    truth: Truth,
    vanishing_points: NDArray[np.float64] | None = None,
) -> RulingErrors:
    """Rulings through photo points (N, 2) against the true ones, wherever in the text they pass.

    In space the ray to a homogeneous vanishing point (N, 3), photo pixels, stands for its ruling, the optical
    centre being given by the true focal length (3.4.1); rulings with a NaN there are left out. NaN where no
    ruling passes the text, and in space without vanishing points.
    """
    places, which = _places_in_text(points, angles_rad, truth)
    if not len(places):
        return RulingErrors(float("nan"), float("nan"))
    photo_deg = direction_error_deg(angles_rad[which], truth.rulings(places))
    if vanishing_points is None:
        return RulingErrors(photo_deg, float("nan"))
    x, y, w = vanishing_points.T
    (cx, cy), f = truth.camera.principal_point, truth.camera.focal_length_px
    rays = np.column_stack([x - cx * w, y - cy * w, f * w])
    space = _angles_between(rays[which], truth.rulings_3d(places))
    space = space[np.isfinite(space)]
    return RulingErrors(photo_deg, float(np.degrees(space.mean())) if len(space) else float("nan"))


def _places_in_text(
    points: Points, angles_rad: NDArray[np.float64], truth: Truth
) -> tuple[Points, NDArray[np.intp]]:
    """Evenly spaced photo points (M, 2) of the rulings within the text area, and whose (M,) they are."""
    words = [word.box for line in truth.visible_lines() for word in line]
    if not words:
        return np.zeros((0, 2)), np.zeros(0, np.intp)
    boxes = np.array(words)
    size = np.array([truth.camera.width, truth.camera.height])
    reach = float(np.hypot(*size)) * np.linspace(-1, 1, _RULING_STEPS)
    along = np.column_stack([np.cos(angles_rad), np.sin(angles_rad)])
    places = (points[:, None] + reach[:, None] * along[:, None]).reshape(-1, 2)
    which = np.repeat(np.arange(len(along)), _RULING_STEPS)
    seen = np.all((places >= 0) & (places <= size - 1), axis=1)
    places, which = places[seen], which[seen]
    page = truth.photo_to_page(places)
    inside = np.all((page >= boxes[:, :2].min(axis=0)) & (page <= boxes[:, 2:].max(axis=0)), axis=1)
    return places[inside], which[inside]


def _angles_between(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Angle (N,) in 0..pi/2 between 3D directions of either sign."""
    sine = np.linalg.norm(np.cross(a, b), axis=1)
    return np.asarray(np.arctan2(sine, np.abs(np.einsum("ij,ij->i", a, b))))


def direction_error_deg(measured: NDArray[np.floating], expected: NDArray[np.floating]) -> float:
    """Mean absolute difference of directions modulo pi."""
    difference = np.abs((measured - expected + np.pi / 2) % np.pi - np.pi / 2)
    return float(np.degrees(difference.mean()))


def _halved(mesh: NDArray[np.float64]) -> NDArray[np.float64]:
    """The mesh with a node in the middle of every gap (bilinear)."""
    rows = np.empty((2 * mesh.shape[0] - 1, mesh.shape[1], 2))
    rows[::2], rows[1::2] = mesh, (mesh[1:] + mesh[:-1]) / 2
    fine = np.empty((rows.shape[0], 2 * rows.shape[1] - 1, 2))
    fine[:, ::2], fine[:, 1::2] = rows, (rows[:, 1:] + rows[:, :-1]) / 2
    return fine

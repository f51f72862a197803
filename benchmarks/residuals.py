"""Errors of what was estimated, against the simulator's truth."""

import numpy as np
from numpy.typing import NDArray

from simulation.camera import half_field_of_view
from simulation.flat_page import Points
from simulation.truth import Truth

_FEWEST_NODES = 12


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


def normal_error_deg(normal: tuple[float, float, float], truth: Truth) -> float:
    """Angle between the estimated normal (of either sign) and a planar page's."""
    centre = truth.sheet_to_photo(np.zeros((1, 2)))
    expected = truth.normals(centre)[0]
    cosine = abs(float(np.dot(normal, expected))) / float(np.linalg.norm(normal))
    return float(np.degrees(np.arccos(min(cosine, 1.0))))


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

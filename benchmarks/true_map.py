"""The photo flattened by the simulator's own map: what its resolution and light allow at best."""

import cv2
import numpy as np

from benchmarks.residuals import fit_similarity, mesh_on_page
from services.arrays import RgbImage
from services.rectify.results import RectifyResult
from simulation.flat_page import Points
from simulation.truth import Truth

_WHITE = (255, 255, 255)


def flatten_by_truth(photo: RgbImage, truth: Truth) -> RgbImage:
    """The page's own frame and pixels, nothing beside it."""
    return _resample(photo, truth, _grid(truth.page.width, truth.page.height), truth.page.width)


def flatten_in_frame(photo: RgbImage, truth: Truth, result: RectifyResult) -> RgbImage | None:
    """The same, in the frame and scale that `result` shows: as much desk, as many pixels, the true shape.

    What reads worse in `result` than in this picture is owed to its geometry alone. None where `result` does
    not show the page.
    """
    height, width = result.image.shape[:2]
    output, page = mesh_on_page(result.mesh, width, height, truth)
    if len(output) < 3:
        return None
    turn, shift = fit_similarity(output, page)
    placed = turn * (_grid(width, height) @ np.array([1, 1j])) + shift
    return _resample(photo, truth, np.column_stack([placed.real, placed.imag]), width)


def _grid(width: int, height: int) -> Points:
    x, y = np.meshgrid(np.arange(width, dtype=float), np.arange(height, dtype=float))
    return np.column_stack([x.ravel(), y.ravel()])


def _resample(photo: RgbImage, truth: Truth, page: Points, width: int) -> RgbImage:
    """The photo at page points (N, 2), as an image `width` across; white where it shows nothing."""
    where = np.nan_to_num(truth.page_to_photo(page), nan=-1e4).astype(np.float32).reshape(-1, width, 2)
    flat = cv2.remap(
        photo,
        where[..., 0],
        where[..., 1],
        cv2.INTER_CUBIC,
        borderMode=cv2.BORDER_CONSTANT,
        borderValue=_WHITE,
    )
    return np.asarray(flat, np.uint8)

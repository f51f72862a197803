"""The photo flattened by the simulator's own map: what its resolution and light allow at best."""

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.common.residuals import fit_similarity, mesh_on_page
from services.arrays import RgbImage
from services.rectify.results import RectifyResult
from simulation.flat_page import Points
from simulation.truth import Lattice, Truth

_WHITE = (255, 255, 255)


def flatten_by_truth(photo: RgbImage, truth: Truth) -> RgbImage:
    """The page's own frame and pixels, nothing beside it."""
    return _resample(photo, truth, (truth.page.width, truth.page.height))


def flatten_in_frame(photo: RgbImage, truth: Truth, result: RectifyResult) -> RgbImage | None:
    """The same, in the frame and scale that `result` shows: as much desk, as many pixels, the true shape.

    What reads worse in `result` than in this picture is owed to its geometry alone. None where `result` does
    not show the page.
    """
    height, width = result.image.shape[:2]
    return flatten_onto(photo, truth, (width, height), *mesh_on_page(result.mesh, width, height, truth))


def flatten_onto(
    photo: RgbImage, truth: Truth, size: tuple[int, int], output: Points, page: Points
) -> RgbImage | None:
    """The photo as an image of (width, height) pixels that shows `page`, page pixels (N, 2), at `output` (N, 2).

    As near as a similarity comes to it. None for fewer than 3 points.
    """
    if len(output) < 3:
        return None
    return _resample(photo, truth, size, *fit_similarity(output, page))


def _resample(
    photo: RgbImage, truth: Truth, size: tuple[int, int], turn: complex = 1.0, shift: complex = 0.0
) -> RgbImage:
    """The photo as an image of (width, height); its pixels z, as complex numbers, show page points turn z + shift.

    White where the photo shows nothing. The map is exact at every 8th pixel and interpolated between.
    """
    width, height = size
    x, y = _nodes(width), _nodes(height)
    page = turn * (x + 1j * y[:, None]).ravel() + shift
    exact = truth.page_to_photo(np.column_stack([page.real, page.imag])).reshape(len(y), len(x), 2)
    where = np.nan_to_num(Lattice(exact, width).upsampled(0, height), nan=-1e4)
    flat = cv2.remap(
        photo,
        where[..., 0],
        where[..., 1],
        cv2.INTER_CUBIC,
        borderMode=cv2.BORDER_CONSTANT,
        borderValue=_WHITE,
    )
    return np.asarray(flat, np.uint8)


def _nodes(length: int) -> NDArray[np.float64]:
    """Where a `Lattice` has its values: two beyond each border."""
    return np.asarray((np.arange(-2, -(-length // 8) + 2) + 0.5) * 8.0 - 0.5, np.float64)

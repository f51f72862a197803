"""How a view keeps to its sheet: where it is cut, how large it is, whether its print keeps its pixels and its shape."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.common.residuals import fit_similarity, mesh_on_page
from simulation.flat_page import Points
from simulation.truth import Truth

NAN = float("nan")
FARTHEST_CUT_PERCENT = 25.0
"""What a side counts as where it shows so much beside the sheet that the truth does not tell how much."""


@dataclass(frozen=True, slots=True)
class SheetErrors:
    """Of one view; NaN where nothing is known, percent of the page's width unless said otherwise.

    mesh_median_percent, mesh_p95_percent: of the mesh's nodes on the page, after the best similarity.
    cut_percent: the side of the view that is worst, on average from the sheet's own side, negative where ground
        is shown and positive where paper is lost; NaN where the sheet is not whole in the photo.
    cut_worst_percent: the same at the worst twentieth of any side, without sign.
    area_ratio: view over page, both in page pixels.
    density: pixels of the view per pixel of the photo, along a line, where the page is: less than 1 loses detail.
    aspect_percent: by how much the print is too wide (positive) or too high.
    """

    mesh_median_percent: float = NAN
    mesh_p95_percent: float = NAN
    cut_percent: float = NAN
    cut_worst_percent: float = NAN
    area_ratio: float = NAN
    density: float = NAN
    aspect_percent: float = NAN


def measure_sheet(mesh: NDArray[np.float64], width: int, height: int, truth: Truth) -> SheetErrors:
    """Errors of a view of width x height pixels; `mesh` (rows, columns, 2) as in `RectifyResult`."""
    output, page = mesh_on_page(mesh, width, height, truth)
    if len(output) < 3:
        return SheetErrors()
    turn, shift = fit_similarity(output, page)
    ones = np.array([1, 1j])
    left = 100.0 * np.abs(turn * (output @ ones) + shift - page @ ones) / truth.page.width
    cut, worst = cut_errors(mesh, width, height, truth)
    return SheetErrors(
        float(np.median(left)),
        float(np.percentile(left, 95)),
        cut,
        worst,
        width * height * abs(turn) ** 2 / (truth.page.width * truth.page.height),
        print_density(mesh, width, height, truth),
        aspect_error_percent(output, page),
    )


def cut_errors(mesh: NDArray[np.float64], width: int, height: int, truth: Truth) -> tuple[float, float]:
    """`cut_percent` and `cut_worst_percent` of a view, whichever way up it shows the page."""
    outline = truth.outline()
    limit = np.array([truth.camera.width, truth.camera.height]) - 0.5
    if not np.all((outline > -0.5) & (outline < limit)):
        return NAN, NAN
    best = (-FARTHEST_CUT_PERCENT, FARTHEST_CUT_PERCENT)
    # Outermost nodes are centres of pixels, half a pixel within the view.
    half = _half_pixel(mesh, width, height, truth)
    for turn in range(4):
        sides = [_side_distances(mesh, side, turn, truth) - half for side in range(4)]
        means = np.array([float(side.mean()) for side in sides])
        worst = max(float(np.percentile(np.abs(side), 95)) for side in sides)
        if worst < best[1]:
            best = (float(means[np.argmax(np.abs(means))]), worst)
    return best


def _side_distances(mesh: NDArray[np.float64], side: int, turn: int, truth: Truth) -> NDArray[np.float64]:
    """How far (percent) the nodes of a view's side (top, right, bottom, left) lie within the sheet's side `turn` on."""
    nodes = (mesh[0], mesh[:, -1], mesh[-1], mesh[:, 0])[side]
    sheet = truth.photo_to_sheet(nodes)
    inside = truth.page.half_height_units
    within = (
        sheet[:, 1] + inside,
        1.0 - sheet[:, 0],
        inside - sheet[:, 1],
        sheet[:, 0] + 1.0,
    )[(side + turn) % 4]
    distances = np.where(np.isnan(within), -FARTHEST_CUT_PERCENT, 50.0 * within)
    return np.asarray(np.clip(distances, -FARTHEST_CUT_PERCENT, FARTHEST_CUT_PERCENT))


def _half_pixel(mesh: NDArray[np.float64], width: int, height: int, truth: Truth) -> float:
    """Half a pixel of the view, in percent of the page's width."""
    output, page = mesh_on_page(mesh, width, height, truth)
    return 50.0 * abs(fit_similarity(output, page)[0]) / truth.page.width if len(output) > 2 else 0.0


def print_density(mesh: NDArray[np.float64], width: int, height: int, truth: Truth) -> float:
    """View pixels per photo pixel along a line, the median over the cells of the mesh that show the page."""
    rows, columns = mesh.shape[:2]
    across = mesh[:-1, 1:] - mesh[:-1, :-1]
    down = mesh[1:, :-1] - mesh[:-1, :-1]
    photo_area = np.abs(across[..., 0] * down[..., 1] - across[..., 1] * down[..., 0])
    middle = (mesh[:-1, :-1] + mesh[1:, 1:]) / 2
    shown = truth.on_page(middle.reshape(-1, 2)).reshape(rows - 1, columns - 1) & (photo_area > 0)
    if not shown.any():
        return NAN
    view_area = (width - 1) / (columns - 1) * (height - 1) / (rows - 1)
    return float(np.sqrt(np.median(view_area / photo_area[shown])))


def aspect_error_percent(output: Points, page: Points) -> float:
    """By how much (percent) the view shows the page too wide: of the best affine map from page to view."""
    start = np.column_stack([page, np.ones(len(page))])
    linear = np.linalg.lstsq(start, output, rcond=None)[0][:2]
    wide, high = np.linalg.norm(linear, axis=1)
    return float(100.0 * (wide / high - 1.0))

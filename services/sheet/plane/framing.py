"""Which part of the flattened plane is shown, and at what resolution."""

from dataclasses import dataclass

import numpy as np

from services.arrays import Floats, Homography, Points
from services.geometry.homographies import jacobians, scaling, transform_points, translation
from services.geometry.page_frame import DETAIL_PERCENTILE, PAPER_MARGIN, TEXT_MARGIN, within_bounds

REACH = 1.0
"""How far, in sizes of the text, the view goes beyond the text when the paper's edge is not seen."""
SHEET_REACH = 8.0
"""The same when it is: a bound for what cannot be a sheet."""
VISIBLE_POINTS = 60
"""Points across and down the photo by which its visible part of the plane is bounded."""


@dataclass(frozen=True, slots=True, eq=False)
class FlatFrame:
    """View of a planar page: output pixel -> photo pixel is a homography."""

    H_photo_flat: Homography
    width: int
    height: int

    def to_photo(self, pixels: Points) -> Points:
        """See `Frame`."""
        return transform_points(self.H_photo_flat, pixels)

    def to_flat(self, photo: Points) -> Points:
        """See `Frame`."""
        return transform_points(np.linalg.inv(self.H_photo_flat), photo)

    def through(self, H_old_new: Homography, width: int, height: int) -> "FlatFrame":
        """See `Frame`."""
        return FlatFrame(self.H_photo_flat @ H_old_new, width, height)


def frame_page(
    H_photo_plane: Homography,
    photo_shape: tuple[int, int],
    text_points: Points,
    text_height_px: float,
    paper: Points | None,
    *,
    only_text: bool = False,
) -> FlatFrame:
    """View of the whole sheet, or, without an outline, of the part of the photo that is near the text.

    The photo has `photo_shape` (height, width) pixels. `text_points` (N, 2) are centres of characters, and `paper`
    (M, 2) is the sheet's outline if it was found, all in photo pixels. A view of `only_text` has
    its margins alone, and no outline.
    """
    H_plane_photo = np.linalg.inv(H_photo_plane)
    text = transform_points(H_plane_photo, text_points)
    scale = 1 / np.sqrt(
        np.abs(np.linalg.det(jacobians(H_plane_photo, text_points)))
    )  # photo px per plane unit
    resolution = float(np.percentile(scale, DETAIL_PERCENTILE))
    low, high = text.min(axis=0), text.max(axis=0)
    margin = TEXT_MARGIN * text_height_px / float(np.median(scale))
    low, high = low - margin, high + margin
    beyond = (0.0 if only_text else REACH if paper is None else SHEET_REACH) * float((high - low).max())
    visible_low, visible_high = _visible(H_plane_photo, photo_shape, low - beyond, high + beyond)
    if paper is None:
        low, high = np.minimum(low, visible_low), np.maximum(high, visible_high)
    else:
        sheet = _in_front(H_plane_photo, paper, text_points)
        rim = PAPER_MARGIN * float((high - low).max())
        low = np.maximum(np.minimum(low, sheet.min(axis=0) - rim), visible_low)
        high = np.minimum(np.maximum(high, sheet.max(axis=0) + rim), visible_high)
    extent = high - low
    resolution = within_bounds(resolution, (extent[0], extent[1]), photo_shape[0] * photo_shape[1])
    width, height = (max(round(v * resolution), 1) for v in extent)
    H_plane_flat = translation(float(low[0]), float(low[1])) @ scaling(1 / resolution) @ translation(0.5, 0.5)
    return FlatFrame(H_photo_plane @ H_plane_flat, width, height)


def _in_front(H: Homography, points: Points, reference: Points) -> Points:
    """`points` mapped by `H`, without those beyond the vanishing line as seen from `reference`."""
    w = points @ H[2, :2] + H[2, 2]
    side = np.sign(np.median(reference @ H[2, :2] + H[2, 2]))
    return transform_points(H, points[w * side > 1e-12])


def _visible(
    H_plane_photo: Homography,
    photo_shape: tuple[int, int],
    low: Floats,
    high: Floats,
) -> tuple[Floats, Floats]:
    """Bounds of the photo's part within the box `low`..`high` of the plane."""
    height, width = photo_shape
    grid = np.stack(
        np.meshgrid(np.linspace(0, width - 1, VISIBLE_POINTS), np.linspace(0, height - 1, VISIBLE_POINTS)),
        axis=-1,
    ).reshape(-1, 2)
    middle = transform_points(np.linalg.inv(H_plane_photo), 0.5 * (low + high)[None])
    seen = _in_front(H_plane_photo, grid, middle)
    inside = seen[((seen >= low) & (seen <= high)).all(axis=1)]
    if len(inside) == 0:
        return low, high
    return inside.min(axis=0), inside.max(axis=0)

"""Whether a joint sheet still shows the paper that each photo shows by itself."""

from collections.abc import Mapping

import cv2
import numpy as np

from services.arrays import Mask, Points
from services.geometry.page_frame import Frame
from services.mosaic.flat_photo import GRID, FlatPhoto

LEAST_KEPT = 0.9
"""Share of the paper in a photo's own view that its view of a joint sheet keeps: 1.0 of 26 photos of eight simulated
sets of bent sheets, 0.82 of a flat page that was laid on the bent sheet of a crop of it."""


def keeps_paper(views: Mapping[int, Frame], photos: Mapping[int, FlatPhoto]) -> bool:
    """Whether the `views` of a joint sheet keep the paper of all `photos` whose sheet is seen against the ground."""
    return all(_share_kept(photo, views[index]) >= LEAST_KEPT for index, photo in photos.items())


def _share_kept(photo: FlatPhoto, view: Frame) -> float:
    """Share (0-1) of the paper in the photo's own view that the other `view` of it shows; 1 where none is seen."""
    if photo.sheet is None:
        return 1.0
    height, width = photo.photo.shape[:2]
    x, y = np.meshgrid(np.linspace(0, width - 1, GRID), np.linspace(0, height - 1, GRID))
    points = np.column_stack([x.ravel(), y.ravel()])
    outline = photo.sheet.astype(np.float32).reshape(-1, 1, 2)
    on_paper = np.array([cv2.pointPolygonTest(outline, point, False) >= 0 for point in points.tolist()])
    points = points[on_paper]
    points = points[_within(photo.frame, points)]
    return float(_within(view, points).mean()) if len(points) else 1.0


def _within(frame: Frame, photo: Points) -> Mask:
    """Which photo pixels (N, 2) the view shows."""
    flat = frame.to_flat(photo)
    with np.errstate(invalid="ignore"):
        return np.asarray(((flat >= 0) & (flat <= (frame.width - 1, frame.height - 1))).all(axis=1))

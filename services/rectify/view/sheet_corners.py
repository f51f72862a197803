"""The corners of the sheet in the photo, in the order of the flat view."""

import numpy as np

from services.arrays import Floats, Points
from services.sheet.outline.results import SheetOutline


def corners_by_view(outline: SheetOutline | None, mesh: Floats, *, mirrored: bool) -> Points | None:
    """The sheet's corners (4, 2) in photo pixels, clockwise from the top left of the flat view.

    Parameters
    ----------
    outline
        The sheet's outline, if it was found.
    mesh
        (rows, columns, 2) photo points of the flat view, after it was turned upright.
    mirrored
        Whether the view is mirrored. Then its corners are counter-clockwise in the photo.

    Returns
    -------
    Points or None
        A row is NaN where the corner was not seen; None: there is no outline.
    """
    if outline is None:
        return None
    corners = outline.corners[::-1] if mirrored else outline.corners
    ends = mesh[[0, 0, -1, -1], [0, -1, -1, 0]]
    of_view = _directions(ends, ends.mean(axis=0))
    of_sheet = np.nan_to_num(_directions(corners, outline.polygon.mean(axis=0)))
    turns = [float((of_view * np.roll(of_sheet, turn, axis=0)).sum()) for turn in range(4)]
    return np.asarray(np.roll(corners, int(np.argmax(turns)), axis=0), np.float64)


def _directions(points: Points, middle: Points) -> Points:
    """Unit vectors (N, 2) from `middle` (2,) to `points` (N, 2)."""
    away = points - middle
    return np.asarray(away / np.maximum(np.linalg.norm(away, axis=1, keepdims=True), 1e-9))

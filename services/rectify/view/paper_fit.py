"""A view whose sheet has the proportions that the request names.

An app that crops pages, or a pose that does not show the focal length, leaves a sheet squeezed. Where its four sides
bound the view and its size is given, the view is stretched along one axis to have the size's proportions.
"""

import numpy as np

from services.arrays import Points
from services.documents.paper_size import oriented_size
from services.geometry.page_frame import AnyFrame, Frame
from services.rectify.shape_choice.shaped_page import ShapedPage

MOST_STRETCH = 1.3
"""A sheet that is off by more is another one than the request names: in one-point perspective an assumed focal length
leaves up to 16 %, apps that crop leave up to 10 %."""
NEAR = 0.05
"""Distance of the sheet's corners from those of the view, as a share of its shorter side, up to which they bound it."""


def fit_to_paper(frame: AnyFrame, page: ShapedPage, paper: str) -> tuple[AnyFrame, float | None]:
    """The view stretched so that its sheet has the proportions of `paper`, and the factor of its width over its height.

    The factor is None, and the view as it was, where the request names no size, where the sheet's sides do not bound
    the view, or where they are those of another sheet.
    """
    corners = _corners_in_photo(page)
    seen = None if corners is None else _corners_in_view(frame, corners)
    if seen is None:
        return frame, None
    top, right, bottom, left = np.linalg.norm(np.roll(seen, -1, axis=0) - seen, axis=1)
    aspect = float((top + bottom) / (left + right))
    size = oriented_size(paper, aspect)
    if size is None:
        return frame, None
    stretch = size[0] / size[1] / aspect
    if not 1 / MOST_STRETCH < stretch < MOST_STRETCH:
        return frame, None
    # The shorter axis is enlarged, so that no detail is lost.
    width, height = round(frame.width * max(stretch, 1.0)), round(frame.height * max(1 / stretch, 1.0))
    across, down = frame.width / width, frame.height / height
    H_old_new = np.array([[across, 0, 0.5 * across - 0.5], [0, down, 0.5 * down - 0.5], [0, 0, 1]])
    return frame.through(H_old_new, width, height), stretch


def _corners_in_photo(page: ShapedPage) -> Points | None:
    """Corners (4, 2) of the sheet in photo pixels, in order round it: the photo's, where the photo is the page."""
    if "photo" in page.shape.sources:
        right, bottom = page.view.width - 1, page.view.height - 1
        return np.array([[0, 0], [right, 0], [right, bottom], [0, bottom]], np.float64)
    outline = page.outline
    if outline is None or not np.isfinite(outline.corners).all():
        return None
    return outline.corners


def _corners_in_view(frame: Frame, corners: Points) -> Points | None:
    """The sheet's `corners` (4, 2) in the view, clockwise from its top left; None where they are not near its own."""
    seen = frame.to_flat(corners)
    if not np.isfinite(seen).all():
        return None
    right, bottom = frame.width - 1, frame.height - 1
    of_view = np.array([[0, 0], [right, 0], [right, bottom], [0, bottom]], np.float64)
    away = np.linalg.norm(of_view[:, None] - seen[None], axis=2)
    nearest = away.argmin(axis=1)
    if len(np.unique(nearest)) < 4 or away.min(axis=1).max() > NEAR * min(right, bottom):
        return None
    return np.asarray(seen[nearest])

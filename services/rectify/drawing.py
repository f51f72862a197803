"""Drawing of a view: one remap of the photo, whatever its frame."""

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import GrayImage, Points, RgbImage
from services.geometry.homographies import resizing, transform_points
from services.imaging.paper import certain_sheet
from services.rectify.analysis import PageAnalysis
from services.rectify.curved_framing import CurvedFrame
from services.rectify.framing import FlatFrame

GRID_STEP_PX = 16
"""A curved page's map is exact at every 16th output pixel, bilinear between: a page that bends with a radius of a
thousand pixels is then drawn within 0.03 pixels."""
BAND_PX = 512
"""Rows that are drawn at a time, which bounds the memory of the dense map."""


def draw_gray_view(analysis: PageAnalysis, frame: FlatFrame | CurvedFrame) -> GrayImage:
    """The view in gray, flat-fielded, drawn from the reduced photo."""
    H_strokes_photo = resizing(analysis.strokes_factor)
    if isinstance(frame, FlatFrame):
        flat = cv2.warpPerspective(
            analysis.strokes_image,
            H_strokes_photo @ frame.H_photo_flat,
            (frame.width, frame.height),
            flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
            borderValue=255.0,
        )
        return np.asarray(flat, np.uint8)
    view = np.full((frame.height, frame.width), 255, np.uint8)
    _remap(analysis.strokes_image, frame, analysis.strokes_factor, cv2.INTER_LINEAR, view)
    return view


def draw_flat_view(
    photo: RgbImage, frame: FlatFrame | CurvedFrame, outline: Points | None = None
) -> RgbImage:
    """The one remap of the full-resolution photo.

    White where the photo ends and, as on a scanner, beside a sheet whose `outline` (N, 2) in the photo shows that it
    is seen whole.
    """
    if isinstance(frame, FlatFrame):
        flat = np.asarray(
            cv2.warpPerspective(
                photo,
                frame.H_photo_flat,
                (frame.width, frame.height),
                flags=cv2.INTER_CUBIC | cv2.WARP_INVERSE_MAP,
                borderValue=(255.0, 255.0, 255.0),
            ),
            np.uint8,
        )
        sheet = None if outline is None else certain_sheet(outline)
        corners = None if sheet is None else transform_points(np.linalg.inv(frame.H_photo_flat), sheet)
    else:
        flat = np.full((frame.height, frame.width, 3), 255, np.uint8)
        _remap(photo, frame, 1.0, cv2.INTER_CUBIC, flat)
        corners = None if outline is None else _certain_flat_sheet(frame, outline)
    if corners is not None:
        beside = np.full((frame.height, frame.width), 255, np.uint8)
        cv2.fillConvexPoly(beside, np.round(corners).astype(np.int32), 0)
        cv2.max(flat, cv2.merge([beside, beside, beside]), dst=flat)
    return flat


def _certain_flat_sheet(frame: CurvedFrame, outline: Points) -> Points | None:
    """The sheet's corners in the view; a bent sheet's outline is convex only when it is flat."""
    flat = frame.to_flat(outline)
    limit = 2.0 * max(frame.width, frame.height)
    if not np.isfinite(flat).all() or np.abs(flat).max() > limit:
        return None
    return certain_sheet(flat)


def _remap(
    image: NDArray[np.uint8],
    frame: CurvedFrame,
    factor: float,
    interpolation: int,
    flat: NDArray[np.uint8],
) -> None:
    """Draw `image`, the photo resized by `factor`, into `flat` through the frame's map, band by band."""
    columns = -(-frame.width // GRID_STEP_PX) + 2
    x = (np.arange(columns) - 0.5) * GRID_STEP_PX - 0.5
    for top in range(0, frame.height, BAND_PX):
        rows = min(BAND_PX, frame.height - top)
        count = -(-rows // GRID_STEP_PX) + 2
        y = top + (np.arange(count) - 0.5) * GRID_STEP_PX - 0.5
        grid = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        seen = (frame.to_photo(grid) + 0.5) * factor - 0.5
        # What cannot be seen is looked up beside the photo.
        nodes = np.nan_to_num(seen, nan=-1e6).astype(np.float32).reshape(count, columns, 2)
        dense = cv2.resize(
            nodes, (columns * GRID_STEP_PX, count * GRID_STEP_PX), interpolation=cv2.INTER_LINEAR
        )[GRID_STEP_PX : GRID_STEP_PX + rows, GRID_STEP_PX : GRID_STEP_PX + frame.width]
        white = (255.0,) * (1 if image.ndim == 2 else 3)
        flat[top : top + rows] = cv2.remap(
            image,
            np.ascontiguousarray(dense[..., 0]),
            np.ascontiguousarray(dense[..., 1]),
            interpolation,
            borderMode=cv2.BORDER_CONSTANT,
            borderValue=white,
        )

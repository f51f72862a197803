"""Drawing of a view: one remap of the photo, whatever its frame."""

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import Floats, GrayImage, Points, RgbImage
from services.geometry.homographies import resizing, transform_points
from services.imaging.paper import certain_sheet
from services.rectify.curved_framing import CurvedFrame
from services.rectify.framing import FlatFrame

GRID_STEP_PX = 16
"""A curved page's map is exact at every 16th output pixel, bilinear between: a page that bends with a radius of a
thousand pixels is then drawn within 0.03 pixels."""
MAX_REDUCTION = 12.0
"""Photo pixels an output pixel: more is no page."""
BAND_PX = 512
"""Rows that are drawn at a time, which bounds the memory of the dense map."""


def draw_gray_view(gray: GrayImage, factor: float, frame: FlatFrame | CurvedFrame) -> GrayImage:
    """The view in gray, drawn from `gray`, the photo resized by `factor`; white beside it."""
    if isinstance(frame, FlatFrame):
        flat = cv2.warpPerspective(
            gray,
            resizing(factor) @ frame.H_photo_flat,
            (frame.width, frame.height),
            flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
            borderValue=255.0,
        )
        return np.asarray(flat, np.uint8)
    view = np.full((frame.height, frame.width), 255, np.uint8)
    _remap(gray, frame, factor, cv2.INTER_LINEAR, view)
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
        nodes = seen.reshape(count, columns, 2)
        known = _continuous(nodes, MAX_REDUCTION * GRID_STEP_PX * factor)
        dense = _between_nodes(np.where(known[..., None], nodes, 0.0).astype(np.float32))
        dense = dense[:rows, : frame.width]
        if not known.all():
            # A pixel with an unknown node beside it is looked up beside the photo.
            share = _between_nodes(known.astype(np.float32))[:rows, : frame.width]
            dense = np.where(share[..., None] < 0.999, np.float32(-1e6), dense)
        white = (255.0,) * (1 if image.ndim == 2 else 3)
        flat[top : top + rows] = cv2.remap(
            image,
            np.ascontiguousarray(dense[..., 0]),
            np.ascontiguousarray(dense[..., 1]),
            interpolation,
            borderMode=cv2.BORDER_CONSTANT,
            borderValue=white,
        )


def _continuous(nodes: Floats, limit: float) -> NDArray[np.bool_]:
    """Nodes (rows, columns) that are known and no further than `limit` from their neighbours.

    Where the page's model ends, at crossing rulings or edge-on, its map leaps.
    """
    known = np.asarray(np.isfinite(nodes).all(axis=-1))
    with np.errstate(invalid="ignore"):
        down = np.linalg.norm(np.diff(nodes, axis=0), axis=-1) > limit
        across = np.linalg.norm(np.diff(nodes, axis=1), axis=-1) > limit
    known[:-1] &= ~down
    known[1:] &= ~down
    known[:, :-1] &= ~across
    known[:, 1:] &= ~across
    return known


def _between_nodes(nodes: NDArray[np.float32]) -> NDArray[np.float32]:
    """Values at all pixels from those at every `GRID_STEP_PX`-th, without the rim of half a step."""
    size = (nodes.shape[1] * GRID_STEP_PX, nodes.shape[0] * GRID_STEP_PX)
    dense = cv2.resize(nodes, size, interpolation=cv2.INTER_LINEAR)
    return np.asarray(dense[GRID_STEP_PX:, GRID_STEP_PX:], np.float32)

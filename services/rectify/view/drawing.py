"""Drawing of a view by one remap of the photo, for flat and for bent pages."""

import threading
from collections.abc import Iterator

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import Floats, GrayImage, Points, RgbImage, Vector
from services.geometry.homographies import resizing, to_resized, transform_points, translation
from services.geometry.page_frame import Frame
from services.geometry.polygons import distances_within
from services.imaging.bicubic import draw_between_nodes, draw_by_homography
from services.imaging.node_grid import (
    FAR_PX,
    GRID_STEP_PX,
    MAX_REDUCTION,
    band_nodes,
    continuous_nodes,
    maps_between,
    negative_tiles,
    node_grid,
    take_values,
)
from services.side_by_side import SideStep

MASK_SIDE_PX = 500
"""Long side of the image that tells which nodes are near the paper's edge."""
MASK_ERROR_PX = 2.0
"""Distances in that image are off by less: half a pixel by its rounding, 5 % by OpenCV's steps of a distance."""
BAND_PX = 16 * GRID_STEP_PX
"""Rows drawn at a time; this bounds the memory of the dense map."""


def draw_gray_view(
    gray: GrayImage,
    factor: float | Vector,
    frame: Frame,
    origin: tuple[float, float] = (0.0, 0.0),
    nodes: Floats | None = None,
) -> GrayImage:
    """The view in gray, drawn from `gray`, the photo from pixel `origin` on, resized by `factor`; white outside.

    `factor` may be one for each axis; `nodes` are the view's `photo_nodes`, where they are known already.
    """
    if frame.H_photo_flat is not None:
        flat = cv2.warpPerspective(
            gray,
            resizing(factor) @ translation(-origin[0], -origin[1]) @ frame.H_photo_flat,
            (frame.width, frame.height),
            flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
            borderValue=255.0,
        )
        return np.asarray(flat, np.uint8)
    view = np.full((frame.height, frame.width), 255, np.uint8)
    to_gray = _BandMap((photo_nodes(frame) if nodes is None else nodes) - origin, factor)
    for top in range(0, frame.height, BAND_PX):
        band = view[top : top + BAND_PX]
        x, y = maps_between(to_gray.nodes(top, len(band)), frame.width, len(band))
        cv2.remap(gray, x, y, cv2.INTER_LINEAR, band, cv2.BORDER_CONSTANT, 255.0)
    return view


def draw_flat_view(photo: RgbImage, frame: Frame, paper: Points | None = None) -> RgbImage:
    """Draw the flat view from the photo by one remap at full resolution.

    Parameters
    ----------
    photo
        (H, W, 3) RGB.
    frame
        Backward map from pixels of the view to photo pixels.
    paper
        (M, 2) photo pixels: the sheet's end. Outside of it the view is white, as on a scanner.

    Returns
    -------
    RgbImage
        (frame.height, frame.width, 3); white where the photo ends.
    """
    drawing = FlatDrawing(photo, frame, paper)
    with SideStep(drawing.draw) as beside:
        drawing.draw()
        beside.result()
    return drawing.finish()


class FlatDrawing:
    """The drawing of `draw_flat_view`, in which several threads may take part.

    Nothing is computed before one draws. Bands of rows are the same whoever draws them.
    """

    def __init__(self, photo: RgbImage, frame: Frame, paper: Points | None) -> None:
        self._photo = photo
        self._frame = frame
        self._paper = paper
        self._preparing = threading.Lock()
        self._flat: RgbImage | None = None
        self._nodes: Floats | None = None
        self._map: _BandMap | None = None
        self._tops: Iterator[int] = iter(())

    def draw(self) -> None:
        """Draw bands until none is left that no other thread draws."""
        flat = self._prepare()
        frame = self._frame
        for top in self._tops:
            band = flat[top : top + BAND_PX]
            if frame.H_photo_flat is None:
                assert self._map is not None
                draw_between_nodes(self._photo, band, self._map.nodes(top, len(band)), beyond=255)
            else:
                H_photo_band = frame.H_photo_flat @ translation(0.0, float(top))
                draw_by_homography(self._photo, band, H_photo_band, beyond=255)

    def stop(self) -> None:
        """Let no other band be drawn: the view is not wanted."""
        self._prepare()
        for _ in self._tops:
            pass

    def finish(self) -> RgbImage:
        """The view, when all threads have drawn."""
        flat = self._prepare()
        if self._paper is not None:
            whiten_beyond(flat, self._frame, self._paper, self._nodes)
        return flat

    def _prepare(self) -> RgbImage:
        with self._preparing:
            if self._flat is None:
                frame = self._frame
                if frame.H_photo_flat is None:
                    self._nodes = photo_nodes(frame)
                    self._map = _BandMap(self._nodes, 1.0)
                self._flat = np.full((frame.height, frame.width, 3), 255, np.uint8)
                # `next` of a range's iterator hands out each band once, whichever thread asks.
                self._tops = iter(range(0, frame.height, BAND_PX))
            return self._flat


def places_in_view(frame: Frame, photo: Points) -> Points:
    """Pixels (M, 2) of the view at which the points `photo` (N, 2) are seen, of those that it shows."""
    with np.errstate(all="ignore"):
        flat = frame.to_flat(photo)
        seen = ((flat >= 0) & (flat <= [frame.width - 1, frame.height - 1])).all(axis=1)
    return flat[seen]


def photo_nodes(frame: Frame) -> Floats:
    """Photo pixels (rows, columns, 2) of the nodes of the view's grid; NaN where the page's model ends."""
    grid, shape = node_grid(0, 0, frame.width, frame.height)
    return np.asarray(frame.to_photo(grid)).reshape(*shape, 2)


def _whiten_outside(flat: RgbImage, polygon: Points) -> None:
    """Draw white, in place, what lies outside `polygon` (M, 2), pixels of the view `flat`."""
    height, width = flat.shape[:2]
    around = np.array([[-2, -2], [width + 1, -2], [width + 1, height + 1], [-2, height + 1]])
    # The contours themselves are drawn too, so the polygon is a pixel larger.
    beyond = np.round(polygon + np.sign(polygon - polygon.mean(axis=0)))
    # Two contours: what lies in one of them but not in both is filled.
    cv2.fillPoly(flat, [around.astype(np.int32), beyond.astype(np.int32)], (255, 255, 255))


def whiten_beyond(flat: RgbImage, frame: Frame, paper: Points, nodes: Floats | None = None) -> None:
    """Make the pixels of the view `flat` white, in place, whose photo points are outside the polygon `paper` (M, 2).

    `nodes` are the view's `photo_nodes`, where they are known already.

    The map of a bent page has no inverse beyond its horizon. So the polygon is mapped into the view only if the page is
    flat and the polygon ends before the horizon. Else pixels of the view are mapped into the photo, and their distances
    from the polygon are computed at the nodes of a grid.
    """
    if frame.H_photo_flat is not None:
        H_flat_photo = np.linalg.inv(frame.H_photo_flat)
        depth = paper @ H_flat_photo[2, :2] + H_flat_photo[2, 2]
        corners = transform_points(H_flat_photo, paper)
        if depth.min() * depth.max() > 0 and np.abs(corners).max() < FAR_PX:
            _whiten_outside(flat, corners)
            return
    at = photo_nodes(frame) if nodes is None else nodes
    inside = _distances_inside(paper, np.nan_to_num(at, nan=-FAR_PX))
    for tile, where in negative_tiles(inside, flat.shape[1], flat.shape[0]):
        flat[tile][... if where is None else where] = 255


def _distances_inside(polygon: Points, nodes: Floats) -> NDArray[np.float32]:
    """Distances (rows, columns), px, of `nodes` (rows, columns, 2) from the sides of `polygon` (M, 2); outside below 0.

    Exact at nodes of cells that a side may cross; elsewhere only the sign is, which is all that is needed there. A
    reduced image of the polygon tells which are which.
    """
    low = polygon.min(axis=0) - 2.0
    scale = min(1.0, MASK_SIDE_PX / float(np.ptp(polygon, axis=0).max()))
    size = np.ceil((polygon.max(axis=0) + 2.0 - low) * scale).astype(int) + 1
    inside = np.zeros((size[1], size[0]), np.uint8)
    cv2.fillPoly(inside, [np.round((polygon - low) * scale * 16).astype(np.int32)], 1, shift=4)
    reduced = np.asarray(cv2.distanceTransform(inside, cv2.DIST_L2, 3), np.float32)
    reduced -= cv2.distanceTransform(1 - inside, cv2.DIST_L2, 3)
    at = ((nodes - low) * scale).astype(np.float32)
    distances = take_values(reduced, at, cv2.INTER_LINEAR, cv2.BORDER_CONSTANT, -MASK_SIDE_PX) / np.float32(
        scale
    )
    unsure = MASK_ERROR_PX / scale
    neighbours = np.ones((3, 3), np.uint8)
    entered, left = (
        cv2.dilate(side.astype(np.uint8), neighbours) > 0
        for side in (distances > -unsure, distances < unsure)
    )
    crossed = entered & left
    distances[crossed] = distances_within(nodes[crossed], polygon)
    return np.asarray(distances, np.float32)


class _BandMap:
    """The map of a view to the photo resized by `factor`, by its nodes (rows, columns, 2) in the photo."""

    def __init__(self, nodes_in_photo: Floats, factor: float | Vector) -> None:
        nodes = to_resized(nodes_in_photo, factor)
        known = continuous_nodes(nodes, MAX_REDUCTION * float(np.max(factor)))
        self._nodes = np.where(known[..., None], nodes, np.nan).astype(np.float32)

    def nodes(self, top: int, rows: int) -> NDArray[np.float32]:
        """Those round the view's `rows` from `top` on, a multiple of the nodes' step; NaN where nothing is seen."""
        return self._nodes[band_nodes(top, rows)]

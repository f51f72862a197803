"""The shape of a page that the photo itself is: a scan, a page of a PDF, a page that an app has cropped."""

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from services.arrays import Floats, Homography, Points
from services.contract.rectify import Crop
from services.geometry.focal_prior import FocalLengthSource
from services.geometry.homographies import transform_points, translation
from services.geometry.page_map import PlaneMap
from services.geometry.photo_frame import PhotoFrame
from services.geometry.sheet_aspect import SheetAspect
from services.notices import Notice
from services.sheet.plane.framing import FlatFrame, frame_page
from services.sheet.shape import ShapeSource
from services.sheet.surfaces import PlaneSurface


@dataclass(frozen=True, slots=True, eq=False)
class PhotoAsPage:
    """The photo as the flat page, turned by `turn_rad` at most; see `PageShape`.

    `box` (left, top, right, bottom) is the part of the photo, in whole pixels, that the sheet fills; None where the
    sheet's ground does not reach to the photo's frame: then a view goes to the paper's end, or to the photo's if that
    is not seen. With `keeps_size` the view has the size of the box though it is turned: a page of a PDF keeps its size.
    `focal` is not seen.
    """

    turn_rad: float
    focal: float
    box: tuple[int, int, int, int] | None
    line_count: int = 0
    notices: tuple[Notice, ...] = ()
    keeps_size: bool = False
    kind: ClassVar[Literal["planar"]] = "planar"
    sources: ClassVar[tuple[ShapeSource, ...]] = ("photo",)
    focal_source: ClassVar[FocalLengthSource] = "assumed"
    log_focal_deviation: ClassVar[float] = float("inf")
    sides_believed: ClassVar[bool] = False
    sheet_aspect: ClassVar[SheetAspect | None] = None
    log_aspect_deviation: ClassVar[float] = 0.0

    @property
    def ends_at_sides(self) -> bool:
        """See `PageShape`."""
        return self.box is not None

    @property
    def H_centred_plane(self) -> Homography:
        """From the flat page to centred photo coordinates: a turn, exact where it is none or a quarter."""
        c, s = _exact(np.cos(self.turn_rad)), _exact(np.sin(self.turn_rad))
        return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])

    @property
    def page_map(self) -> PlaneMap:
        """See `PageShape`."""
        return PlaneMap(self.H_centred_plane)

    def in_space(self, centred: Points) -> Floats:
        """See `PageShape`."""
        return np.column_stack([centred, np.full(len(centred), self.focal)])

    def surface(self, view: PhotoFrame) -> PlaneSurface:
        """See `PageShape`."""
        return PlaneSurface((0.0, 0.0, 1.0))

    def frame(
        self, view: PhotoFrame, points: Points, text_height_px: float, paper: Points | None, crop: Crop
    ) -> FlatFrame:
        """See `PageShape`."""
        turn = self.H_centred_plane
        if crop == "text" or (self.box is None and paper is not None):
            H_photo_plane = view.H_photo_centred @ turn
            return frame_page(
                H_photo_plane,
                (view.height, view.width),
                points,
                text_height_px,
                paper,
                only_text=crop == "text",
            )
        whole = (0, 0, view.width - 1, view.height - 1)
        left, top, right, bottom = whole if crop == "photo" or self.box is None else self.box
        corners = np.array([[left, top], [right, top], [right, bottom], [left, bottom]], np.float64)
        middle = corners.mean(axis=0)
        reach = np.abs(transform_points(turn.T, corners - middle)).max(axis=0)
        if self.keeps_size:
            sideways = abs(turn[1, 0]) > abs(turn[0, 0])
            size = np.array([right - left, bottom - top], np.float64)
            reach = (size[::-1] if sideways else size) / 2
        # Of a turned page all is shown; a corner of less than half a pixel is not worth a column.
        width, height = (int(np.ceil(2 * half - 0.5)) + 1 for half in reach)
        to_middle = translation(-(width - 1) / 2, -(height - 1) / 2)
        return FlatFrame(translation(float(middle[0]), float(middle[1])) @ turn @ to_middle, width, height)


def _exact(value: float) -> float:
    """`value` without the rounding of sines and cosines of quarter turns."""
    return float(np.round(value)) if abs(value - np.round(value)) < 1e-12 else float(value)

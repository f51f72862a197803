"""The shape of a flat page: its plane, and the evidence for it."""

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from services.arrays import Floats, Points
from services.contract.rectify import Crop
from services.geometry.focal_prior import FocalLengthSource
from services.geometry.page_map import PlaneMap
from services.geometry.photo_frame import PhotoFrame
from services.geometry.planar import PagePlane
from services.geometry.sheet_aspect import SheetAspect
from services.notices import Notice
from services.sheet.developable.observations import LineObservations
from services.sheet.plane.framing import FlatFrame, frame_page
from services.sheet.shape import ShapeSource
from services.sheet.surfaces import PlaneSurface


@dataclass(frozen=True, slots=True, eq=False)
class PlanarPage:
    """The plane of a flat page, and the evidence for it; see `PageShape`."""

    plane: PagePlane
    focal_source: FocalLengthSource
    notices: tuple[Notice, ...] = ()
    line_count: int = 0
    deviation: float = 0.0
    """Mean deviation (rad) of the flows from horizontal and vertical in the flat view."""
    sources: tuple[ShapeSource, ...] = ("text",)
    sides_believed: bool = False
    """All four sides of the sheet are straight, and those of a rectangle in this plane."""
    skew_rad: float = 0.0
    """Turn from the text's directions to those of the sheet's sides, in the page's plane."""
    log_focal_deviation: float = float("inf")
    focal_tension: float = 0.0
    """Difference between the prior focal length and that of the page, in standard deviations."""
    lines: LineObservations | None = None
    """The text lines, as they were traced in the plane's view; None if its text was not looked at in that."""
    sheet_aspect: SheetAspect | None = None
    log_aspect_deviation: float = 0.0
    kind: ClassVar[Literal["planar"]] = "planar"
    ends_at_sides: ClassVar[bool] = False

    @property
    def page_map(self) -> PlaneMap:
        """See `PageShape`."""
        return PlaneMap(self.plane.H_centred_plane)

    @property
    def focal(self) -> float:
        """See `PageShape`."""
        return self.plane.focal

    def in_space(self, centred: Points) -> Floats:
        """See `PageShape`."""
        sight = np.column_stack([centred, np.full(len(centred), self.focal)])
        normal = self.plane.rotation[:, 2]
        away = sight @ normal * np.sign(normal[2])
        depth = self.focal * abs(normal[2]) / np.where(away > 0, away, np.nan)
        return np.asarray(sight * depth[:, None])

    def surface(self, view: PhotoFrame) -> PlaneSurface:
        """See `PageShape`."""
        x, y, z = self.plane.rotation[:, 2].tolist()
        return PlaneSurface((x, y, z))

    def frame(
        self, view: PhotoFrame, points: Points, text_height_px: float, paper: Points | None, crop: Crop
    ) -> FlatFrame:
        """See `PageShape`."""
        H_photo_plane = view.H_photo_centred @ self.plane.H_centred_plane
        return frame_page(
            H_photo_plane, (view.height, view.width), points, text_height_px, paper, only_text=crop == "text"
        )

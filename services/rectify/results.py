"""Results of `rectify`: the flat image and all the evidence for it."""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from services.arrays import Points, RgbImage, Vector
from services.geometry.focal_prior import FocalLengthSource
from services.geometry.sheet_aspect import SheetAspect
from services.notices import Notice
from services.rectify.view.view_plan import ViewPlan
from services.sheet.shape import ShapeSource
from services.sheet.surfaces import Surface


@dataclass(frozen=True, slots=True)
class Evidence:
    """Convergence S3/S1 of both flows (3.2.2; None: too few samples) and the share of text area, 0-1.

    `source` names what decided the shape. `outline_confidence`, 0-1, is that of the sheet's outline, None where none
    was found; `sides_seen` counts its sides of which an edge was seen.
    """

    major_convergence: float | None
    minor_convergence: float | None
    text_area_fraction: float
    source: tuple[ShapeSource, ...] = ("text",)
    outline_confidence: float | None = None
    sides_seen: int = 0
    print_kept: float | None = None
    """Share, 0-1, of the characters on the sheet that lie in the view with their whole box; None without text."""
    flatness_error_percent: float | None = None
    """RMS error of the mesh to expect, percent of the page's width; None where nothing in the view shows it."""


@dataclass(frozen=True, slots=True)
class CameraEstimate:
    """Focal length in photo pixels and the diagonal field of view.

    `source` is "assumed" if nothing shows the focal length; then it is that of a typical camera.
    `principal_point` (x, y) is in photo pixels: the photo's middle ("centre"), unless the page shows that the photo was
    cropped ("estimated").
    """

    focal_length_px: float | None
    field_of_view_rad: float | None
    source: FocalLengthSource
    principal_point: tuple[float, float] | None = None
    principal_point_source: Literal["centre", "estimated"] = "centre"
    log_focal_deviation: float | None = None
    """Standard deviation of the focal length's logarithm as this page alone shows it; None: it does not."""


@dataclass(frozen=True, slots=True)
class Orientation:
    """Clockwise turn that was applied to the flat view so that it reads.

    `rotation_deg` is one of 0, 90, 180, 270; `mirrored` means that the view was flipped left to right
    before the turn; `confidence` is 0-1, None when nothing was read (no OCR, or `upright=False`).
    """

    rotation_deg: int
    mirrored: bool
    confidence: float | None


@dataclass(frozen=True, slots=True, eq=False)
class PrintSample:
    """Characters of the page in the photo: centres (N, 2) and heights (N,) in photo pixels.

    `is_light`: they are lighter than the paper.
    """

    characters: Points
    heights_px: Vector
    is_light: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class RectifyResult:
    """The frontal flat view and its evidence.

    `mesh` is (rows, columns, 2): `mesh[r, c]` is the photo point (x, y) shown at output pixel
    (c (width-1)/(columns-1), r (height-1)/(rows-1)), after `orientation` was applied.
    `corners` (4, 2) are those of the sheet in photo pixels, clockwise from the top left of the view; a row is NaN where
    the corner was not seen, and None says that no outline was found. `print` is None if the page has no text.
    `sheet_aspect` says how well the aspect of a flat sheet is known, None where that was not computed.
    `stretch` is the factor by which the view's width over its height was changed to fit the size that the request
    names; None where it was not fitted.
    """

    image: RgbImage
    kind: Literal["planar", "curved"]
    evidence: Evidence
    camera: CameraEstimate
    surface: Surface
    orientation: Orientation
    mesh: NDArray[np.float64]
    warnings: tuple[Notice, ...] = ()
    timings_ms: dict[str, float] = field(default_factory=dict)
    corners: Points | None = None
    print: PrintSample | None = None
    sheet_aspect: SheetAspect | None = None
    stretch: float | None = None
    plan: ViewPlan | None = None
    """How this and other views are drawn, where the photo is to be kept."""

"""A page whose text does not show its shape: its plane from the sheet's sides, or from straight print."""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from services.arrays import GrayImage, Points, RgbImage
from services.errors import NoText
from services.geometry.focal_prior import FOCAL, FocalLengthSource, FocalPrior
from services.geometry.homographies import transform_points
from services.geometry.page_frame import Frame, resize_frame
from services.geometry.photo_frame import PhotoFrame
from services.imaging.channels import luminance
from services.imaging.illumination import flatten_illumination
from services.imaging.reduction import reduce_image
from services.notices import Notice
from services.rectify.view.drawing import draw_gray_view
from services.sheet.framing import frame_mesh
from services.sheet.outline.results import SheetOutline
from services.sheet.plane.framing import frame_page
from services.sheet.plane.outline_plane import (
    NoOutlinePlane,
    OutlinePlane,
    OutlinePlaneParameters,
    read_sides,
)
from services.sheet.plane.pose import PagePose, PoseParameters
from services.sheet.plane.ruled_plane import plane_from_rules
from services.sheet.ridged_page import RidgedPage, estimate_ridged_page, sides_bend
from services.sheet.shape import ShapeSource

NOT_FLAT = Notice(
    "curved-page",
    "the sheet's edges are not those of a flat rectangle, and no text shows its shape; this is its best planar view.",
)
BENT = OutlinePlaneParameters(max_bend=0.06, max_misfit_rad=float(np.deg2rad(8.0)), max_off_centre=0.0)
"""For bent sheets, of which only the corners are used."""


@dataclass(frozen=True, slots=True)
class TextlessParameters:
    """Limits for pages whose text does not show their shape."""

    orientation_long_side_px: int = 1600
    """Long side of the photo in which a few words are read to find which way is up."""
    straight_side: float = 0.006
    """RMS bend of a side, as a share of the sheet's size: without text a bend must be obvious."""


@dataclass(frozen=True, slots=True, eq=False)
class TextlessPage:
    """Evidence and shape of such a page, before it is drawn.

    `extent` (M, 2) are photo points that the view must show: the sheet's outline, else the ends of the straight lines.
    """

    view: PhotoFrame
    shape: PagePose | RidgedPage
    extent: Points
    outline: SheetOutline | None
    aspect: float | None
    """Width over height of the sheet as the photo shows it, where all four sides are seen."""

    @property
    def kind(self) -> Literal["planar", "curved"]:
        """How the page is flattened."""
        return "planar" if isinstance(self.shape, PagePose) else "curved"

    @property
    def characters(self) -> Points:
        """No characters (0, 2): none show the page's shape."""
        return np.zeros((0, 2))

    @property
    def border(self) -> Points | None:
        """The sheet's outline (M, 2) in photo pixels, where it is seen."""
        return None if self.outline is None else self.outline.polygon

    @property
    def notices(self) -> tuple[Notice, ...]:
        """Notices about the shape."""
        return self.shape.notices if isinstance(self.shape, PagePose) else ()


def find_textless_page(
    photo: RgbImage, outline: SheetOutline | None, view: PhotoFrame, prior: FocalPrior, refusal: NoText
) -> TextlessPage:
    """The page in `photo` (H, W, 3), whose text was refused, by its `outline`, else by its straight print.

    Raises
    ------
    NoText
        `refusal` with what else was searched, when neither shows a plane.
    """
    p = TextlessParameters()
    # A sheet with bent sides is a bent sheet, even if a plane would fit them.
    if outline is not None and sides_bend(outline) > p.straight_side:
        ridged = estimate_ridged_page(outline, view, prior, 0.0, None, None)
        if isinstance(ridged, RidgedPage):
            return TextlessPage(view, ridged, outline.polygon, outline, ridged.page_map.aspect_ratio)
    sheet = read_sides(outline, view, prior)
    if sheet is not None and outline is not None and isinstance(sheet.plane, OutlinePlane):
        shape = pose_of(sheet.plane, sheet.view, prior, "outline", p)
        return TextlessPage(sheet.view, shape, outline.polygon, outline, sheet.plane.aspect)
    gray = luminance(photo)
    ruled = plane_from_rules(gray, view, prior)
    if isinstance(ruled, OutlinePlane):
        extent = transform_points(
            view.H_photo_centred, np.concatenate([ruled.lines.starts, ruled.lines.ends])
        )
        return TextlessPage(view, pose_of(ruled, view, prior, "rules", p), extent, None, None)
    bent = read_sides(outline, view, prior, BENT)
    if bent is not None and outline is not None and isinstance(bent.plane, OutlinePlane):
        shape = pose_of(bent.plane, bent.view, prior, "outline", p)
        shape = replace(shape, notices=(NOT_FLAT, *shape.notices), sides_believed=False)
        return TextlessPage(bent.view, shape, outline.polygon, outline, bent.plane.aspect)
    raise NoText(f"{refusal.detail} {describe_misses(sheet.plane if sheet is not None else None, ruled)}")


def describe_misses(sheet: OutlinePlane | NoOutlinePlane | None, ruled: NoOutlinePlane) -> str:
    """Sentence about what else was searched and not found."""
    if isinstance(sheet, NoOutlinePlane):
        return f"A sheet's edge is seen, but {sheet.reason}."
    return f"No sheet's edge is seen whole either, and {ruled.reason}: have all four sides in the photo."


def pose_of(
    found: OutlinePlane, view: PhotoFrame, prior: FocalPrior, source: ShapeSource, p: TextlessParameters
) -> PagePose:
    """The plane in pixels, with notices about its uncertainty."""
    notices: tuple[Notice, ...] = ()
    if found.log_aspect_deviation > PoseParameters().aspect_deviation:
        notices = (
            Notice(
                "aspect-ratio-uncertain",
                "this pose does not show the focal length well, so the width-to-height ratio may be off by about "
                f"{100 * found.log_aspect_deviation:.0f} %; send focal_length_px or keep EXIF.",
            ),
        )
    seen = prior.source == "assumed" and found.log_focal_deviation < FOCAL.seen_deviation
    focal_source: FocalLengthSource = "estimated" if seen else prior.source
    N = found.plane.rotation[:, 2]
    return PagePose(
        view.H_photo_centred @ found.plane.H_centred_plane,
        (float(N[0]), float(N[1]), float(N[2])),
        found.plane.focal * view.unit_px,
        focal_source,
        notices,
        0,
        0.0,
        (source,),
        source == "outline",
    )


def frame_textless(page: TextlessPage) -> Frame:
    """View of the sheet, or of the region of the straight lines, at the resolution of the photo."""
    if isinstance(page.shape, RidgedPage):
        return frame_mesh(page.shape.page_map, page.view, None)
    size = (page.view.height, page.view.width)
    return frame_page(page.shape.H_photo_plane, size, page.extent, 0.0, page.border)


def draw_for_reading(photo: RgbImage, frame: Frame) -> GrayImage:
    """Small flat view in gray under even light, in which words can be read to find which way is up."""
    p = TextlessParameters()
    factor = min(1.0, p.orientation_long_side_px / max(photo.shape))
    gray = reduce_image(luminance(photo), factor)
    return draw_gray_view(flatten_illumination(gray), factor, resize_frame(frame, factor))

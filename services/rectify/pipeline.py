"""The steps of `rectify`, in their order."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from services.arrays import GrayImage, Mask, Points, RgbImage
from services.contract.rectify import Crop, RectifyParameters
from services.errors import NoText
from services.geometry.camera import field_of_view
from services.geometry.focal_prior import FocalPrior
from services.geometry.page_frame import TEXT_FRAMING, Frame, mesh_of, resize_frame, turn_frame
from services.geometry.photo_frame import PhotoFrame
from services.geometry.vanishing_points import FlowVanishingPoints
from services.heap import release_freed_memory
from services.imaging.normalization import normalize_illumination
from services.imaging.paper import certain_sheet
from services.imaging.reduction import Halves
from services.notices import Notice
from services.ocr.engine import OcrEngine
from services.rectify.analysis.focal_length import focal_prior, remembered
from services.rectify.analysis.page_analysis import PICTURE_SHARE, PageAnalysis, analyse_photo
from services.rectify.analysis.photo_border import find_cut_borders, leave_out_borders
from services.rectify.analysis.print_sample import sample_print
from services.rectify.parameter_checks import check_parameters
from services.rectify.results import CameraEstimate, Evidence, Orientation, RectifyResult
from services.rectify.shape_choice.choice import FEW_LINES, choose_shape
from services.rectify.shape_choice.principal_point import find_principal_point
from services.rectify.shape_choice.textless import (
    TextlessPage,
    draw_for_reading,
    find_textless_page,
    frame_textless,
)
from services.rectify.stage_clock import StageClock
from services.rectify.view.drawing import draw_flat_view, draw_gray_view, places_in_view
from services.rectify.view.edge_cropping import crop_to_gutter, within_gutter
from services.rectify.view.orientation import estimate_orientation
from services.rectify.view.sheet_corners import corners_by_view
from services.rectify.view.sheet_cut import (
    cut_to_outline,
    cut_to_page,
    paper_in_photo,
    restore_detail,
    within_polygon,
)
from services.sheet.curved_page import CurvedPage
from services.sheet.framing import CURVED_TEXT_FRAMING, frame_curved_page, frame_mesh
from services.sheet.outline.detection import find_outline
from services.sheet.outline.results import SheetOutline
from services.sheet.plane.framing import frame_page
from services.sheet.plane.outline_plane import read_sides
from services.sheet.plane.pose import PagePose
from services.sheet.ridged_page import RidgedPage
from services.sheet.shape import ShapeSource
from services.sheet.surfaces import MeshSurface, PlaneSurface, StripsSurface

FACING_PAGE = Notice(
    "facing-page", "text of a facing page was left out; send region, a polygon round it, to choose another."
)
STAGE_BEGINS = {
    "text": 0.0,
    "texture_flow": 0.2,
    "outline": 0.38,
    "shape": 0.42,
    "framing": 0.65,
    "orientation": 0.7,
    "remap": 0.85,
    "illumination": 0.9,
}
"""Shares of the time, from photos of 3 and 12 megapixels of flat pages; bent ones spend more on their shape."""


@dataclass(frozen=True, slots=True, eq=False)
class FlatPage:
    """Evidence and shape of a page, before it is drawn."""

    analysis: PageAnalysis
    view: PhotoFrame
    vanishing_points: FlowVanishingPoints
    shape: PagePose | CurvedPage | RidgedPage
    notices: tuple[Notice, ...]
    outline: SheetOutline | None = None
    """The sheet's, where it was found."""

    @property
    def characters(self) -> Points:
        """Centres of the page's characters (N, 2) in photo pixels."""
        return self.analysis.characters[self.on_page]

    @property
    def on_page(self) -> Mask:
        """Which characters (M,) are the page's: those outside of a sheet found without text are texture of the desk."""
        found = self.analysis.characters
        if self.outline is None or not isinstance(self.shape, PagePose) or self.shape.sources != ("outline",):
            return np.ones(len(found), bool)
        return within_polygon(self.outline.polygon, found)

    @property
    def kind(self) -> Literal["planar", "curved"]:
        """How the page is flattened."""
        return "planar" if isinstance(self.shape, PagePose) else "curved"


def rectify(
    photo: RgbImage,
    parameters: RectifyParameters,
    exif_focal_length_px: float | None = None,
    ocr: OcrEngine | None = None,
) -> RectifyResult:
    """Flatten the page in a photo: its frontal view, upright.

    Parameters
    ----------
    photo
        (H, W, 3) RGB uint8.
    parameters
        Options of the request.
    exif_focal_length_px
        Focal length of EXIF in photo pixels, if there is one.
    ocr
        Reads lines to find which way is up; without it the view is not turned.

    Returns
    -------
    RectifyResult
        The view, the map to the photo, and the evidence.

    Raises
    ------
    NoText
        When the photo shows too little printed text to see the page's shape, and no sheet's edges either.
    InvalidOption
        When `parameters` cannot be met (a region or focal length that the photo cannot have).
    """
    check_parameters(photo.shape[1], photo.shape[0], parameters)
    clock = StageClock(STAGE_BEGINS)
    page = find_page(photo, parameters, exif_focal_length_px, clock)
    return flatten_page(photo, page, parameters, ocr, clock)


def flatten_page(
    photo: RgbImage,
    page: FlatPage | TextlessPage,
    parameters: RectifyParameters,
    ocr: OcrEngine | None,
    clock: StageClock,
) -> RectifyResult:
    """Flat view of a `page` whose shape is known: choose the frame, turn it upright, draw it."""
    notices = list(page.notices)
    frame: Frame
    with clock.stage("framing"):
        if isinstance(page, TextlessPage):
            outline, frame = page.border, frame_textless(page)
            if parameters.crop == "sheet" and page.outline is not None:
                frame, _ = cut_to_outline(frame, page.outline, page.characters)
        elif isinstance(page.shape, RidgedPage):
            outline, frame = None, frame_photo(photo, page, None, parameters.crop)
        else:
            outline = find_border(page, parameters.crop)
            frame = frame_photo(photo, page, outline, parameters.crop)
            if parameters.crop == "sheet":
                frame = cut_view(photo, frame, page, outline)
        if isinstance(page, FlatPage):
            pixels = photo.shape[0] * photo.shape[1]
            frame = restore_detail(frame, pixels, page.characters, page.analysis.text_height_px)
    orientation = Orientation(0, False, None)
    if parameters.upright:
        with clock.stage("orientation"):
            if isinstance(page, TextlessPage):
                flat_frame = frame
                orientation, notice = tell_orientation(lambda: draw_for_reading(photo, flat_frame), ocr)
            else:
                orientation, notice = orient_page(page.analysis, frame, ocr)
        notices += [notice] if notice else []
    frame = turn_frame(frame, orientation.rotation_deg, orientation.mirrored)
    release_freed_memory()
    with clock.stage("remap"):
        sheet = page.outline if parameters.crop == "sheet" else None
        paper = None if sheet is None else paper_in_photo(sheet, page.characters)
        flat = draw_flat_view(photo, frame, outline, paper)
    if parameters.illumination == "normalize":
        with clock.stage("illumination"):
            known = isinstance(page, FlatPage)
            flat = normalize_illumination(flat, places_in_view(frame, page.characters) if known else None)
    mesh = np.asarray(mesh_of(frame), np.float64)
    return RectifyResult(
        flat,
        page.kind,
        describe_evidence(page),
        describe_camera(page),
        describe_surface(page),
        orientation,
        mesh,
        tuple(notices),
        clock.timings_ms,
        corners_by_view(page.outline, mesh, mirrored=orientation.mirrored),
        None if isinstance(page, TextlessPage) else sample_print(page.analysis, page.on_page),
    )


def find_page(
    photo: RgbImage, parameters: RectifyParameters, exif_focal_length_px: float | None, clock: StageClock
) -> FlatPage | TextlessPage:
    """The page in `photo` by its text and the outline of its sheet, or by one of them where the other is not seen.

    Raises
    ------
    NoText
        When neither text nor a sheet's edges nor straight print shows the page's shape.
    """
    view = PhotoFrame(photo.shape[1], photo.shape[0])
    prior = focal_prior(view, parameters.focal_length_px, exif_focal_length_px, remembered(parameters))
    outline, sought, halves = None, False, Halves(photo)
    try:
        analysis = analyse_photo(halves, parameters.region, clock=clock)
        release_freed_memory()
        # The outline of an opened book is not that of a single page.
        if not analysis.facing_page and parameters.region is None:
            with clock.stage("outline"):
                outline, sought = find_outline(halves, analysis.characters, analysis.text_height_px), True
        return shape_page(analysis, view, prior, parameters, clock, outline)
    except NoText as refusal:
        if not sought:
            with clock.stage("outline"):
                outline = find_outline(halves)
        with clock.stage("shape"):
            return find_textless_page(photo, outline, view, prior, refusal)


def estimate_page(
    photo: RgbImage, parameters: RectifyParameters, exif_focal_length_px: float | None, clock: StageClock
) -> FlatPage:
    """Text, flows, kind and pose of the page in `photo`, by its text alone.

    Raises
    ------
    NoText
        When the photo shows too little printed text to see the page's shape.
    """
    analysis = analyse_photo(photo, parameters.region, clock=clock)
    view = PhotoFrame(photo.shape[1], photo.shape[0])
    prior = focal_prior(view, parameters.focal_length_px, exif_focal_length_px, remembered(parameters))
    return shape_page(analysis, view, prior, parameters, clock)


def shape_page(
    analysis: PageAnalysis,
    view: PhotoFrame,
    prior: FocalPrior,
    parameters: RectifyParameters,
    clock: StageClock,
    outline: SheetOutline | None = None,
) -> FlatPage:
    """Kind and pose of a page whose text and flows are known; `prior` is that of the focal length.

    Raises
    ------
    NoText
        When most of its ink is no text, and no sheet's edges show its shape either.
    """
    with clock.stage("shape"):
        if outline is not None:
            cut = find_cut_borders(
                analysis.characters, analysis.text_height_px, view.width, view.height, outline.polygon
            )
            outline = leave_out_borders(outline, cut, view.width, view.height)
        sheet = read_sides(outline, view, prior)
        view = view if sheet is None else sheet.view
        evidence = analysis.evidence(view)
        shape, notices = choose_shape(evidence, prior, parameters.kind, outline, sheet)
        moved = find_principal_point(evidence, prior, shape)
        if moved is not None:  # a cropped photo: repeat all relative to the principal point that was found
            sheet = read_sides(outline, moved.evidence.view, moved.prior)
            again = choose_shape(moved.evidence, moved.prior, parameters.kind, outline, sheet)
            if type(again[0]) is type(shape):
                shape, notices = again[0], (*moved.notices, *again[1])
                view, evidence = moved.evidence.view, moved.evidence
    sides_believed = isinstance(shape, RidgedPage) or (isinstance(shape, PagePose) and shape.sides_believed)
    few_lines = analysis.text.rejected_fraction > PICTURE_SHARE and shape.line_count < FEW_LINES
    if few_lines and not sides_believed:
        raise NoText(
            f"most of what is printed is no text, and only {shape.line_count} short lines of text were found. "
            "Send region, a polygon round the text, if there is some."
        )
    if analysis.facing_page:
        notices += (FACING_PAGE,)
    return FlatPage(analysis, view, evidence.vanishing_points, shape, notices, outline)


def find_border(page: FlatPage, crop: Crop) -> Points | None:
    """The sheet's outline (N, 2) in the photo, up to the gutter; None if unseen or not to be cut at."""
    outline = page.analysis.paper.outline(page.analysis.characters) if crop == "sheet" else None
    return outline if outline is None else within_gutter(outline, page.analysis)


def cut_view(photo: RgbImage, frame: Frame, page: FlatPage, border: Points | None) -> Frame:
    """`frame` cut to the page: its outline's sides, the gutter, edges in the flat view, blank ground."""
    known: frozenset[str] = frozenset()
    if page.outline is not None:
        frame, known = cut_to_outline(frame, page.outline, page.characters)
    frame = crop_to_gutter(frame, page.analysis)
    # Lines on a flat sheet that is wholly in the photo are print, except on a spread of two pages.
    flat_sheet = border if frame.H_photo_flat is not None and not page.analysis.facing_page else None
    whole = flat_sheet is not None and certain_sheet(flat_sheet) is not None
    return cut_to_page(photo, frame, page.analysis, known, whole=whole)


def frame_photo(photo: RgbImage, page: FlatPage, outline: Points | None, crop: Crop = "sheet") -> Frame:
    """The part of the flat page that is shown; `outline` (N, 2) is the sheet's in the photo, if its edge is seen."""
    characters, height = page.analysis.characters, page.analysis.text_height_px
    if isinstance(page.shape, RidgedPage) and crop == "sheet":
        return frame_mesh(page.shape.page_map, page.view, characters)
    flat, curved = (TEXT_FRAMING, CURVED_TEXT_FRAMING) if crop == "text" else (None, None)
    if isinstance(page.shape, RidgedPage):
        return frame_curved_page(page.shape.page_map, page.view, characters, height, None, flat, curved)
    if isinstance(page.shape, CurvedPage):
        return frame_curved_page(page.shape.page_map, page.view, characters, height, outline, flat, curved)
    size = (photo.shape[0], photo.shape[1])
    return frame_page(page.shape.H_photo_plane, size, characters, height, outline, flat)


def orient_page(
    analysis: PageAnalysis, frame: Frame, ocr: OcrEngine | None
) -> tuple[Orientation, Notice | None]:
    """Orientation of the flat view, and a notice if it is unknown."""
    text = analysis.strokes
    small = resize_frame(frame, text.factor)
    return tell_orientation(lambda: draw_gray_view(text.image, text.factor, small, text.origin), ocr)


def tell_orientation(
    draw: Callable[[], GrayImage], ocr: OcrEngine | None
) -> tuple[Orientation, Notice | None]:
    """Orientation of the flat-fielded view that `draw` returns, and a notice if it is unknown."""
    if ocr is None:
        return Orientation(0, False, None), Notice(
            "ocr-unavailable",
            "no OCR engine is installed, so the page may be upside down; text lines are horizontal.",
        )
    orientation = estimate_orientation(draw(), ocr)
    if (orientation.confidence or 0.0) < 0.5:
        return orientation, Notice(
            "orientation-unknown",
            "too little could be read to tell which way up the page is; it was not turned.",
        )
    return orientation, None


def describe_evidence(page: FlatPage | TextlessPage) -> Evidence:
    """Convergence of both flows, the share of text, and what decided the shape."""
    if isinstance(page.shape, CurvedPage):
        source: tuple[ShapeSource, ...] = ("text",)
    elif isinstance(page.shape, RidgedPage):
        source = ("outline", "text") if page.shape.line_count else ("outline",)
    else:
        source = page.shape.sources
    confidence = None if page.outline is None else page.outline.confidence
    sides = 0 if page.outline is None else sum(side.seen > 0 for side in page.outline.sides)
    if isinstance(page, TextlessPage):
        return Evidence(None, None, 0.0, source, confidence, sides)
    minor = page.vanishing_points.vertical.convergence if page.analysis.minor is not None else None
    return Evidence(
        page.vanishing_points.horizontal.convergence,
        minor,
        page.analysis.text.area_fraction,
        source,
        confidence,
        sides,
    )


def describe_camera(page: FlatPage | TextlessPage) -> CameraEstimate:
    """Focal length in photo pixels, and its source."""
    shape, view = page.shape, page.view
    if isinstance(shape, CurvedPage | RidgedPage):
        focal_px, source = shape.focal * view.unit_px, shape.focal_source
    else:
        focal_px, source = shape.focal_length_px, shape.focal_source
    moved: Literal["centre", "estimated"] = "centre" if view.principal_point_px is None else "estimated"
    angle = field_of_view(focal_px, view.width, view.height)
    deviation = shape.log_focal_deviation if np.isfinite(shape.log_focal_deviation) else None
    return CameraEstimate(focal_px, angle, source, view.centre, moved, deviation)


def describe_surface(page: FlatPage | TextlessPage) -> PlaneSurface | StripsSurface | MeshSurface:
    """The plane's normal, or the curved page's strips."""
    if isinstance(page.shape, CurvedPage):
        return page.shape.strips
    if isinstance(page.shape, RidgedPage):
        return page.shape.surface(page.view)
    return PlaneSurface(page.shape.normal)

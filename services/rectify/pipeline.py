"""The steps of `rectify`, in their order."""

from dataclasses import replace
from typing import get_args

import numpy as np

from services.arrays import RgbImage
from services.contract.rectify import Crop, Origin, RectifyParameters
from services.heap import release_if_large
from services.imaging.normalization import normalize_illumination
from services.ocr.engine import OcrEngine
from services.rectify.effort import BRIEF, WHOLE, Effort
from services.rectify.page_description import describe_page
from services.rectify.page_search import find_page
from services.rectify.parameter_checks import check_parameters
from services.rectify.results import Orientation, RectifyResult
from services.rectify.shape_choice.shaped_page import ShapedPage
from services.rectify.stage_clock import StageClock
from services.rectify.view.drawing import places_in_view
from services.rectify.view.held_corners import end_at_corners
from services.rectify.view.judged_view import JudgedView, best_view, frame_view, judge_view
from services.rectify.view.orientation import orient_page
from services.rectify.view.paper_fit import fit_to_paper
from services.rectify.view.print_kept import sheet_print
from services.rectify.view.print_sample import sample_print
from services.rectify.view.view_drawing import ViewDrawing
from services.rectify.view.view_plan import ViewPlan, plan_view

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


def rectify(
    photo: RgbImage,
    parameters: RectifyParameters,
    exif_focal_length_px: float | None = None,
    ocr: OcrEngine | None = None,
    origin: Origin = "photo",
    effort: Effort = WHOLE,
) -> RectifyResult:
    """Flatten the page in a photo: its frontal view, upright.

    By a brief effort the view is neither turned nor drawn: its image is blank.

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
    origin
        Of the photo: a page of a PDF is a page, with or without text, and flat where it is print.

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
    page = find_page(photo, parameters, exif_focal_length_px, clock, origin, effort=effort)
    if effort.is_brief:
        return _place_page(photo, page, parameters, clock)
    return flatten_page(photo, page, parameters, ocr, clock)


def _place_page(
    photo: RgbImage, page: ShapedPage, parameters: RectifyParameters, clock: StageClock
) -> RectifyResult:
    """Where the view of a `page` lies in the photo; its image is one white pixel, shown as large as the view."""
    with clock.stage("framing"):
        view = judge_view(photo, page, parameters.crop, BRIEF)
        frame, stretch = view.frame, None
        if parameters.crop == "sheet":
            frame, stretch = fit_to_paper(frame, page, parameters.paper)
    blank = np.broadcast_to(np.full((1, 1, 3), 255, np.uint8), (frame.height, frame.width, 3))
    found, as_it_lies = sample_print(page), Orientation(0, False, None)
    judged = (view.print_kept, None)
    described = describe_page(page, blank, frame, as_it_lies, page.notices, clock, found, judged)
    return replace(described, stretch=stretch)


def flatten_page(
    photo: RgbImage,
    page: ShapedPage,
    parameters: RectifyParameters,
    ocr: OcrEngine | None,
    clock: StageClock,
) -> RectifyResult:
    """Flat view of a `page` whose shape is known: choose the frame, judge it, turn it upright, draw it."""
    with ViewDrawing(photo, parameters) as drawing:
        with clock.stage("framing"):
            view = best_view(photo, page, parameters, drawing.begin)
        page, analysis = view.page, view.page.analysis
        notices, orientation = [*page.notices, *view.notices], drawing.expected
        wished = parameters.upright and parameters.page_turn is None
        if wished and page.turn is not None:
            orientation = Orientation(page.turn, False, None)
        elif wished and page.corners is None:
            with clock.stage("orientation"):
                orientation, notice = orient_page(photo, analysis, view.frame, ocr)
            notices += [notice] if notice else []
        release_if_large(photo.nbytes)
        with clock.stage("remap"):
            flat, frame, stretch = drawing.finish(view, orientation)
    if parameters.illumination != "keep":  # looks of a scanner are made of it
        with clock.stage("illumination"):
            places = None if analysis is None else places_in_view(frame, page.characters)
            flat = normalize_illumination(flat, places)
    judged = (view.print_kept, view.error_percent)
    described = describe_page(page, flat, frame, orientation, notices, clock, sample_print(page), judged)
    plan = None
    if parameters.keep_photo:
        with clock.stage("plan"):
            plan = plan_views(photo, view, parameters)
    return replace(described, stretch=stretch, plan=plan)


def plan_views(photo: RgbImage, answered: JudgedView, parameters: RectifyParameters) -> ViewPlan:
    """How all views of the page of the `answered` one are drawn, before they are turned."""
    page, boxes, views = answered.page, sheet_print(answered.page), {}
    for crop in get_args(Crop):
        frame, paper = answered.frame, answered.paper
        if crop != parameters.crop:
            frame, paper, _ = frame_view(photo, page, crop, boxes)
        if crop == "sheet":
            frame, stretch = fit_to_paper(frame, page, parameters.paper)
            if stretch is not None and page.corners is not None:
                frame = end_at_corners(frame, page.corners, (frame.width, frame.height))
        text = None if page.analysis is None else page.characters
        views[crop] = plan_view(frame, paper, text)
    return ViewPlan(views)

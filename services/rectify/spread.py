"""Both pages of an opened book in one photo: two sheets, one camera."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from services.arrays import RgbImage, Vector
from services.contract.rectify import Origin, RectifyParameters
from services.errors import NoText
from services.geometry.focal_prior import FOCAL, FocalPrior
from services.geometry.photo_frame import PhotoFrame
from services.imaging.reduction import Halves
from services.notices import Notice
from services.ocr.engine import OcrEngine
from services.progress import progress_within
from services.rectify.analysis.focal_length import requested_prior
from services.rectify.analysis.outline_search import OutlineSearch
from services.rectify.analysis.page_analysis import analyse_spread
from services.rectify.page_search import shape_page
from services.rectify.parameter_checks import check_parameters
from services.rectify.pipeline import STAGE_BEGINS, flatten_page, rectify
from services.rectify.results import Orientation, RectifyResult
from services.rectify.shape_choice.shaped_page import ShapedPage
from services.rectify.stage_clock import StageClock
from services.rectify.view.orientation import LEAST_CONFIDENCE
from services.rectify.view.turned_image import apply_orientation

ORIENTATION_UNKNOWN = "orientation-unknown"
ONE_PAGE = Notice("one-page", "both pages were asked for, and the photo shows the text of one page.")


# How two pages share a camera. Deviations are of the focal length's logarithm.
LEAST_DEVIATION = 0.05
"""Least deviation of a focal length that is taken over: a fit does not know the errors of its model."""
AGREEMENT = 0.03
"""A page whose own focal length differs by more than this from the final one is fitted again."""


@dataclass(frozen=True, slots=True, eq=False)
class RectifiedPages:
    """Flat views in reading order, notices about all of them, and the stages that they shared."""

    pages: tuple[RectifyResult, ...]
    warnings: tuple[Notice, ...]
    timings_ms: dict[str, float]


def rectify_spread(
    photo: RgbImage,
    parameters: RectifyParameters,
    exif_focal_length_px: float | None = None,
    ocr: OcrEngine | None = None,
    origin: Origin = "photo",
) -> RectifiedPages:
    """Frontal flat views of both pages in `photo` (H, W, 3) RGB, the left one first; of one page if only one is found.

    Raises
    ------
    NoText
        When the photo shows too little printed text to see a page's shape, and no sheet's edges either.
    InvalidOption
        When `parameters` cannot be met (a region or focal length that the photo cannot have).
    """
    check_parameters(photo.shape[1], photo.shape[0], parameters)
    clock = StageClock(STAGE_BEGINS)
    with progress_within(0.0, 0.5):
        pages = _shape_pages(photo, parameters, exif_focal_length_px, clock)
    if len(pages) < 2:
        result = rectify(photo, parameters, exif_focal_length_px, ocr, origin)
        return RectifiedPages((result,), (ONE_PAGE,), clock.timings_ms)
    results = []
    for number, page in enumerate(pages):
        with progress_within(0.5 + 0.25 * number, 0.75 + 0.25 * number):
            results.append(flatten_page(photo, page, parameters, ocr, StageClock(STAGE_BEGINS)))
    results = [turn_like(result, results) for result in results]
    places = [page.characters.mean(axis=0) for page in pages]
    order = reading_order(places, _line_direction(results))
    return RectifiedPages(tuple(results[k] for k in order), (), clock.timings_ms)


def _shape_pages(
    photo: RgbImage, parameters: RectifyParameters, exif_focal_length_px: float | None, clock: StageClock
) -> list[ShapedPage]:
    """The main page and the facing one, or none if text does not show both. Two sheets have outlines of their own."""
    view = PhotoFrame(photo.shape[1], photo.shape[0])
    prior = requested_prior(view, parameters, exif_focal_length_px)
    try:
        analyses = analyse_spread(photo, parameters.region, clock=clock)
        if len(analyses) < 2:
            return []
        pages: list[ShapedPage] = []
        if analyses[0].window is not None:
            outlines = OutlineSearch(Halves.of(photo), view, prior)
            for analysis in analyses:
                with clock.stage("outline"):
                    outline = outlines.find(analysis)
                kind = parameters.kind
                pages.append(shape_page(analysis, view, prior, kind, clock, outline, read=outlines.read))
            return pages
        for analysis in analyses:
            pages.append(shape_page(analysis, view, prior, parameters.kind, clock))
            prior = shared_prior(pages[-1], prior)
        for k, analysis in enumerate(analyses):
            off = abs(_log_focal(pages[k]) - prior.log_focal)
            if prior.source == "estimated" and off > AGREEMENT:
                pages[k] = shape_page(analysis, view, prior, parameters.kind, clock)
    except NoText:
        return []
    return pages


def shared_prior(page: ShapedPage, prior: FocalPrior) -> FocalPrior:
    """Prior of the focal length after `page` was fitted with `prior`; `prior` if the page does not show it.

    The fitted value includes the prior already, so only their deviations are combined.
    """
    deviation = page.shape.log_focal_deviation
    if prior.source in ("given", "exif") or deviation >= FOCAL.seen_deviation:
        return prior
    joint = 1 / float(np.hypot(1 / deviation, 1 / prior.deviation))
    return FocalPrior(_log_focal(page), max(joint, LEAST_DEVIATION), "estimated")


def _log_focal(page: ShapedPage) -> float:
    return float(np.log(page.shape.focal))


def _line_direction(results: Sequence[RectifyResult]) -> Vector:
    """Direction (2,) in the photo in which lines are read, by the page whose orientation is most certain."""
    return _middle_axes(max(results, key=lambda result: result.orientation.confidence or 0.0))[0]


def _middle_axes(result: RectifyResult) -> tuple[Vector, Vector]:
    """Vectors (2,) in the photo from the left of the view to its right, and from its top to its bottom."""
    mesh = result.mesh
    row, column = mesh[mesh.shape[0] // 2], mesh[:, mesh.shape[1] // 2]
    return np.asarray(row[-1] - row[0]), np.asarray(column[-1] - column[0])


def turn_like(result: RectifyResult, results: Sequence[RectifyResult]) -> RectifyResult:
    """A page of unknown orientation, turned like the other page in the photo."""
    if ORIENTATION_UNKNOWN not in [notice.code for notice in result.warnings]:
        return result
    sure = max(results, key=lambda other: other.orientation.confidence or 0.0)
    if (sure.orientation.confidence or 0.0) < LEAST_CONFIDENCE:
        return result
    along, _ = _middle_axes(sure)
    row, column = _middle_axes(result)
    # Directions of its rows after 0 to 3 quarter turns clockwise.
    turns = int(np.argmax([way @ along / np.linalg.norm(way) for way in (row, -column, -row, column)]))
    return turn_result(result, turns)


def turn_result(result: RectifyResult, quarter_turns: int) -> RectifyResult:
    """The view turned clockwise, without the warning that its orientation is unknown."""
    turned = replace(
        result.orientation, rotation_deg=(result.orientation.rotation_deg + 90 * quarter_turns) % 360
    )
    return replace(
        result,
        image=apply_orientation(result.image, Orientation(90 * quarter_turns % 360, False, None)),
        mesh=np.ascontiguousarray(np.rot90(result.mesh, -quarter_turns)),
        corners=None if result.corners is None else np.roll(result.corners, quarter_turns, axis=0),
        orientation=turned,
        warnings=tuple(notice for notice in result.warnings if notice.code != ORIENTATION_UNKNOWN),
    )


def reading_order(places: Sequence[Vector], direction: Vector) -> list[int]:
    """Indices of pages whose text has its middle at `places` (2,) in the photo, along `direction` (2,) of the lines.

    So the left page is the first one, as in all scripts that are written from left to right.
    """
    return sorted(range(len(places)), key=lambda k: float(places[k] @ direction))


def page_timings(pages: RectifiedPages) -> dict[str, float]:
    """Milliseconds of each stage over all pages."""
    timings_ms = dict(pages.timings_ms)
    for page in pages.pages:
        for stage, spent in page.timings_ms.items():
            timings_ms[stage] = timings_ms.get(stage, 0.0) + spent
    return timings_ms

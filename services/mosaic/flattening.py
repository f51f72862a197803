"""Flattening of one photo, the first step of a mosaic."""

from dataclasses import dataclass, replace

import numpy as np

from services.arrays import Floats, GrayImage, Mask, RgbImage
from services.contract.cameras import CameraMemory
from services.contract.rectify import RectifyParameters
from services.geometry.focal_prior import FocalPrior, typical_focal_prior
from services.geometry.page_frame import DETAIL_PERCENTILE, Frame, resize_frame
from services.imaging.channels import luminance
from services.imaging.illumination import flatten_illumination
from services.imaging.node_grid import FAR_PX, MAX_REDUCTION, continuous_nodes, positive_between
from services.imaging.reduction import LARGEST_STEP, reduce_exactly, reduce_image
from services.mosaic.flat_photo import RIM_PX, FlatPhoto, SeenPage
from services.notices import Notice
from services.rectify.analysis.focal_length import requested_prior
from services.rectify.analysis.found_text import AnalysisParameters
from services.rectify.page_search import find_page
from services.rectify.shape_choice.shaped_page import ShapedPage
from services.rectify.stage_clock import StageClock
from services.rectify.view.drawing import draw_gray_view, photo_nodes
from services.rectify.view.flatness import Flatness, measure_flatness, not_flat
from services.rectify.view.judged_view import is_flatter
from services.rectify.view.paper_end import PaperEnd, find_paper_end
from services.rectify.view.print_kept import sheet_print
from services.sheet.plane.framing import FlatFrame
from services.texture_flow.text_identification import FEWEST_CHARACTERS, identify_text

VIEW_PIXELS = 5e6
"""Of the view in which a photo is registered. More do not improve it: block matches are accurate to a twentieth of
these pixels."""
TEXT_HEIGHT = 1 / 100
"""Text height as a share of the long side, if no text is found."""


def flatten_photo(
    index: int,
    photo: RgbImage,
    exif_focal_length_px: float | None,
    clock: StageClock,
    memory: CameraMemory | None = None,
) -> FlatPhoto:
    """Flat view of photo number `index` by rectification. Text lines are horizontal, but may be upside down.

    `memory` is what is remembered of the photo's camera.

    Raises
    ------
    NoText
        When the photo shows too little printed text to find the page's shape.
    """
    known = (
        RectifyParameters() if memory is None else RectifyParameters(camera=memory.name, cameras=(memory,))
    )
    page = find_page(photo, known, exif_focal_length_px, clock, needs_text=True)
    with clock.stage("framing"):
        seen = flattest_view(page)
        page = seen.page
        flat = view_photo(index, photo, seen.frame, page.text_height_px, float(len(page.characters)))
    prior = requested_prior(page.view, known, exif_focal_length_px)
    if (
        page.shape.focal_source != prior.source
    ):  # the page contradicts it, or showed it better than a typical one
        prior = typical_focal_prior()
    return replace(
        flat,
        notices=seen.notices,
        sheet=seen.end.around,
        error_percent=seen.error_percent,
        page=see_page(page, prior),
    )


def see_page(page: ShapedPage, prior: FocalPrior) -> SeenPage:
    """What later steps need of a `page` that has text; `prior` is that of the focal length."""
    assert page.analysis is not None
    return SeenPage(page.shape, page.analysis.evidence(page.view), prior)


@dataclass(frozen=True, slots=True, eq=False)
class FlatView:
    """A page by the shape that was chosen, the frame of its view, where its paper ends, and how flat the view is."""

    page: ShapedPage
    frame: Frame
    end: PaperEnd
    flatness: Flatness | None

    @property
    def error_percent(self) -> float | None:
        """RMS error of the view to expect, percent of its width; None where nothing shows it."""
        return None if self.flatness is None else self.flatness.error_percent

    @property
    def notices(self) -> tuple[Notice, ...]:
        """What a person should know of the shape and of the view."""
        notices = tuple(notice for notice in self.page.notices if notice.code == "curved-page")
        if self.flatness is None or self.flatness.passes:
            return notices
        return (*notices, not_flat(self.flatness.error_percent))


def flattest_view(page: ShapedPage) -> FlatView:
    """The view of `page`, or by its next shape where the first is not flat and the second clearly is flatter."""
    view = _judged(page)
    if view.flatness is not None and not view.flatness.passes:
        other = next(page.others, None)
        if other is not None:
            again = _judged(other)
            if is_flatter(other, again.flatness, page, view.flatness):
                return again
    return view


def _judged(page: ShapedPage) -> FlatView:
    """The view of `page`, not cut, and how flat it is."""
    end = find_paper_end(page, "sheet", sheet_print(page))
    frame = page.frame(end.reach, "sheet")
    return FlatView(page, frame, end, measure_flatness(page, frame))


def view_again(flat: FlatPhoto, frame: Frame) -> FlatPhoto:
    """The photo of `flat` in another view of its page, which is not the one that was found to be not flat."""
    assert flat.page is not None
    again = view_photo(flat.index, flat.photo, frame, flat.page.text_height_px, flat.weight, is_drawn=False)
    notices = tuple(notice for notice in flat.notices if notice.code != "not-flat")
    return replace(again, notices=notices, sheet=flat.sheet, page=flat.page)


def take_as_flat(index: int, photo: RgbImage, clock: StageClock) -> FlatPhoto:
    """Photo number `index` as its own flat view: for scans, and for photos without text."""
    height, width = photo.shape[:2]
    with clock.stage("text"):
        gray = luminance(photo)
        factor = min(1.0, AnalysisParameters().long_side_px / max(width, height))
        text = identify_text(flatten_illumination(reduce_image(gray, factor)))
        characters = len(text.components.sizes)
    measured = text.text_height_px / factor if characters >= FEWEST_CHARACTERS else None
    text_height_px = measured or TEXT_HEIGHT * max(width, height)
    with clock.stage("framing"):
        return view_photo(
            index, photo, FlatFrame(np.eye(3), width, height), text_height_px, float(characters)
        )


def view_unchanged(flat: FlatPhoto) -> FlatPhoto:
    """The photo of `flat` as its own view."""
    height, width = flat.photo.shape[:2]
    as_it_is = FlatFrame(np.eye(3), width, height)
    own_px = flat.text_height_px / flat.native_scale
    text_height_px = own_px if flat.page is None else flat.page.text_height_px
    return view_photo(flat.index, flat.photo, as_it_is, text_height_px, flat.weight)


def view_photo(
    index: int, photo: RgbImage, frame: Frame, text_height_px: float, weight: float, *, is_drawn: bool = True
) -> FlatPhoto:
    """View of `photo` through `frame`, reduced to at most `VIEW_PIXELS`; `text_height_px` is in photo pixels.

    What has been registered in another view `is_drawn` there.
    """
    frame = resize_frame(frame, min(1.0, float(np.sqrt(VIEW_PIXELS / (frame.width * frame.height)))))
    nodes = photo_nodes(frame)
    shown = _shown(photo, frame, nodes)
    scales = _photo_px_per_flat_px(frame, shown)
    reduction = float(np.percentile(scales, DETAIL_PERCENTILE))
    usual = float(np.median(scales))
    flat_height_px = text_height_px / usual
    gray: GrayImage = np.zeros((0, 0), np.uint8)
    if is_drawn:
        factor = 1.0 / usual if usual > LARGEST_STEP else 1.0
        view = draw_gray_view(*reduce_exactly(luminance(photo), factor), frame, nodes=nodes)
        gray = flatten_illumination(view, flat_height_px)
    return FlatPhoto(
        index,
        photo,
        frame,
        gray,
        shown,
        flat_height_px,
        1.0 / reduction,
        weight,
    )


def _shown(photo: RgbImage, frame: Frame, nodes: Floats) -> Mask:
    """Where the view shows the photo without its border; `nodes` are the view's `photo_nodes`."""
    middle = (np.array([photo.shape[1], photo.shape[0]]) - 1) / 2
    within = middle - RIM_PX - np.abs(nodes - middle)
    within[~continuous_nodes(nodes, MAX_REDUCTION)] = -FAR_PX
    return positive_between(within, frame.width, frame.height)


def _photo_px_per_flat_px(frame: Frame, shown: Mask, step: int = 40) -> Floats:
    """Photo pixels per flat pixel (N,), the square root of the map's area ratio, on a grid over the shown part."""
    x, y = np.meshgrid(np.linspace(0, frame.width - 1, step), np.linspace(0, frame.height - 1, step))
    grid = np.stack([x, y], axis=-1).reshape(-1, 2)
    at = np.round(grid).astype(int)
    grid = grid[shown[at[:, 1], at[:, 0]]]
    if len(grid) == 0:
        return np.ones(1)
    here = frame.to_photo(grid)
    right, down = (frame.to_photo(grid + offset) - here for offset in ([0.5, 0.0], [0.0, 0.5]))
    area = 4.0 * np.abs(right[:, 0] * down[:, 1] - right[:, 1] * down[:, 0])
    area = area[np.isfinite(area) & (area > 0)]
    return np.sqrt(area) if len(area) else np.ones(1)

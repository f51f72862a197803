"""A view that was judged before it is drawn: its frame, the print that it keeps, and how flat it is.

A view that is not flat is tried again with the next shape, once.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from services.arrays import Floats, Points, RgbImage
from services.contract.rectify import Crop, RectifyParameters
from services.geometry.page_frame import Frame, restore_detail
from services.notices import Notice
from services.rectify.effort import WHOLE, Effort
from services.rectify.shape_choice.shaped_page import ShapedPage
from services.rectify.view.cut_letters import count_cut_letters
from services.rectify.view.flatness import Flatness, measure_flatness, not_flat
from services.rectify.view.held_corners import end_at_corners, hold_corners
from services.rectify.view.paper_end import PaperEnd, find_paper_end, is_believed
from services.rectify.view.print_beyond import NO_BOXES, light_print_beyond
from services.rectify.view.print_kept import (
    PRINT_CUT,
    grow_to_print,
    kept_print,
    print_notices,
    share_kept,
    sheet_print,
)
from services.rectify.view.sheet_cut import cut_view

CLEARLY_FLATTER = 0.7
"""The next shape is taken where its error is below this share of the first one's."""

STRAIGHT_LINES = 0.06
"""RMS deviation of text lines from level ones, in text heights, that is hardly seen: flat pages have 0.04. The next
shape may not leave lines less straight than that, unless the first one does."""


MOST_BEYOND = 0.1
"""Share of the sheet that a view may not show: the next shape that shows it is taken. Of 315 photos one had more, with
the lower half of a figure, all others up to 0.03."""
SHEET_STEPS = 16
"""Places along each axis at which that is asked."""

Framed = Callable[[ShapedPage, Frame, Points | None], object]
"""Takes a page, the frame of its view and its paper, as of `JudgedView`."""


@dataclass(frozen=True, slots=True, eq=False)
class JudgedView:
    """The view of `page` through `frame`, text lines level.

    It is drawn white outside of the polygon `paper` (M, 2), photo pixels, where that is not None. `print_kept` (0-1) is
    None without text, `flatness` where nothing shows it.
    """

    page: ShapedPage
    frame: Frame
    paper: Points | None
    flatness: Flatness | None
    print_kept: float | None
    notices: tuple[Notice, ...]
    beyond: Floats = field(default_factory=lambda: NO_BOXES)
    """Boxes (N, 4, 2) of light print beyond the paper, photo pixels."""

    @property
    def error_percent(self) -> float | None:
        """Error of the mesh to expect; see `Flatness`."""
        return None if self.flatness is None else self.flatness.error_percent


def best_view(
    photo: RgbImage, page: ShapedPage, parameters: RectifyParameters, framed: Framed | None = None
) -> JudgedView:
    """The view of `page`, or that by its next shape where the first is not flat and the second clearly is flatter.

    `framed` receives the first one before it is measured: mostly it is the one.
    """
    view = judge_view(photo, page, parameters.crop, framed=framed)
    if parameters.crop == "sheet" and share_beyond(view) > MOST_BEYOND:
        # The map of a bent sheet may end with its text; print may be no text.
        shown = (judge_view(photo, other, parameters.crop) for other in page.others)
        view = next((other for other in shown if share_beyond(other) <= MOST_BEYOND), view)
    if view.flatness is None or view.flatness.passes:
        return view
    other = next(page.others, None) if view.page is page else None
    if other is not None:
        again = judge_view(photo, other, parameters.crop, known=view.beyond)
        loses_print = PRINT_CUT in again.notices and PRINT_CUT not in view.notices
        if not loses_print and is_flatter(other, again.flatness, page, view.flatness):
            view = again
    if view.flatness is None or view.flatness.passes:
        return view
    return replace(view, notices=(*view.notices, not_flat(view.flatness.shown_percent)))


def share_beyond(view: JudgedView) -> float:
    """Share of the sheet within a believed outline, 0-1, that a view does not show; 0 where none is believed."""
    page = view.page
    if page.outline is None or page.corners is not None or not is_believed(page.outline, page.characters):
        return 0.0
    low, high = page.outline.polygon.min(axis=0), page.outline.polygon.max(axis=0)
    ticks = (np.arange(SHEET_STEPS) + 0.5) / SHEET_STEPS
    places = low + np.stack(np.meshgrid(ticks, ticks), axis=-1).reshape(-1, 2) * (high - low)
    at = view.frame.to_flat(places[page.outline.holds(places)])
    with np.errstate(invalid="ignore"):
        seen = np.all((at >= 0) & (at <= [view.frame.width, view.frame.height]), axis=1)
    return 1.0 - float(np.mean(seen)) if len(at) else 0.0


def is_flatter(page: ShapedPage, flatness: Flatness | None, before: ShapedPage, known: Flatness) -> bool:
    """Whether the view of `page` is clearly flatter than the one `before`, whose flatness is `known`.

    It has a smaller error to expect, and lines that are as straight or straight enough. A bent sheet was chosen for
    straighter lines, rules among them, which are not traced again here: a plane in its place must straighten them.
    """
    if flatness is None or flatness.shown_percent >= CLEARLY_FLATTER * known.shown_percent:
        return False
    found, first = flatness.line_straightness or 0.0, known.line_straightness or 0.0
    if before.shape.kind == "curved" and page.shape.kind == "planar":
        return flatness.line_straightness is not None and found < CLEARLY_FLATTER * first
    return found <= max(first, STRAIGHT_LINES)


def judge_view(
    photo: RgbImage,
    page: ShapedPage,
    crop: Crop,
    effort: Effort = WHOLE,
    framed: Framed | None = None,
    known: Floats = NO_BOXES,
) -> JudgedView:
    """Frame the view of `page` in `photo` (H, W, 3) so that it keeps its print, and measure it.

    By a brief `effort` it is cut at the outline alone, and how flat it is is not measured. `framed` receives the frame,
    and the paper, as soon as they are known. `known` is light print beyond the paper that another shape has shown: the
    map of a bent sheet may end before it.
    """
    boxes = sheet_print(page)
    frame, white, beyond = frame_view(photo, page, crop, boxes, effort, known)
    boxes = np.concatenate([boxes, beyond])
    if framed is not None:
        framed(page, frame, white)
    kept = kept_print(frame, boxes, white)
    # Of a printed page nothing is cut by a camera.
    cut_letters = 0 if effort.is_brief or page.turn is not None else count_cut_letters(page, boxes)
    return JudgedView(
        page,
        frame,
        white,
        None if effort.is_brief else measure_flatness(page, frame),
        share_kept(boxes, kept),
        print_notices(kept, cut_letters),
        beyond,
    )


def frame_view(
    photo: RgbImage,
    page: ShapedPage,
    crop: Crop,
    boxes: Floats,
    effort: Effort = WHOLE,
    known: Floats = NO_BOXES,
) -> tuple[Frame, Points | None, Floats]:
    """Frame, paper and light print beyond it of the view of `page`, as of `JudgedView`.

    `boxes` are its `sheet_print`, `known` is light print that is known already.
    """
    end = find_paper_end(page, crop, boxes)
    beyond = known
    if crop == "sheet" and not effort.is_brief and not len(known):
        beyond = light_print_beyond(photo, page, end)
    if len(beyond):
        boxes = np.concatenate([boxes, beyond])
        end = PaperEnd(around=end.around)
    frame = page.frame(end.reach, crop)
    pixels = photo.shape[0] * photo.shape[1]
    if page.corners is not None:
        frame = _between_corners(frame, page, page.corners, crop, pixels)
    else:
        if crop == "sheet":
            frame = cut_view(photo, frame, page, end, effort, beyond.mean(axis=1))
        frame = grow_to_print(frame, boxes, page.text_height_px, end.white)
        if not effort.is_brief:
            frame = restore_detail(frame, pixels, page.characters, page.text_height_px)
    return frame, end.white, beyond


def _between_corners(frame: Frame, page: ShapedPage, corners: Points, crop: Crop, photo_pixels: int) -> Frame:
    """`frame` with the given `corners` (4, 2) of its page: they are its own if it is cut at the sheet."""
    held = end_at_corners if crop == "sheet" else hold_corners
    frame = held(frame, corners)
    finer = restore_detail(frame, photo_pixels, page.characters, page.text_height_px)
    return frame if finer is frame else held(finer, corners)

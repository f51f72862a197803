"""The page in a photo: by its text, by the sides of its sheet, or by what is straight on it."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from services.arrays import Points, RgbImage
from services.contract.rectify import Origin, PageKind, RectifyParameters, TypesetPage
from services.errors import NoText
from services.geometry.focal_prior import FocalPrior
from services.geometry.photo_frame import PhotoFrame
from services.heap import release_if_large
from services.imaging.drawn_edges import is_drawn
from services.imaging.reduction import Halves
from services.notices import Notice
from services.rectify.analysis.focal_length import requested_prior
from services.rectify.analysis.found_text import AnalysisParameters, FoundText, find_text
from services.rectify.analysis.outline_search import OutlineSearch
from services.rectify.analysis.page_analysis import PageAnalysis, analyse_briefly, analyse_photo
from services.rectify.analysis.photo_border import find_cut_borders, leave_out_borders
from services.rectify.analysis.text_beside import text_beside
from services.rectify.effort import WHOLE, Effort
from services.rectify.shape_choice.brief_choice import brief_shape, sheet_between_sides
from services.rectify.shape_choice.choice import rank_shapes
from services.rectify.shape_choice.flat_hypothesis import (
    blank_flat_page,
    flat_page,
    may_be_flat,
    sheet_in_view,
)
from services.rectify.shape_choice.given_corners import page_between
from services.rectify.shape_choice.principal_point import find_principal_point
from services.rectify.shape_choice.shaped_page import ShapedPage
from services.rectify.shape_choice.text_check import LinesAcross, check_text
from services.rectify.shape_choice.textless import find_textless_page
from services.rectify.stage_clock import StageClock
from services.rectify.view.paper_end import is_believed
from services.sheet.outline.given_corners import outline_between
from services.sheet.outline.results import SheetOutline
from services.sheet.plane.outline_plane import SheetSides, read_sides
from services.sheet.shape import PageShape
from services.texture_flow.major import MajorFlowParameters

FACING_PAGE = Notice(
    "facing-page", "text of a facing page was left out; send region, a polygon round it, to choose another."
)
OTHER_SHEET = Notice(
    "facing-page",
    "another sheet lies beside this one and was left out; ask for pages=both, or send region, a polygon round it.",
)


def find_page(
    photo: RgbImage,
    parameters: RectifyParameters,
    exif_focal_length_px: float | None,
    clock: StageClock,
    origin: Origin = "photo",
    *,
    needs_text: bool = False,
    effort: Effort = WHOLE,
) -> ShapedPage:
    """The page in `photo` by its text and the outline of its sheet, or by one of them where the other is not seen.

    With `needs_text` a page without text is refused. By a brief `effort` the sides of the sheet decide where they are
    certain, and the directions of the text are measured where they are not.

    Raises
    ------
    NoText
        When neither text nor a sheet's edges nor straight print shows the page's shape, or a region has no text.
    """
    view = PhotoFrame(photo.shape[1], photo.shape[0])
    prior = requested_prior(view, parameters, exif_focal_length_px)
    if parameters.page_corners is not None:
        return _find_page_between(
            Halves(photo), np.array(parameters.page_corners), view, prior, parameters.kind, clock
        )
    search = _Search(photo, view, prior, parameters, origin, effort, clock)
    try:
        page = search.page_by_text()
        return replace(page, notices=(*page.notices, OTHER_SHEET)) if search.other_sheet else page
    except NoText as refusal:
        # A region is one of text, and the sheet beside it is not asked.
        if needs_text or parameters.region is not None:
            raise
        return search.page_without_text(refusal)
    finally:
        search.outlines.end()


@dataclass(slots=True, eq=False)
class _Search:
    """What is known of a photo while its page is sought: an outline that was sought once is not sought again."""

    photo: RgbImage
    view: PhotoFrame
    prior: FocalPrior
    parameters: RectifyParameters
    origin: Origin
    effort: Effort
    clock: StageClock
    halves: Halves = field(init=False)
    outlines: OutlineSearch = field(init=False)
    outline: SheetOutline | None = None
    seen: FoundText | PageAnalysis | None = None
    sought: bool = False
    other_sheet: bool = False

    def __post_init__(self) -> None:
        self.halves = Halves(self.photo)
        self.outlines = OutlineSearch(self.halves, self.view, self.prior, self.effort.outline)

    def seek_outline(self, seen: FoundText | PageAnalysis | None) -> None:
        """Look for the outline of the sheet on which the text is that was `seen`."""
        with self.clock.stage("outline"):
            self.outline = self.outlines.find(seen)
            self.sought, self.seen = True, seen

    def page_by_text(self) -> ShapedPage:
        """The page that text shows, and the sides of its sheet. Raises `NoText`."""
        region = self.parameters.region
        if self.effort.is_brief:
            with self.clock.stage("text"):
                text = find_text(self.halves, region, self.effort.analysis)
            self.other_sheet = text.window is not None
            if region is None:
                self.seek_outline(text)
            page = self._page_between_sides(text)
            if page is not None:
                return page
            in_region = region is not None
            analysis = analyse_briefly(
                self.halves, text, self.effort.analysis, self.clock, in_region=in_region
            )
        else:
            has_outline = region is None and not isinstance(self.origin, TypesetPage)
            if has_outline:
                self.outlines.prepare()
            begin = self.outlines.begin if has_outline else None
            analysis = analyse_photo(self.halves, region, clock=self.clock, on_text=begin)
            release_if_large(self.photo.nbytes)
            self.other_sheet = analysis.window is not None
            if has_outline and not analysis.facing_page:
                self.seek_outline(analysis)
            beside = text_beside(analysis, self.outline)
            if self.outline is not None and beside == "texture":
                on_sheet = tuple((float(x), float(y)) for x, y in self.outline.polygon)
                analysis = analyse_photo(self.halves, on_sheet, clock=self.clock)
            elif beside == "print":
                self.outline = None
        try:
            return self._page_of(analysis)
        except LinesAcross as found:
            crossing = AnalysisParameters(major=MajorFlowParameters(barred_rad=found.taken_rad))
            return self._page_of(analyse_photo(self.halves, region, crossing, self.clock))

    def _page_of(self, analysis: PageAnalysis) -> ShapedPage:
        """The page whose text was analysed. Raises `NoText`."""
        # The outline of an opened book is not that of a single page.
        outline = None if analysis.facing_page else self.outline
        if may_be_flat(self.parameters):
            with self.clock.stage("shape"):
                flat = flat_page(self.halves, analysis, outline, self.view, self.prior, origin=self.origin)
            if flat is not None:
                return flat
        read = self.outlines.read
        kind = self.parameters.kind
        page = shape_page(analysis, self.view, self.prior, kind, self.clock, outline, self.effort, read)
        return replace(page, notices=(*page.notices, FACING_PAGE)) if analysis.facing_page else page

    def page_without_text(self, refusal: NoText) -> ShapedPage:
        """The page that its sheet's sides show, or straight print. Raises `NoText`."""
        if self.sought and self.effort.is_brief:
            raise refusal  # its sides show no page, its text shows no direction
        if not self.sought:
            self.seek_outline(None)
        elif (
            self.seen is not None and self.outline is not None and not all(s.seen for s in self.outline.sides)
        ):
            with self.clock.stage("outline"):
                self.outline = self.outlines.find_in_view(self.seen)
        page = self._page_between_sides(None) if self.effort.is_brief else None
        with self.clock.stage("shape"):
            if page is None and may_be_flat(self.parameters):
                page = blank_flat_page(self.halves, self.outline, self.view, self.prior, origin=self.origin)
            if page is not None:
                return page
            if self.effort.is_brief:
                raise refusal
            return find_textless_page(self.photo, self.outline, self.view, self.prior, refusal)

    def _page_between_sides(self, text: FoundText | None) -> ShapedPage | None:
        """The sheet by its four sides alone; None where they are not certain."""
        characters = np.zeros((0, 2)) if text is None else text.characters
        with self.clock.stage("shape"):
            in_view = sheet_in_view(self.outline, self.view, origin=self.origin)
            if not in_view or not is_believed(self.outline, characters) or is_drawn(self.photo):
                return None
            page = sheet_between_sides(self.outline, self.view, self.prior, self.parameters.kind, characters)
        return None if page is None else replace(page, text=text)


def _find_page_between(
    halves: Halves,
    corners: Points,
    view: PhotoFrame,
    prior: FocalPrior,
    kind: PageKind,
    clock: StageClock,
) -> ShapedPage:
    """The page between its given `corners` (4, 2), clockwise from its top left; its text refines the inside."""
    with clock.stage("outline"):
        outline = outline_between(halves, corners)
    on_sheet = tuple((float(x), float(y)) for x, y in outline.polygon)
    page = None
    try:
        analysis = analyse_photo(halves, on_sheet, clock=clock)
        page = shape_page(analysis, view, prior, kind, clock, outline)
    except NoText:
        pass  # the sides show its shape
    with clock.stage("shape"):
        return page_between(page, corners, outline, view, prior, kind)


def shape_page(
    analysis: PageAnalysis,
    view: PhotoFrame,
    prior: FocalPrior,
    kind: PageKind,
    clock: StageClock,
    outline: SheetOutline | None = None,
    effort: Effort = WHOLE,
    read: Callable[[SheetOutline | None], SheetSides | None] | None = None,
) -> ShapedPage:
    """The shape of a page whose text and flows are known; `prior` is that of the focal length.

    `read` reads the sides of an outline in `view`, which may be known.

    Raises
    ------
    NoText
        When most of its ink is no text, and no sheet's edges show its shape either.
    """
    with clock.stage("shape"):
        if effort.is_brief:
            evidence = analysis.evidence(view)
            shape = brief_shape(evidence, prior, kind)
            return ShapedPage(view, shape, shape.notices, outline, analysis, evidence.vanishing_points)
        if outline is not None:
            cut = find_cut_borders(
                analysis.characters, analysis.text_height_px, view.width, view.height, outline.polygon
            )
            outline = leave_out_borders(outline, cut, view.width, view.height) if cut else outline
        sheet = read_sides(outline, view, prior) if read is None else read(outline)
        view = view if sheet is None else sheet.view
        evidence = analysis.evidence(view)
        ranked = rank_shapes(evidence, prior, kind, outline, sheet)
        shape = next(ranked)
        notices = shape.notices
        moved = find_principal_point(evidence, prior, shape)
        if moved is not None:  # a cropped photo: repeat all relative to the principal point that was found
            sheet = read_sides(outline, moved.evidence.view, moved.prior)
            ranked_again = rank_shapes(moved.evidence, moved.prior, kind, outline, sheet)
            again = next(ranked_again)
            if type(again) is type(shape):
                shape, ranked, evidence = again, ranked_again, moved.evidence
                notices = (*moved.notices, *again.notices)
        check_text(analysis, evidence, shape, outline)
    page = ShapedPage(evidence.view, shape, notices, outline, analysis, evidence.vanishing_points)
    return replace(page, others=_other_shapes(page, ranked, kind))


def _other_shapes(page: ShapedPage, ranked: Iterator[PageShape], kind: PageKind) -> Iterator[ShapedPage]:
    """`page` by the `ranked` shapes that come after its own, of the `kind` that was asked for."""
    kept = tuple(notice for notice in page.notices if notice not in page.shape.notices)
    for shape in ranked:
        if kind in ("auto", shape.kind):
            yield replace(page, shape=shape, notices=(*kept, *shape.notices))

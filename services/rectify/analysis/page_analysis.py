"""The evidence in one photo: its text and both texture flows, measured on reduced images."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import cv2
import numpy as np
from scipy.spatial import cKDTree

from services.arrays import GrayImage, Mask, Points, RgbImage
from services.errors import NoText
from services.geometry.homographies import from_resized
from services.geometry.photo_frame import PhotoFrame
from services.imaging.channels import luminance
from services.imaging.illumination import divide_by_light, reduced_light
from services.imaging.paper import Paper, Window
from services.imaging.photo_part import PhotoPart, cut_part
from services.imaging.reduction import Halves, reduce_image
from services.rectify.analysis.found_text import (
    MIN_FLOW_SAMPLES,
    STROKE_TEXT_HEIGHT_PX,
    AnalysisParameters,
    FoundText,
    characters_in_photo,
    find_text,
)
from services.rectify.analysis.page_choice import PageChoice, choose_page
from services.rectify.stage_clock import StageClock
from services.sheet.evidence import PageEvidence
from services.sheet.tracing.page_text import TracedText
from services.side_by_side import SideStep
from services.texture_flow.field import FlowField, FlowSamples, angle_difference, move_field, resize_field
from services.texture_flow.leaning_type import upright_type
from services.texture_flow.major import MajorFlow, detect_coarse_flow, refine_major_flow
from services.texture_flow.minor import Edges, MinorFlow, detect_edges, estimate_minor_flow
from services.texture_flow.text_identification import (
    FEWEST_CHARACTERS,
    IdentifiedText,
    TextComponents,
    keep_characters,
)
from services.texture_flow.vanishing_points import estimate_vanishing_points

PICTURE_SHARE = 0.8
"""On a page of dark print a smaller share of the ink is rejected as no text. On pictures, and on light print in a dark
photo, a larger share is."""

GROUND_TEXT_HEIGHTS = 1.5
"""Of the ground round a character, to each side."""
BARE_PAPER = 220
"""Least gray level of bare paper in even light, which is 255 but for grain and shadows."""

NO_DIRECTION = "the characters that were found do not form text lines of a common direction."
MARGIN_TEXT_HEIGHTS = 5.0
"""Round the text, in the image for strokes: nearly a block of the minor flow."""
FEW_STROKES = 4
"""With fewer samples the minor flow is assumed to be at right angles to the major flow,"""
UNSEEN_WEIGHT = 0.05
"""and gets this share of its weight."""

_Flows = tuple[MajorFlow, MinorFlow | None, PhotoPart]


@dataclass(frozen=True, slots=True, eq=False)
class PageAnalysis:
    """Text and flows of one page in a photo; samples and fields are in pixels of the photo.

    A photo of light print on dark paper is analysed as a negative; then `reduced` and `strokes` are negatives.
    `text` is in the frame of `reduced` (H, W), the flat-fielded photo resized by `factor`; the minor flow was measured
    on `strokes`. `minor` is None where no strokes were found.
    """

    paper: Paper
    reduced: GrayImage
    factor: float
    strokes: PhotoPart
    text: IdentifiedText
    printed: TextComponents
    """All that looks like characters, in the frame of `reduced`: `text` is what lies on the page's paper."""
    major: FlowSamples
    major_field: FlowField
    minor: FlowSamples | None
    minor_field: FlowField | None
    positive: GrayImage | None = None
    """As `reduced`, of the photo itself where that is a negative: print that is no text may be dark in it."""
    gutter: Points | None = None
    """Line (N, 2) beyond which only a facing page lies, if one was seen; photo pixels, from end to end of the photo."""
    window: Window | None = None
    """Where text of another sheet was left out: the part of the photo that shows this one, as `Sheet.window`."""

    @property
    def facing_page(self) -> bool:
        """Whether text of a facing page was found and left out."""
        return self.gutter is not None

    @property
    def characters(self) -> Points:
        """Centres of the characters (N, 2) in photo pixels."""
        return characters_in_photo(self.text, self.factor)

    @property
    def text_height_px(self) -> float:
        """Typical character size in photo pixels."""
        return self.text.text_height_px / self.factor

    def evidence(self, view: PhotoFrame) -> PageEvidence:
        """Observations that a shape is fitted to, in the centred unit coordinates of `view`."""
        text = TracedText(
            self.reduced,
            self.text.ink,
            self.text.area,
            self.factor,
            self.characters,
            self.text_height_px,
            self.positive,
        )
        major = self.major.centred(view)
        if self.minor is not None and len(self.minor) >= FEW_STROKES:
            minor = self.minor.centred(view)
        else:
            minor = FlowSamples(major.points, major.angles + np.pi / 2, UNSEEN_WEIGHT * major.weights)
        points = estimate_vanishing_points(major, minor)
        return PageEvidence(text, view, major, minor, points, has_strokes=self.minor is not None)


def analyse_photo(
    photo: RgbImage | Halves,
    region: tuple[tuple[float, float], ...] | None = None,
    parameters: AnalysisParameters | None = None,
    clock: StageClock | None = None,
    on_text: Callable[[FoundText], object] | None = None,
) -> PageAnalysis:
    """Find the text and both texture flows in a photo.

    Parameters
    ----------
    photo
        (H, W, 3) RGB.
    region
        Polygon in photo pixels; text outside of it is ignored.
    parameters
        Working sizes.
    clock
        Receives the CPU time of the stages `text` and `texture_flow`.
    on_text
        Receives the dark print as soon as it is found, before its directions are measured and the main page is chosen.

    Returns
    -------
    PageAnalysis
        Text, major flow and minor flow (2.3) of the main page.

    Raises
    ------
    NoText
        When there are too few characters, or their lines show no common direction.
    """
    return _analyse(photo, region, parameters, clock, on_text, is_spread=False)[0]


def analyse_spread(
    photo: RgbImage | Halves,
    region: tuple[tuple[float, float], ...] | None = None,
    clock: StageClock | None = None,
) -> tuple[PageAnalysis, ...]:
    """Analyse a photo of an opened book: the main page, and the facing page if its text shows its shape.

    Raises
    ------
    NoText
        When there are too few characters on the main page, or their lines show no common direction.
    """
    return _analyse(photo, region, None, clock, None, is_spread=True)


def _analyse(
    photo: RgbImage | Halves,
    region: tuple[tuple[float, float], ...] | None,
    parameters: AnalysisParameters | None,
    clock: StageClock | None,
    on_text: Callable[[FoundText], object] | None,
    *,
    is_spread: bool,
) -> tuple[PageAnalysis, ...]:
    p = parameters or AnalysisParameters()
    clock = clock or StageClock()
    found: list[tuple[PageAnalysis, ...]] = []
    refusals: list[NoText] = []
    # The steps expect dark print on light paper; in the negative, light print on dark paper is that.
    for negative in (False, True):
        try:
            halves = Halves.of(photo)
            seen = Halves(np.asarray(255 - halves.image, np.uint8)) if negative else halves
            tell = None if negative else on_text
            pages = _analyse_dark_print(seen, region, p, clock, tell, is_spread=is_spread)
            found.append(tuple(_with_positive(page, photo) for page in pages) if negative else pages)
        except NoText as refusal:
            refusals.append(refusal)
        if found and found[0][0].text.rejected_fraction <= PICTURE_SHARE:
            return found[0]
    if not found:
        raise refusals[0]
    return max(found, key=lambda pages: _ground_share(pages[0]))


def _ground_share(page: PageAnalysis) -> float:
    """How much of the ground round the characters is bare paper, 0 to 1.

    Print is little ink on much ground. In the negative of dark print the gaps in and between letters are taken for
    characters, and the ground round them is neither paper nor even.
    """
    height, width = page.reduced.shape
    x, y = np.clip(np.rint(page.text.components.centres).astype(np.intp), 0, (width - 1, height - 1)).T
    near = np.zeros((height, width), np.uint8)
    near[y, x] = 1
    window = 2 * round(GROUND_TEXT_HEIGHTS * page.text.text_height_px) + 1
    around = cv2.dilate(near, np.ones((window, window), np.uint8)).astype(np.bool_)
    return float(np.mean(page.reduced[around] >= BARE_PAPER))


def _with_positive(page: PageAnalysis, photo: RgbImage | Halves) -> PageAnalysis:
    """The page, which was found in the negative of `photo`, with the flat-fielded photo itself."""
    seen = reduce_image(luminance(Halves.of(photo).image), page.factor)
    return replace(page, positive=divide_by_light(seen, reduced_light(seen)))


def _analyse_dark_print(
    photo: RgbImage | Halves,
    region: tuple[tuple[float, float], ...] | None,
    p: AnalysisParameters,
    clock: StageClock,
    on_text: Callable[[FoundText], object] | None,
    *,
    is_spread: bool,
) -> tuple[PageAnalysis, ...]:
    """`analyse_photo` or `analyse_spread` for dark print on light paper."""
    with clock.stage("text"):
        seen = find_text(photo, region, p)
    factor, text = seen.factor, seen.text
    with clock.stage("texture_flow"):
        flows = _measure_flows(seen, text, p, on_text)
    facing, found = None, None
    if region is None or is_spread:
        with clock.stage("text"):
            found = choose_page(
                photo,
                seen.characters,
                seen.boxes,
                seen.text_height_px,
                *_in_photo(flows, factor),
                seen.paper,
                is_spread=is_spread and seen.beside is None,
            )
            # Most of what was left out is text, so the share of other ink is not computed again.
            if is_spread and found.facing.sum() >= FEWEST_CHARACTERS:
                facing = replace(
                    keep_characters(text, found.facing), rejected_fraction=text.rejected_fraction
                )
            text = replace(keep_characters(text, found.kept), rejected_fraction=text.rejected_fraction)
        if not found.kept.all():
            with clock.stage("texture_flow"):
                flows = _measure_flows(seen, text, p)
    if len(flows[0].samples) < MIN_FLOW_SAMPLES:
        raise NoText(NO_DIRECTION)
    pages = [_analysis_of(seen, text, flows, found)]
    if facing is not None:
        with clock.stage("texture_flow"):
            flows = _measure_flows(seen, facing, p)
        if len(flows[0].samples) >= MIN_FLOW_SAMPLES:
            pages.append(_analysis_of(seen, facing, flows, found))
    if is_spread and facing is None and seen.beside is not None:
        with clock.stage("texture_flow"):
            flows = _measure_flows(seen, seen.beside, p)
        if len(flows[0].samples) >= MIN_FLOW_SAMPLES:
            pages.append(replace(_analysis_of(seen, seen.beside, flows, None), window=seen.windows[1]))
    return tuple(pages)


def analyse_briefly(
    photo: Halves, found: FoundText, p: AnalysisParameters, clock: StageClock, *, in_region: bool
) -> PageAnalysis:
    """The main page by text that was `found`; all of it is the page's where it was sought `in_region`.

    What was measured beside a character of the page is the page's: its directions are not measured again.

    Raises
    ------
    NoText
        When its lines show no common direction.
    """
    with clock.stage("texture_flow"):
        flows = _measure_flows(found, found.text, p)
        if len(flows[0].samples) < MIN_FLOW_SAMPLES:
            raise NoText(NO_DIRECTION)
        page = _analysis_of(found, found.text, flows, None)
    if in_region:
        return page
    with clock.stage("text"):
        choice = choose_page(
            photo,
            found.characters,
            found.boxes,
            found.text_height_px,
            page.major,
            page.minor,
            found.paper,
        )
        if not choice.facing_page:
            return page
        nearest = cKDTree(found.characters)

        def own(samples: FlowSamples) -> FlowSamples:
            return samples.select(choice.kept[nearest.query(samples.points)[1]])

        return replace(
            page,
            text=keep_characters(page.text, choice.kept),
            major=own(page.major),
            minor=None if page.minor is None else own(page.minor),
            gutter=choice.gutter_beside(found.characters[choice.kept]),
        )


def _analysis_of(
    seen: FoundText,
    text: IdentifiedText,
    flows: _Flows,
    choice: PageChoice | None,
) -> PageAnalysis:
    """Results for one page, in pixels of the photo."""
    (major, minor, strokes), factor = flows, seen.factor
    along, across = _in_photo(flows, factor)
    gutter = None if choice is None else choice.gutter_beside(characters_in_photo(text, factor))
    return PageAnalysis(
        seen.paper,
        seen.reduced,
        factor,
        strokes,
        text,
        seen.printed,
        along,
        resize_field(major.field, 1 / factor),
        across,
        None if minor is None else move_field(resize_field(minor.field, 1 / strokes.factor), strokes.origin),
        gutter=gutter,
        window=seen.window,
    )


def _measure_flows(
    seen: FoundText,
    text: IdentifiedText,
    p: AnalysisParameters,
    on_begin: Callable[[FoundText], object] | None = None,
) -> _Flows:
    """The major flow in the frame of `seen.reduced`, and the minor flow in that of the part with strokes.

    Edges are sought beside the major flow, if a processor is spare. What `on_begin` begins waits for the same one.
    """
    with SideStep(lambda: _detect_edges(seen, text, p)) as edges_beside:
        if on_begin is not None:
            on_begin(seen)
        major = refine_major_flow(text, detect_coarse_flow(text, p.major), p.major)
        strokes, edges = edges_beside.result()
    enlarge = strokes.factor / seen.factor
    lines = move_field(resize_field(major.field, 1 / seen.factor), (-strokes.origin[0], -strokes.origin[1]))
    lines = resize_field(lines, strokes.factor)
    shape = (strokes.image.shape[0], strokes.image.shape[1])
    minor = estimate_minor_flow(edges, shape, text.text_height_px * enlarge, lines)
    if minor is not None:
        found = minor.samples
        lean = angle_difference(found.angles, lines.at(found.points) + np.pi / 2)
        minor = replace(minor, samples=upright_type(found, lean))
    return major, minor, strokes


def _detect_edges(seen: FoundText, text: IdentifiedText, p: AnalysisParameters) -> tuple[PhotoPart, Edges]:
    strokes, area = _cut_text(seen, text, p)
    return strokes, detect_edges(strokes.image, area, p.minor)


def _cut_text(seen: FoundText, text: IdentifiedText, p: AnalysisParameters) -> tuple[PhotoPart, Mask]:
    """The part of the photo that holds the `text`, at the size for strokes, and the text's area (h, w) there."""
    factor = STROKE_TEXT_HEIGHT_PX * seen.factor / text.text_height_px
    if factor > p.least_reduction:
        factor = 1.0
    margin = int(np.ceil(MARGIN_TEXT_HEIGHTS * text.text_height_px))
    left, top, width, height = cv2.boundingRect(text.area.view(np.uint8))
    low = np.maximum(np.array([left, top]) - margin, 0)
    high = np.minimum(np.array([left + width, top + height]) + margin, text.area.shape[::-1])
    # Whole pixels of the photo and of the reduced photo, which differ by rounding only.
    first = np.floor(low / seen.factor).astype(int)
    last = np.minimum(np.ceil(high / seen.factor).astype(int), seen.gray.shape[::-1])
    strokes = cut_part(seen.gray, seen.light, first, last, factor)
    inside = np.ascontiguousarray(text.area[low[1] : high[1], low[0] : high[0]]).view(np.uint8)
    size = (strokes.image.shape[1], strokes.image.shape[0])
    return strokes, cv2.resize(inside, size, interpolation=cv2.INTER_NEAREST).astype(bool)


def _in_photo(flows: _Flows, factor: float) -> tuple[FlowSamples, FlowSamples | None]:
    """Samples of both flows in pixels of the photo."""
    major, minor, part = flows
    along = replace(major.samples, points=from_resized(major.samples.points, factor))
    if minor is None:
        return along, None
    return along, replace(minor.samples, points=part.to_photo(minor.samples.points))

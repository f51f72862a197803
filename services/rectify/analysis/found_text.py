"""The text in one photo, found on a reduced copy in even light, and the paper under it."""

from dataclasses import dataclass, field, replace

import cv2
import numpy as np

from services.arrays import Floats, GrayImage, Mask, Points, RgbImage
from services.errors import NoText
from services.geometry.homographies import from_resized, to_resized
from services.imaging.channels import luminance
from services.imaging.illumination import divide_by_light, reduced_light
from services.imaging.paper import Paper, PaperParameters, Window, model_paper
from services.imaging.reduction import Halves, enlarge_image, reduce_image
from services.texture_flow.major import MajorFlowParameters
from services.texture_flow.minor import MinorFlowParameters
from services.texture_flow.text_identification import (
    FEWEST_CHARACTERS,
    IdentifiedText,
    TextComponents,
    identify_text,
    keep_characters,
)

# Working sizes of the analysis, and its least input.
LEAST_SIDE_PX = 700
"""Smaller photos are enlarged for that, to `enlarged_side_px` or by `most_enlargement`: their letters touch."""
ENLARGED_SIDE_PX = 1000
MOST_ENLARGEMENT = 3.0
STROKE_TEXT_HEIGHT_PX = 20.0
"""Minor flow: above this text height, strokes gain nothing from more pixels."""
STRAY_SHARE = 0.005
"""Of all characters: so many may be specks, wherever they lie."""
MIN_FLOW_SAMPLES = 6


@dataclass(frozen=True, slots=True)
class AnalysisParameters:
    """Working sizes of the analysis, and its least input."""

    long_side_px: int = 1600
    """Text and major flow: text height is then about 8 px on a full page of small print."""
    least_reduction: float = 1.0
    """A factor above this is left out: it takes more time than the pixels that it saves."""
    major: MajorFlowParameters = field(default_factory=MajorFlowParameters)
    minor: MinorFlowParameters = field(default_factory=MinorFlowParameters)
    paper: PaperParameters = field(default_factory=PaperParameters)


def characters_in_photo(text: IdentifiedText, factor: float) -> Points:
    """Centres (N, 2) of the characters of `text`, found in the photo resized by `factor`, in photo pixels."""
    return from_resized(text.components.centres, factor)


def region_mask(region: tuple[tuple[float, float], ...], shape: tuple[int, int], factor: float) -> Mask:
    """Inside of the polygon `region` (photo pixels) on an image of `shape` resized by `factor`."""
    corners = to_resized(np.array(region, np.float64), factor)
    mask = np.zeros(shape, np.uint8)
    # Corners far outside would overflow fillPoly's integers.
    limit = 4.0 * max(shape)
    cv2.fillPoly(mask, [np.round(np.clip(corners, -limit, limit)).astype(np.int32)], 1)
    return mask.astype(bool)


@dataclass(frozen=True, slots=True, eq=False)
class FoundText:
    """The gray photo, its flat-fielded copy reduced by `factor`, its `text` in that frame, the paper under the text.

    `printed` is all that looks like characters, on paper or not; `light` the brightness of the bare page on a smaller
    copy of the photo. Where sheets lie side by side, text and print are those of the one that has most, `beside` is the
    text of the next one, and `windows` are the parts of the photo that show each, as `Sheet.window`.
    """

    gray: GrayImage
    factor: float
    reduced: GrayImage
    light: GrayImage
    text: IdentifiedText
    printed: TextComponents
    paper: Paper
    beside: IdentifiedText | None = None
    windows: tuple[Window, ...] = ()

    @property
    def window(self) -> Window | None:
        """The part of the photo that shows the sheet and no other one; None where no other one is seen."""
        return self.windows[0] if self.windows else None

    @property
    def characters(self) -> Points:
        """Centres of the characters (N, 2) in photo pixels."""
        return characters_in_photo(self.text, self.factor)

    @property
    def boxes(self) -> Floats:
        """Widths and heights (N, 2) of the characters in photo pixels."""
        return np.asarray(self.text.components.boxes[:, 2:] / self.factor)

    @property
    def text_height_px(self) -> float:
        """Typical character size in photo pixels."""
        return self.text.text_height_px / self.factor


def find_text(
    photo: RgbImage | Halves,
    region: tuple[tuple[float, float], ...] | None = None,
    parameters: AnalysisParameters | None = None,
) -> FoundText:
    """The dark print in `photo` (H, W, 3), within `region` if there is one.

    Raises
    ------
    NoText
        When there are too few characters.
    """
    p = parameters or AnalysisParameters()
    halves = Halves.of(photo)
    gray = luminance(halves.image)
    factor = min(1.0, p.long_side_px / max(gray.shape))
    if max(gray.shape) < LEAST_SIDE_PX:
        factor = min(ENLARGED_SIDE_PX / max(gray.shape), MOST_ENLARGEMENT)
    seen = reduce_image(gray, factor) if factor <= 1 else enlarge_image(gray, factor)
    light = reduced_light(seen)
    reduced = divide_by_light(seen, light)
    guide = None if region is None else region_mask(region, (reduced.shape[0], reduced.shape[1]), factor)
    text = identify_text(reduced, guide)
    printed, paper = text.components, None
    if len(text.components.sizes) >= FEWEST_CHARACTERS:
        paper = model_paper(halves, characters_in_photo(text, factor), p.paper)
        on_paper = paper.holds(characters_in_photo(text, factor))
        # Print on many grounds (posters, boxes) is not clutter: at most a minority is dropped.
        text = keep_characters(text, on_paper) if on_paper.mean() > 0.6 else text
    if paper is None or len(text.components.sizes) < FEWEST_CHARACTERS:
        count = len(text.components.sizes)
        raise NoText(
            f"{f'only {count}' if count else 'no'} printed characters were found; at least {FEWEST_CHARACTERS} are "
            "needed. Photograph the page closer, sharper or in better light"
            + (", or give a larger region." if region is not None else ".")
        )
    sheets = paper.sheets(characters_in_photo(text, factor))
    if len(sheets) < 2 or sheets[0].holds.sum() < FEWEST_CHARACTERS:
        return FoundText(gray, factor, reduced, light, text, printed, paper)
    share = text.rejected_fraction  # most of what is left out is text
    main, beside = (
        replace(keep_characters(text, each.holds), rejected_fraction=share) for each in sheets[:2]
    )
    windows = tuple(each.window for each in sheets[:2])
    return FoundText(gray, factor, reduced, light, main, main.components, paper, beside, windows)

"""Where the sheet ends on the whole mosaic, as `rectify` finds it on one photo."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from services.arrays import Mask, Points, RgbImage
from services.imaging.illumination import flatten_illumination
from services.imaging.paper import certain_sheet, model_paper
from services.imaging.sheet_edges import find_sheet_edges
from services.mosaic.photo_graph import is_shown
from services.mosaic.placed_photo import PlacedPhoto
from services.rectify.edge_cropping import LONG_SIDE_PX
from services.texture_flow.text_identification import identify_text

COVERED_LONG_SIDE_PX = 400
"""Size at which it is told what the photos cover; `Paper` looks for the sheet at the same."""


@dataclass(frozen=True, slots=True)
class PageCroppingParameters:
    """Sizes of the reduced pages on which the sheet is looked for."""

    text_long_side_px: int = 1600
    """As in `AnalysisParameters`."""
    min_components: int = 30
    rim: float = 0.01
    """Of the sheet's size, kept beside it (as `FramingParameters.paper_margin`)."""


@dataclass(frozen=True, slots=True, eq=False)
class PageCrop:
    """Columns `left` to `right` and rows `top` to `bottom`, ends left out.

    `sheet` (N, 2) is the convex outline, pixels before cropping, of a sheet that is surely seen whole.
    """

    left: int
    top: int
    right: int
    bottom: int
    sheet: Points | None = None


def find_page_crop(
    page: RgbImage, covered: Mask, parameters: PageCroppingParameters | None = None
) -> PageCrop:
    """The part of `page` (H, W, 3) that is the sheet; `covered` (h, w), of any size, tells where photos show it."""
    p = parameters or PageCroppingParameters()
    height, width = page.shape[:2]
    whole = PageCrop(0, 0, width, height)
    small, factor = _reduce(page, p.text_long_side_px)
    gray = np.asarray(cv2.cvtColor(small, cv2.COLOR_RGB2GRAY), np.uint8)
    text = identify_text(flatten_illumination(gray))
    if len(text.components.sizes) < p.min_components:
        return whole
    outline = model_paper(_black_beside(small, covered), text.components.centres).outline(
        text.components.centres
    )
    sheet = None if outline is None else certain_sheet(outline)
    characters = (text.components.centres + 0.5) / factor - 0.5
    if sheet is not None:
        sheet = (sheet + 0.5) / factor - 0.5
        rim = p.rim * float(np.ptp(sheet, axis=0).max())
        low = np.clip(np.floor(sheet.min(axis=0) - rim), 0, [width - 1, height - 1]).astype(int)
        high = np.clip(np.ceil(sheet.max(axis=0) + rim), low + 1, [width, height]).astype(int)
        return PageCrop(int(low[0]), int(low[1]), int(high[0]), int(high[1]), sheet)
    view, factor = _reduce(page, LONG_SIDE_PX)
    seen = cv2.resize(
        covered.astype(np.uint8), (view.shape[1], view.shape[0]), interpolation=cv2.INTER_NEAREST
    )
    edges = find_sheet_edges(
        view, (characters + 0.5) * factor - 0.5, text.text_height_px * factor, seen.astype(bool)
    )

    def side(edge: float | None, otherwise: int, limit: int) -> int:
        return otherwise if edge is None else int(np.clip(round((edge + 0.5) / factor - 0.5), 0, limit))

    left, top = side(edges.left, 0, width - 1), side(edges.top, 0, height - 1)
    right, bottom = side(edges.right, width - 1, width - 1), side(edges.bottom, height - 1, height - 1)
    return PageCrop(left, top, right + 1, bottom + 1) if left < right and top < bottom else whole


def covered_by(placed: Sequence[PlacedPhoto], width: int, height: int) -> Mask:
    """Where at least one photo shows the page of `width` x `height`; (h, w), reduced."""
    factor = COVERED_LONG_SIDE_PX / max(width, height)
    columns, rows = max(round(width * factor), 1), max(round(height * factor), 1)
    x, y = np.meshgrid((np.arange(columns) + 0.5) * width / columns, (np.arange(rows) + 0.5) * height / rows)
    grid = np.stack([x, y], axis=-1).reshape(-1, 2) - 0.5
    covered = np.zeros(len(grid), bool)
    for photo in placed:
        covered |= is_shown(photo.flat, photo.placement.to_flat(grid))
    return np.asarray(covered.reshape(rows, columns))


def crop_page(page: RgbImage, crop: PageCrop) -> RgbImage:
    """The cropped page, a view; what lies beside a sheet that is seen whole becomes white, in place."""
    part = page[crop.top : crop.bottom, crop.left : crop.right]
    if crop.sheet is not None:
        beside = np.full(part.shape[:2], 255, np.uint8)
        corners = np.round(crop.sheet - [crop.left, crop.top]).astype(np.int32)
        cv2.fillConvexPoly(beside, corners, (0,))
        part[beside > 0] = 255
    return part


def _black_beside(page: RgbImage, covered: Mask) -> RgbImage:
    """`page` with black where no photo shows it: what is white there is not paper."""
    height, width = page.shape[:2]
    mask = cv2.resize(covered.astype(np.uint8), (width, height), interpolation=cv2.INTER_NEAREST)
    return np.asarray(cv2.bitwise_and(page, page, mask=mask), np.uint8)


def _reduce(image: RgbImage, long_side_px: int) -> tuple[RgbImage, float]:
    factor = min(1.0, long_side_px / max(image.shape[:2]))
    size = (max(round(image.shape[1] * factor), 1), max(round(image.shape[0] * factor), 1))
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8), factor

"""Print on the sheet, which no view may lose: its boxes, frames that grow until they hold it, the share they hold."""

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from services.arrays import Floats, Mask, Points
from services.geometry.homographies import from_resized, translation
from services.geometry.linked_groups import group_linked
from services.geometry.page_frame import Frame
from services.notices import Notice
from services.rectify.analysis.found_text import STRAY_SHARE
from services.rectify.shape_choice.shaped_page import ShapedPage
from services.sheet.outline.results import BELIEVED_CONFIDENCE

PRINT_CUT = Notice(
    "print-cut",
    "print on the sheet ends at the photo's border, or lies where the view ends: have the whole sheet in the photo.",
)

MASK_SCALE = 0.25
"""Size of the masks of polygons over that of the photo."""


REACH = 2.5
"""Text heights between characters of one word or line, wide word spaces included."""
WORD = 3
"""Fewer characters in a row are specks, or grain of a desk."""
LEAST_INSIDE = 0.8
"""Share of all print that an outline holds, or it must be believed: on some photos half of what looks like print is
grain of a desk."""
SCALE_POINTS = 60
"""By so many characters the scale of the view is told."""
MOST_GROWTH = 0.2
"""Of the view's size, on each side: what is farther away is no print of this page."""
MARGIN = 0.5
"""Text heights that are kept round print at which the view grows."""


def sheet_print(page: ShapedPage) -> Floats:
    """Boxes (N, 4, 2) of the characters on the sheet of `page`, corners in photo pixels; none where no text is seen."""
    analysis = page.analysis
    if analysis is None or not page.on_page.any():
        return np.zeros((0, 4, 2))
    x, y, width, height = (column.astype(np.float64) for column in analysis.text.components.boxes.T)
    # From border to border of the pixels, so that two characters may touch the photo's border.
    low = np.column_stack([x, y]) - 0.5
    size = np.column_stack([width, height])
    corners = np.stack([low, low + size * [1, 0], low + size, low + size * [0, 1]], axis=1)
    boxes = from_resized(corners.reshape(-1, 2), analysis.factor).reshape(-1, 4, 2)[page.on_page]
    return boxes[_on_sheet(page, page.characters)]


def _on_sheet(page: ShapedPage, characters: Points) -> Mask:
    """Which `characters` (N, 2) are in groups of the size of a word, on the sheet where its outline is seen."""
    group = groups_within(characters, REACH * page.text_height_px)
    number = np.bincount(group)
    kept = number >= WORD
    if page.outline is not None:
        inside = page.outline.holds(characters)
        if page.outline.confidence >= BELIEVED_CONFIDENCE or inside.mean() >= LEAST_INSIDE:
            # A line that goes on beyond a torn side is print: most of it is on the sheet.
            kept &= 2 * np.bincount(group, inside) >= number
    return np.asarray(kept[group])


def groups_within(points: Points, reach: float) -> NDArray[np.intp]:
    """Numbers (N,) of the groups of `points` (N, 2): steps of at most `reach` lead from point to point of a group."""
    near = cKDTree(points).query_pairs(reach, output_type="ndarray")
    return group_linked(len(points), near[:, 0], near[:, 1])


def grow_to_print(frame: Frame, boxes: Floats, text_height_px: float, paper: Points | None = None) -> Frame:
    """`frame`, larger on those sides on which one of the `boxes` (N, 4, 2), photo pixels, ends outside of it.

    Beyond the `paper` (M, 2) the view is white, so that it shows no more print however far it goes.
    """
    if paper is not None:
        boxes = boxes[_within(paper, boxes.mean(axis=1))]
    size = np.array([frame.width, frame.height], np.float64)
    at, _ = _near_border(frame, boxes)
    with np.errstate(invalid="ignore"):
        near = ((at >= -MOST_GROWTH * size) & (at <= (1 + MOST_GROWTH) * size)).all(axis=(1, 2))
    if not near.any():
        return frame
    margin = MARGIN * text_height_px * _text_scale(frame, boxes)
    low, high = at[near].min(axis=(0, 1)), at[near].max(axis=(0, 1))
    before = np.where(low < -0.5, np.ceil(margin - low), 0.0)
    after = np.where(high > size - 0.5, np.ceil(high + margin - size + 1), 0.0)
    if not before.any() and not after.any():
        return frame
    width, height = (size + before + after).astype(int).tolist()
    return frame.through(translation(float(-before[0]), float(-before[1])), width, height)


def _near_border(frame: Frame, boxes: Floats) -> tuple[Floats, Mask]:
    """Corners (M, 4, 2) in the view of those `boxes` (N, 4, 2), photo pixels, that may end outside of it; which (N,).

    The others lie within it for certain: their first corner does, by more than twice their size.
    """
    first, size = frame.to_flat(boxes[:, 0]), np.array([frame.width, frame.height])
    reach = 2 * np.linalg.norm(boxes[:, 2] - boxes[:, 0], axis=1) * _text_scale(frame, boxes)
    with np.errstate(invalid="ignore"):
        within = ((first > reach[:, None]) & (first < size - reach[:, None])).all(axis=1)
    corners = frame.to_flat(boxes[~within].reshape(-1, 2)).reshape(-1, 4, 2)
    return np.asarray(corners), np.asarray(~within)


def _text_scale(frame: Frame, boxes: Floats) -> float:
    """Pixels of the view by a pixel of the photo at the `boxes` (N, 4, 2), the median; 0 without any."""
    points, half = boxes[:: max(len(boxes) // SCALE_POINTS, 1), 0], np.array([0.0, 0.5])
    steps = np.linalg.norm(frame.to_flat(points + half) - frame.to_flat(points - half), axis=1)
    known = steps[np.isfinite(steps)]
    return float(np.median(known)) if len(known) else 0.0


def kept_print(frame: Frame, boxes: Floats, paper: Points | None = None) -> Mask:
    """Which `boxes` (N, 4, 2), photo pixels, lie in the view, and in `paper` (M, 2), outside of which it is white."""
    at, near = _near_border(frame, boxes)
    kept = ~near
    with np.errstate(invalid="ignore"):
        kept[near] = ((at >= -1.0) & (at <= [frame.width, frame.height])).all(axis=(1, 2))
    if paper is not None:
        kept &= _within(paper, boxes.mean(axis=1))
    return np.asarray(kept)


def share_kept(boxes: Floats, kept: Mask) -> float | None:
    """Share of the `boxes` (N, 4, 2) that are `kept` (N,); None where there are none."""
    return float(np.mean(kept)) if len(boxes) else None


def hides_print(polygon: Points, boxes: Floats) -> bool:
    """Whether as many characters as a word has lie outside of a `polygon` (M, 2) outside of which the view is white."""
    return bool(np.sum(~_within(polygon, boxes.mean(axis=1))) >= WORD)


def print_notices(kept: Mask, cut_letters: int) -> tuple[Notice, ...]:
    """The warning that print is cut: as it is not `kept`, or by the border of the photo, by `count_cut_letters`."""
    lost = int(np.sum(~kept))
    is_lost = lost >= WORD and lost > STRAY_SHARE * len(kept)
    return (PRINT_CUT,) if is_lost or cut_letters >= WORD else ()


def _within(polygon: Points, points: Points) -> Mask:
    """Which `points` (N, 2) lie in a `polygon` (M, 2) of photo pixels, to a few pixels outwards: on a smaller mask."""
    low = np.floor(polygon.min(axis=0)) - 1 / MASK_SCALE
    size = np.ceil((polygon.max(axis=0) - low) * MASK_SCALE).astype(int) + 2
    mask = np.zeros((size[1], size[0]), np.uint8)
    corners = [np.round((polygon - low) * MASK_SCALE).astype(np.int32)]
    cv2.fillPoly(mask, corners, 1)
    cv2.polylines(mask, corners, True, 1, 2)
    at = np.round((points - low) * MASK_SCALE).astype(int)
    inside = ((at >= 0) & (at < size)).all(axis=1)
    at = np.clip(at, 0, size - 1)
    return np.asarray(inside & (mask[at[:, 1], at[:, 0]] > 0))

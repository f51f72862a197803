"""Text identification (dissertation 2.3.1), and what photos of real scenes need beyond it.

The three steps of the text (strong Laplacian of Gaussian edges, closing, Niblack's threshold inside the
text area) find ink. Real photos add desks, pictures, rules and page borders; these are kept out by testing
the connected components of the ink for size, stroke width, solidity and alignment with neighbours.
"""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from services.arrays import GrayImage, Mask, Points, Vector
from services.imaging.binary_masks import close_mask, threshold_by_windows
from services.imaging.components import keep_components, label_components, sum_distances
from services.robust import robust_scale

FEWEST_CHARACTERS = 30
"""Fewer characters do not show the shape of a page."""


# Lengths are shares of the image diagonal or multiples of the text height.
LOG_SIGMA = 1 / 1500
"""Scale of the Laplacian of Gaussian over the diagonal: half a stroke of small print."""
EDGE_NOISE_FACTOR = 5.0
"""An edge is strong above this many robust standard deviations of the response."""
EDGE_CONTRAST = 6.0
"""... and above this response in gray levels of the flat-fielded image (paper grain stays below)."""
CLOSING = 1 / 110
"""Diameter of the closing over the diagonal: about a line spacing of small print."""
NIBLACK_K = -0.2
"""Niblack's weight of the standard deviation (Trier and Jain's recommendation)."""
NIBLACK_WINDOW = 1 / 65
"""Window of Niblack's mean and deviation over the diagonal: about two lines of small print."""
INK_CONTRAST = 12.0
"""Least standard deviation, in gray levels, of a window that holds ink."""
MIN_TEXT_HEIGHT = 1 / 500
MAX_TEXT_HEIGHT = 1 / 12
"""Heights of a single component over the diagonal."""
MAX_ELONGATION = 8.0
"""Longest over shortest side of the least rectangle round a component; rules are longer."""
MAX_STROKE = 0.45
"""Stroke width over the component's own size; blobs are thicker."""
SIZE_RATIO = 2.5
"""Components of one line differ in size by less."""
REACH = 3.0
"""Neighbours of one line are nearer than this many component sizes."""
MIN_NEIGHBOURS = 2
ALIGNMENT = 0.5
"""Largest sine of the angle between the ways to two neighbours on one line."""


@dataclass(frozen=True, slots=True, eq=False)
class TextComponents:
    """Connected components of printed characters, one row each.

    `centres` (N, 2) in pixels; `boxes` (N, 4) as (x, y, width, height); `sizes` (N,) geometric extent
    in pixels; `labels` (N,) are the values of the component in `IdentifiedText.label_image`.
    """

    centres: Points
    boxes: NDArray[np.int32]
    sizes: Vector
    labels: NDArray[np.int32]


@dataclass(frozen=True, slots=True, eq=False)
class IdentifiedText:
    """Where the text is, in the frame of the analysed image.

    `ink` (H, W) marks the pixels of characters, `area` (H, W) the closed text area, `text_height_px` is
    the typical size of a lower-case character, `rejected_fraction` the share of found ink that is no text.
    """

    ink: Mask
    area: Mask
    label_image: NDArray[np.int32]
    components: TextComponents
    text_height_px: float
    rejected_fraction: float

    @property
    def area_fraction(self) -> float:
        """Share of the image that is text area, 0-1."""
        return float(self.area.mean())


def detect_edges(gray: GrayImage) -> Mask:
    """Pixels of strong Laplacian of Gaussian response (step 1 of 2.3.1), scale-normalised by sigma^2."""
    diagonal = float(np.hypot(*gray.shape))
    sigma = max(LOG_SIGMA * diagonal, 0.8)
    smoothed = cv2.GaussianBlur(gray, (0, 0), sigma, dst=None)
    response = cv2.Laplacian(smoothed, cv2.CV_16S, ksize=1)
    noise = robust_scale(response[::7, ::7].astype(np.float32) * sigma**2)
    threshold = max(EDGE_NOISE_FACTOR * noise, EDGE_CONTRAST * sigma**2 / 2)
    # Responses are whole numbers, so their bound is one too; where bytes hold it, they are compared as bytes.
    bound = int(threshold / sigma**2)
    size = cv2.convertScaleAbs(response) if bound < np.iinfo(np.uint8).max else np.abs(response)
    return np.asarray(size > bound)


def find_text_area(edges: Mask, diameter_px: float) -> Mask:
    """Closing of the edges, which fills the gaps between strokes, words and lines (step 2 of 2.3.1)."""
    return close_mask(edges, max(int(diameter_px) | 1, 3))


def binarize_niblack(gray: GrayImage, area: Mask, window_px: float, k: float, contrast: float) -> Mask:
    """Niblack's threshold mean + k deviation inside `area` (step 3 of 2.3.1).

    Windows whose deviation is below `contrast` hold no ink: without that guard Niblack's method draws
    the grain of empty paper. Windows are of at most 181 px: photos are analysed at a seventh of that.
    """
    return threshold_by_windows(gray, area, max(int(window_px) | 1, 5), k, contrast)


def keep_characters(text: IdentifiedText, kept: NDArray[np.bool_]) -> IdentifiedText:
    """The text with only those components for which `kept` (N,) is true."""
    if kept.all() or not kept.any():
        return text
    c = text.components
    components = TextComponents(c.centres[kept], c.boxes[kept], c.sizes[kept], c.labels[kept])
    height = float(np.median(components.sizes))
    ink = _ink_of(c.labels[kept], int(c.labels.max()) + 1, text.ink, text.label_image)
    lost = 1.0 - int(np.count_nonzero(ink)) / max(int(np.count_nonzero(text.ink)), 1)
    rejected = 1.0 - (1.0 - text.rejected_fraction) * (1.0 - lost)
    return IdentifiedText(
        ink, find_text_area(ink, 2.5 * height), text.label_image, components, height, float(rejected)
    )


def detect_ink(gray: GrayImage, region: Mask | None = None) -> Mask:
    """All ink (H, W) of a flat-fielded photo, print or not, within `region` (H, W): the three steps of 2.3.1."""
    diagonal = float(np.hypot(*gray.shape))
    area = find_text_area(detect_edges(gray), CLOSING * diagonal)
    if region is not None:
        area &= region
    return binarize_niblack(gray, area, NIBLACK_WINDOW * diagonal, NIBLACK_K, INK_CONTRAST)


def identify_text(gray: GrayImage, region: Mask | None = None) -> IdentifiedText:
    """Printed text of a flat-fielded photo (dark on light), in its own pixel frame.

    Parameters
    ----------
    gray
        (H, W) uint8, flat-fielded: paper near white.
    region
        (H, W) guide: only text inside of it counts.
    """
    ink = detect_ink(gray, region)
    count, label_image, stats, centroids = label_components(ink)
    kept = _select_characters(ink, label_image, stats, centroids)
    text_ink = _ink_of(kept, count, ink, label_image)
    found, taken = int(np.count_nonzero(ink)), int(np.count_nonzero(text_ink))
    components = TextComponents(
        centroids[kept],
        stats[kept, :4],
        _sizes(stats[kept]),
        kept.astype(np.int32),
    )
    text_height = float(np.median(components.sizes)) if len(kept) else 0.0
    text_area = find_text_area(text_ink, max(2.5 * text_height, 3.0)) if len(kept) else text_ink
    return IdentifiedText(
        text_ink, text_area, label_image, components, text_height, 1.0 - taken / found if found else 0.0
    )


def _ink_of(kept: NDArray[np.integer[Any]], count: int, ink: Mask, label_image: NDArray[np.int32]) -> Mask:
    """Those pixels of `ink` (H, W) whose component, of `count`, is among the `kept` (K,)."""
    chosen = np.zeros(count, bool)
    chosen[kept] = True
    return keep_components(ink, label_image, chosen)


def _sizes(stats: NDArray[np.int32]) -> Vector:
    """Rotation-tolerant size of components: the geometric mean of box sides, kept from vanishing for i and l."""
    width, height = stats[:, cv2.CC_STAT_WIDTH].astype(float), stats[:, cv2.CC_STAT_HEIGHT].astype(float)
    return np.asarray(np.maximum(np.sqrt(width * height), 0.7 * np.maximum(width, height)))


def _select_characters(
    ink: Mask, label_image: NDArray[np.int32], stats: NDArray[np.int32], centroids: Points
) -> NDArray[np.intp]:
    """Indices of the components that look like characters and have similar components near them."""
    diagonal = float(np.hypot(*ink.shape))
    width, height = stats[:, cv2.CC_STAT_WIDTH].astype(float), stats[:, cv2.CC_STAT_HEIGHT].astype(float)
    area = stats[:, cv2.CC_STAT_AREA].astype(float)
    longest, shortest = np.maximum(width, height), np.minimum(width, height)
    size = _sizes(stats)
    rows, columns = ink.shape
    left, top = stats[:, cv2.CC_STAT_LEFT], stats[:, cv2.CC_STAT_TOP]
    whole = (left > 0) & (top > 0) & (left + width < columns) & (top + height < rows)
    right_size = (
        (longest >= MIN_TEXT_HEIGHT * diagonal)
        & (longest <= 2 * MAX_TEXT_HEIGHT * diagonal)
        & (size <= MAX_TEXT_HEIGHT * diagonal)
        & (area >= 6)
    )
    thin = measure_strokes(ink, label_image, area) < MAX_STROKE * size
    character = whole & right_size & thin
    character[0] = False  # the background
    compact = character & (longest <= MAX_ELONGATION * shortest)
    if not compact.any():
        return np.zeros(0, np.intp)
    # Letters that touch form words, long but as high as a character; rules are long and thin.
    word = character & ~compact & (shortest > 0.6 * np.median(size[compact]))
    candidates = np.flatnonzero(compact | word)
    for _ in range(2):  # the second pass takes away what leaned on components that fell in the first
        candidates = candidates[_stand_in_line(centroids[candidates], size[candidates])]
    return np.asarray(candidates)


def measure_strokes(ink: Mask, label_image: NDArray[np.int32], area: Vector) -> Vector:
    """Stroke width (N,) of every component in pixels.

    The pixels across a stroke of width w are 1, 2, ... w/2, ... 2, 1 from the ground: (w + 2) / 4 on average.
    """
    total = sum_distances(ink, label_image, len(area))
    return np.asarray(4 * total / np.maximum(area, 1) - 2)


def _stand_in_line(centres: Points, sizes: Vector) -> NDArray[np.bool_]:
    """Which components have at least `min_neighbours` of like size within reach, two of them on one line with it."""
    if len(centres) <= MIN_NEIGHBOURS:
        return np.zeros(len(centres), bool)
    distance, index = cKDTree(centres).query(centres, k=min(9, len(centres)))
    ratio = sizes[index] / sizes[:, None]
    near = (distance > 0) & (distance < REACH * np.maximum(sizes[index], sizes[:, None]))
    fellow = near & (ratio < SIZE_RATIO) & (ratio > 1 / SIZE_RATIO)
    way = (centres[index] - centres[:, None]) / np.maximum(distance, 1e-9)[..., None]
    first, second = np.triu_indices(index.shape[1], 1)
    cross = np.abs(way[:, first, 0] * way[:, second, 1] - way[:, first, 1] * way[:, second, 0])
    aligned = (fellow[:, first] & fellow[:, second] & (cross < ALIGNMENT)).any(axis=1)
    return np.asarray((fellow.sum(axis=1) >= MIN_NEIGHBOURS) & aligned)

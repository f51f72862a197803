"""Detection of pictures on a page, as opposed to shaded paper, from the levels of paper and ink."""

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import Floats, Mask, Points, RgbImage
from services.imaging.channels import BLACK_LEVELS, log_brightness
from services.imaging.illumination import reduced_copy
from services.imaging.levels import Levels, fill_unknown_levels, measure_levels
from services.imaging.reduction import PRINT_PX

# Lengths are shares of the page's long side; levels of ink are shares of the local paper level.
WINDOW = 0.45
"""Largest extent of a picture in one direction."""
DARKEST_PAPER = 0.88
"""Brightest level of a picture relative to the surrounding paper. Wrinkles and show-through are brighter."""
LARGEST_PAPER_INK = 0.35
"""Largest ink level of a page whose strokes are resolved; above it ink levels are not used."""
SIMILAR_INK = (1.3, 0.05)
"""Largest ink level in a shadow as a factor and a summand of that elsewhere: in a shadow the ratio of ink to paper
is the same as in full light. In a picture the ratio of dark to light is larger."""
OTHER_INK = (1.5, 0.1)
"""Largest level of ink, as a factor and a summand; lighter print is not ink."""
SHADOW_SHARE = 0.9
"""Least share with similar ink for a dark part to count as a shadow."""
PICTURE_SHARE = 0.5
"""Least share without any ink for a dark part at the page's border to count as a picture."""
HOLES = 1 / 24
"""Largest width of bright parts within a picture, for example of white print."""
RING = 1 / 60
"""Width of the rings inside and outside of a dark part, in which its edge is measured."""
EDGE = 0.07
"""Least step of the level's logarithm across the rings: a picture's edge is sharp. Without this step near the
border, a dark part is uneven light."""
SURE_EDGE = 0.3
"""Least share of the rings inside photos; below it nothing is known about the edge."""
BOX_SHARE = 0.8
"""A picture that covers this share of its upright bounding box is extended to the box; the rest is bright parts."""
RIM = 1 / 100
"""Margin around a picture in which the background is not yet that of paper."""
SOFTNESS_PX = 5
"""Width over which the edge of a picture's mask is softened, pixels of the map of levels."""
MOST_CHARACTERS = 4
"""A dark part of a single photo with more characters of text is paper in a shadow."""
SPREAD = 0.2
"""Least deviation of the logarithm of a gray picture's brightness; creases and shadows on bare paper vary less."""
TINT = 0.2
"""From this difference of log channels to the paper a part is coloured, and no shadow or aged margin of a book."""


def find_pictures(levels: Levels, inner: Mask | None = None) -> Mask:
    """Mask (h, w as the levels) of pictures on the page, even where their levels look like those of paper.

    A picture is darker than the surrounding paper, and so is a shadow inside the page. In a shadow, however, ink
    darkens in proportion to paper. A dark part at the page's border is a picture only if its ink indicates it. An edge
    is reliable where `inner` (of any size) is true, inside a photo. At the borders of photos it may be a difference of
    their light.
    """
    height, width = levels.paper.shape
    long_side = max(height, width)
    window = _odd(WINDOW * long_side)
    amid = _dark_amid_paper(levels.paper, window, DARKEST_PAPER, to_border=False)
    to_border = _dark_amid_paper(levels.paper, window, DARKEST_PAPER, to_border=True)
    plain = ~to_border & (levels.measured > 0.5) & (levels.ink > 0)
    ink = float(np.median(levels.ink[plain])) if plain.any() else 1.0
    resolved = 0.0 < ink <= LARGEST_PAPER_INK
    # Paper in a shadow has similar ink everywhere; in a picture only some places look like paper with ink.
    is_similar = resolved & (levels.measured > 0.5) & (levels.ink <= SIMILAR_INK[0] * ink + SIMILAR_INK[1])
    is_other = resolved & (levels.ink > OTHER_INK[0] * ink + OTHER_INK[1])
    holes, rim = _odd(HOLES * long_side), _odd(2 * RIM * long_side)
    ring = _odd(RING * long_side)
    amid_parts, amid_count = _parts(amid, holes)
    sure = np.ones((height, width), bool)
    if inner is not None:
        sure = cv2.resize(inner.astype(np.uint8), (width, height), interpolation=cv2.INTER_NEAREST) > 0
    is_picture = _edges(np.log(levels.paper), amid_parts, amid_count, ring, sure, SURE_EDGE) >= EDGE
    is_picture &= _shares(amid_parts, amid_count, is_similar) <= SHADOW_SHARE
    is_picture[0] = False
    cut_parts, cut_count = _parts(to_border, holes)
    is_cut_picture = _shares(cut_parts, cut_count, is_other) >= PICTURE_SHARE
    is_cut_picture[0] = False
    found = (is_picture[amid_parts] | is_cut_picture[cut_parts]).astype(np.uint8)
    _, _, boxes, _ = cv2.connectedComponentsWithStats(found)
    for left, top, across, down, area in boxes[1:]:
        if area >= BOX_SHARE * across * down:
            found[top : top + down, left : left + across] = 1
    grown = cv2.dilate(found, np.ones((rim, rim), np.uint8))
    return np.asarray(grown > 0)


def pictures_without_text(levels: Levels, image: RgbImage, characters: Points) -> Mask:
    """Mask (h, w as the `levels`) of those pictures in one photo's flat view that are certainly no paper.

    In a photo whose light was not matched with others a shadow may look like a picture. So a picture shows none of the
    `characters` (N, 2), which are places of text in pixels of `image` (H, W, 3), and it varies or is coloured. A gray
    one does not reach the view's border, since shadows of hands and of a book's other page do.
    """
    found = find_pictures(levels)
    height, width = found.shape
    small = np.asarray(cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA), np.uint8)
    paper = (levels.measured > 0.5) & ~found
    tint = _tints(small, paper) if paper.any() else np.zeros(found.shape)
    window = _odd(WINDOW * max(height, width))
    dark = _dark_amid_paper(levels.paper, window, DARKEST_PAPER, to_border=True)
    # A coloured part without the rim around it: text just beside a band is not in it.
    coloured, _ = _parts(dark & (tint >= TINT), _odd(HOLES * max(height, width)))
    scale = np.array([width / image.shape[1], height / image.shape[0]])
    columns, rows = np.clip((characters * scale).astype(int), 0, [width - 1, height - 1]).T
    brightness = log_brightness(np.asarray(cv2.medianBlur(small, 2 * SOFTNESS_PX + 1), np.uint8))
    inner = np.zeros_like(found)
    inner[1:-1, 1:-1] = True
    pictures = np.zeros_like(found)
    for mask, rim in ((found, 0.0), (coloured > 0, RIM)):
        count, parts = cv2.connectedComponents(mask.astype(np.uint8))
        labels = np.asarray(parts, np.int32)
        text = np.bincount(labels[rows, columns], minlength=count)
        at_border = np.bincount(labels[~inner], minlength=count) > 0
        means = _shares(labels, count, brightness)
        spread = np.sqrt(_shares(labels, count, np.square(brightness - means[labels])))
        is_coloured = _shares(labels, count, tint) >= TINT
        is_picture = (text <= MOST_CHARACTERS) & (is_coloured | ((spread >= SPREAD) & ~at_border))
        is_picture[0] = False
        around = np.ones((_odd(2 * rim * max(height, width)),) * 2, np.uint8)
        pictures |= cv2.dilate(is_picture[labels].astype(np.uint8), around) > 0
    return pictures


def levels_beside_pictures(image: RgbImage, levels: Levels, pictures: Mask) -> Levels:
    """`levels` of `image`, measured again with its `pictures` replaced by the paper around; these are not measured."""
    beside = (levels.measured > 0.5) & ~pictures
    if not pictures.any() or not beside.any():
        return levels
    around = fill_unknown_levels(levels.paper, beside.astype(np.float32), HOLES * max(pictures.shape))
    copy = reduced_copy(image, PRINT_PX)[0].copy()
    size = (copy.shape[1], copy.shape[0])
    covered = cv2.resize(pictures.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST) > 0
    paper = cv2.resize(around, size, interpolation=cv2.INTER_LINEAR)
    copy[covered] = np.clip(paper[covered] + 0.5, 1, 255).astype(np.uint8)[:, None]
    again = measure_levels(copy)
    if again is None:
        return levels
    softened = cv2.blur((~pictures).astype(np.float32), (SOFTNESS_PX, SOFTNESS_PX))
    return Levels(again.paper, again.ink, np.asarray(again.measured * softened, np.float32))


def _tints(image: RgbImage, paper: Mask) -> Floats:
    """Largest difference (h, w) of the log channels of `image` to those of its `paper`, both without brightness."""
    channels = np.log(image.astype(np.float32) + np.float32(BLACK_LEVELS))
    hue = channels - channels.mean(axis=2, keepdims=True)
    return np.asarray(np.abs(hue - np.median(hue[paper], axis=0)).max(axis=2))


def _parts(mask: Mask, holes: int) -> tuple[NDArray[np.int32], int]:
    """Label of the connected part of `mask` at every pixel, 0 for none, and the number of labels.

    Holes up to the given size are filled; parts that are only two pixels wide are removed.
    """
    opened = cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
    padded = cv2.copyMakeBorder(opened, holes, holes, holes, holes, cv2.BORDER_CONSTANT, value=0)
    closed = cv2.morphologyEx(padded, cv2.MORPH_CLOSE, np.ones((holes, holes), np.uint8))
    height, width = mask.shape
    count, labels = cv2.connectedComponents(closed[holes : holes + height, holes : holes + width])
    return np.asarray(labels, np.int32), count


def _shares(parts: NDArray[np.int32], count: int, evidence: Mask | Floats) -> Floats:
    """Mean of `evidence` in each part (count,)."""
    area = np.bincount(parts.ravel(), minlength=count)
    return np.asarray(np.bincount(parts.ravel(), evidence.ravel(), count) / np.maximum(area, 1))


def _edges(
    level: NDArray[np.float32], parts: NDArray[np.int32], count: int, ring: int, sure: Mask, least: float
) -> Floats:
    """Mean of `level` in the ring around each part minus the mean in the ring inside it, (count,).

    Only pixels that are `sure` count; 0 if they are less than the share `least` of both rings.
    """
    kernel = np.ones((2 * ring + 1,) * 2, np.uint8)
    # Labels are small integers, which single precision represents exactly.
    round_about = cv2.dilate(parts.astype(np.float32), kernel).astype(np.int32)
    round_about[parts > 0] = 0
    within = np.where(cv2.erode((parts > 0).astype(np.uint8), kernel) > 0, 0, parts)

    def areas(labels: NDArray[np.int32], counted: Mask | Floats) -> Floats:
        return np.asarray(np.bincount(labels.ravel(), np.ravel(counted), count), np.float64)

    def means(labels: NDArray[np.int32]) -> Floats:
        return areas(labels, level * sure) / np.maximum(areas(labels, sure), 1)

    known = areas(round_about, sure) + areas(within, sure)
    whole = areas(round_about, np.ones_like(sure)) + areas(within, np.ones_like(sure))
    return np.where(known >= least * whole, means(round_about) - means(within), 0.0)


def _odd(size: float) -> int:
    return 2 * int(size / 2) + 1


def _dark_amid_paper(paper: NDArray[np.float32], window: int, darkest: float, to_border: bool) -> Mask:
    """Where `paper` has a dip narrower than `window`; with `to_border` also a dip that the page's border cuts.

    Without `to_border`, a slope that only descends towards the page's border is not a dip.
    """
    pad = window // 2
    padded = paper
    if not to_border:
        padded = np.asarray(cv2.copyMakeBorder(paper, pad, pad, pad, pad, cv2.BORDER_REPLICATE), np.float32)
    around = cv2.morphologyEx(padded, cv2.MORPH_CLOSE, np.ones((window, window), np.uint8))
    if not to_border:
        around = around[pad : pad + paper.shape[0], pad : pad + paper.shape[1]]
    return np.asarray(paper < darkest * around)

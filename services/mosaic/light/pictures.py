"""Detection of pictures on a page, as opposed to shaded paper, from the levels of paper and ink."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import Floats, Mask
from services.imaging.illumination import Levels


@dataclass(frozen=True, slots=True)
class PictureParameters:
    """Lengths are shares of the page's long side; levels of ink are shares of the local paper level."""

    window: float = 0.45
    """Largest extent of a picture in one direction."""
    darkest_paper: float = 0.88
    """Brightest level of a picture relative to the surrounding paper. Wrinkles and show-through are brighter."""
    largest_paper_ink: float = 0.35
    """Largest ink level of a page whose strokes are resolved; above it ink levels are not used."""
    similar_ink: tuple[float, float] = (1.3, 0.05)
    """Largest ink level in a shadow as a factor and a summand of that elsewhere: in a shadow the ratio of ink to paper
    is the same as in full light. In a picture the ratio of dark to light is larger."""
    other_ink: tuple[float, float] = (1.5, 0.1)
    """Largest level of ink, as a factor and a summand; lighter print is not ink."""
    shadow_share: float = 0.9
    """Least share with similar ink for a dark part to count as a shadow."""
    picture_share: float = 0.5
    """Least share without any ink for a dark part at the page's border to count as a picture."""
    holes: float = 1 / 24
    """Largest width of bright parts within a picture, for example of white print."""
    ring: float = 1 / 60
    """Width of the rings inside and outside of a dark part, in which its edge is measured."""
    edge: float = 0.07
    """Least step of the level's logarithm across the rings: a picture's edge is sharp. Without this step near the
    border, a dark part is uneven light."""
    sure_edge: float = 0.3
    """Least share of the rings inside photos; below it nothing is known about the edge."""
    box_share: float = 0.8
    """A picture that covers this share of its upright bounding box is extended to the box; the rest is bright parts."""
    rim: float = 1 / 100
    """Margin around a picture in which the background is not yet that of paper."""


def find_pictures(levels: Levels, inner: Mask | None = None) -> Mask:
    """Mask (h, w as the levels) of pictures on the page, even where their levels look like those of paper.

    A picture is darker than the surrounding paper, and so is a shadow inside the page. In a shadow, however, ink
    darkens in proportion to paper. A dark part at the page's border is a picture only if its ink indicates it. An edge
    is reliable where `inner` (of any size) is true, inside a photo. At the borders of photos it may be a difference of
    their light.
    """
    p = PictureParameters()
    height, width = levels.paper.shape
    long_side = max(height, width)
    window = _odd(p.window * long_side)
    amid = _dark_amid_paper(levels.paper, window, p.darkest_paper, to_border=False)
    to_border = _dark_amid_paper(levels.paper, window, p.darkest_paper, to_border=True)
    plain = ~to_border & (levels.measured > 0.5) & (levels.ink > 0)
    ink = float(np.median(levels.ink[plain])) if plain.any() else 1.0
    resolved = 0.0 < ink <= p.largest_paper_ink
    # Paper in a shadow has similar ink everywhere; in a picture only some places look like paper with ink.
    is_similar = (
        resolved & (levels.measured > 0.5) & (levels.ink <= p.similar_ink[0] * ink + p.similar_ink[1])
    )
    is_other = resolved & (levels.ink > p.other_ink[0] * ink + p.other_ink[1])
    holes, rim = _odd(p.holes * long_side), _odd(2 * p.rim * long_side)
    ring = _odd(p.ring * long_side)
    amid_parts, amid_count = _parts(amid, holes)
    sure = np.ones((height, width), bool)
    if inner is not None:
        sure = cv2.resize(inner.astype(np.uint8), (width, height), interpolation=cv2.INTER_NEAREST) > 0
    is_picture = _edges(np.log(levels.paper), amid_parts, amid_count, ring, sure, p.sure_edge) >= p.edge
    is_picture &= _shares(amid_parts, amid_count, is_similar) <= p.shadow_share
    is_picture[0] = False
    cut_parts, cut_count = _parts(to_border, holes)
    is_cut_picture = _shares(cut_parts, cut_count, is_other) >= p.picture_share
    is_cut_picture[0] = False
    found = (is_picture[amid_parts] | is_cut_picture[cut_parts]).astype(np.uint8)
    _, _, boxes, _ = cv2.connectedComponentsWithStats(found)
    for left, top, across, down, area in boxes[1:]:
        if area >= p.box_share * across * down:
            found[top : top + down, left : left + across] = 1
    grown = cv2.dilate(found, np.ones((rim, rim), np.uint8))
    return np.asarray(grown > 0)


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


def _shares(parts: NDArray[np.int32], count: int, evidence: Mask) -> Floats:
    """Share of `evidence` in each part (count,)."""
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

"""Choice of a photo for each cell of the mosaic; a word is taken from one photo (4.4)."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import GrayImage, Mask
from services.imaging.components import label_components
from services.mosaic.composition.patch_drawing import FloatMap, Rectangle
from services.mosaic.composition.sharpness import PatchMaps, compare_sharpness
from services.mosaic.composition.word_counts import count_votes, take_words

Labels = NDArray[np.int16]
"""(rows, columns) index of a photo in the input sequence, -1 where no photo shows anything."""


# Lengths in text heights.
STEPS = (
    (0.28, 0.14, 0.0),
    (0.14, 0.1, 0.0),
    (0.0, 0.0, 0.0),
    (0.0, 0.0, 0.5),
    (0.0, 0.0, 0.75),
)
"""Per step: dilation of print across and down, and the least strength of print, 0-1. With a dilation of at most
half the gap between words, and half that between lines, components are mostly words. A component that no photo
shows completely is split by the next step, with less dilation, finally into dark parts of letters."""
BORDER_BONUS = 0.15
"""Bonus on sharpness far from the photo's border. Between about equally sharp photos the distance to the border
then decides, which is a smooth function."""
BORDER_DISTANCE = 10.0
"""Distance to the border with half of the bonus."""
WORD_HEIGHT = 3.5
"""Largest height of a word, including headings; a higher component is a picture, a table, or merged lines."""
WORD_ASPECT = 6.0
"""Largest ratio of width to height of a word; a wider component is several words."""
RULE_LENGTH = 6.0
"""Length from which a thin line is a rule; rules would connect words."""


@dataclass(frozen=True, slots=True, eq=False)
class Decisions:
    """The photo chosen for each cell of the mosaic.

    `labels` is (rows, columns). `whole` marks cells of components (print and its margin) taken from one photo;
    `broken` marks printed cells of other components: a picture, a rule, a word that no photo shows completely.
    """

    labels: Labels
    whole: Mask
    broken: Mask


def unite_ink(maps: Sequence[PatchMaps], rows: int, columns: int) -> GrayImage:
    """Strength of the print in any photo: the maximum over the photos.

    It contains everything that a threshold on the average image would (4.4), for any number of overlapping photos.
    """
    ink = np.zeros((rows, columns), np.uint8)
    page = Rectangle(0, 0, columns, rows)
    for patch in maps:
        part = ink[patch.box.within(page)]
        cv2.max(part, patch.ink, dst=part)
    return ink


def decide_cells(maps: Sequence[PatchMaps], ink: GrayImage, text_height: float) -> Labels:
    """The sharpest photo of each single cell; among equally sharp photos, the one whose border is farther away."""
    page = Rectangle(0, 0, ink.shape[1], ink.shape[0])
    labels = np.full(ink.shape, -1, np.int16)
    best = np.zeros(ink.shape, np.float32)
    for number, patch in enumerate(maps):
        if patch.covered.size == 0:
            continue
        at = patch.box.within(page)
        far = patch.inset / (patch.inset + np.float32(BORDER_DISTANCE * text_height))
        score = compare_sharpness(patch, ink, text_height) * (1 + np.float32(BORDER_BONUS) * far)
        # Without print only the distance decides. A cell that a photo shows partly is used if no photo shows it better.
        score += np.float32(1e-3) * (1 + far)
        score *= patch.covered.astype(np.float32) / 255
        better = score > best[at]
        best[at][better] = score[better]
        labels[at][better] = number
    return labels


def decide_words(maps: Sequence[PatchMaps], ink: GrayImage, cells: Labels, text_height: float) -> Decisions:
    """Choose one photo for each component of print: the majority of its `cells`, among photos that show all of it.

    A component that no photo shows completely is split by less dilation. So is a component of several words if the
    majority's photo does not show all of it. The remaining cells keep their own choice.
    """
    labels, whole = cells.copy(), np.zeros(ink.shape, bool)
    printed = np.asarray(ink > 0)
    todo = np.asarray(printed & ~_rules(printed, RULE_LENGTH * text_height))
    last = len(STEPS) - 1
    for number, (across, down, strength) in enumerate(STEPS):
        if strength > 0:
            todo = np.asarray(_thin(todo, text_height) & (ink > 255 * strength))
        kernel = np.ones((2 * _reach(down, text_height) + 1, 2 * _reach(across, text_height) + 1), np.uint8)
        mask = np.asarray(cv2.dilate(todo.astype(np.uint8), kernel), np.uint8)
        count, components, stats, _ = label_components(mask)
        votes, shown = count_votes(maps, components, count, cells)
        held = np.where(shown == stats[:, cv2.CC_STAT_AREA][:, None], votes, -1)
        choice = held.argmax(axis=1)
        decided = held.max(axis=1) >= 0
        if number < last:
            width, height = stats[:, cv2.CC_STAT_WIDTH], stats[:, cv2.CC_STAT_HEIGHT]
            word = (height <= WORD_HEIGHT * text_height) & (width <= WORD_ASPECT * height)
            decided &= (held.max(axis=1) == votes.max(axis=1)) | (word & (number > 0))
        decided[0] = False
        take_words(components, np.where(decided, choice, -1).astype(np.int16), labels, whole, todo)
        if not todo.any():
            break
    broken = np.asarray(printed & ~whole)
    _widen(maps, labels, whole)
    return Decisions(labels, whole, broken)


def _widen(maps: Sequence[PatchMaps], labels: Labels, whole: Mask) -> None:
    """Extend components by one cell if no other component claims it, for serifs too thin to count as ink."""
    page = Rectangle(0, 0, labels.shape[1], labels.shape[0])
    claims, claimant = np.zeros(labels.shape, np.uint8), np.zeros(labels.shape, np.int16)
    for number, patch in enumerate(maps):
        at = patch.box.within(page)
        own = (whole[at] & (labels[at] == number)).astype(np.uint8)
        if not own.any():
            continue
        grown = (cv2.dilate(own, np.ones((3, 3), np.uint8)) > 0) & (patch.covered == 255) & ~whole[at]
        claims[at] += grown
        claimant[at][grown] = number
    free = claims == 1
    labels[free] = claimant[free]
    whole |= free


def _reach(length: float, text_height: float) -> int:
    """`length` in cells, rounded; at least one if it is positive."""
    return max(round(length * text_height), 1) if length > 0 else 0


def _rules(printed: Mask, length: float) -> Mask:
    """Mask of long thin lines, across or down."""
    ink = printed.astype(np.uint8)
    side = max(round(length), 2)
    thick = cv2.morphologyEx(ink, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
    thick = cv2.dilate(thick, np.ones((3, 3), np.uint8))
    across = cv2.morphologyEx(ink, cv2.MORPH_OPEN, np.ones((1, side), np.uint8))
    down = cv2.morphologyEx(ink, cv2.MORPH_OPEN, np.ones((side, 1), np.uint8))
    return np.asarray((cv2.max(across, down) > 0) & (thick == 0))


def fade_weights(
    maps: Sequence[PatchMaps], decisions: Decisions, text_height: float, fade: float
) -> list[GrayImage]:
    """Weight (0-255) of each photo in the cells of its box; between photos weights change over `fade` text heights.

    Near print the transition is one cell wide, so that no letter is drawn from two photos.
    """
    page = Rectangle(0, 0, decisions.labels.shape[1], decisions.labels.shape[0])
    near_print = (decisions.whole | _thin(decisions.broken, text_height)).astype(np.uint8)
    clear = cv2.distanceTransform(1 - near_print, cv2.DIST_L2, 3)
    width = max(fade * text_height, 1.0)
    softness = np.clip((clear - 1) / width, 0, 1).astype(np.float32)
    side = 2 * round(0.5 * width) + 1
    weights = []
    for number, patch in enumerate(maps):
        at = patch.box.within(page)
        own = (decisions.labels[at] == number).astype(np.float32)
        if own.size == 0:
            weights.append(np.zeros(own.shape, np.uint8))
            continue
        soft: FloatMap = cv2.blur(cv2.blur(own, (side, side)), (side, side))
        # The weight decreases to 0 before the photo's border.
        soft *= np.clip((patch.inset - 1) / width, 0, 1)
        mixed = own + softness[at] * (soft - own)
        weights.append(np.maximum(np.round(255 * mixed), 2 * own).astype(np.uint8))
    return weights


def _thin(broken: Mask, text_height: float) -> Mask:
    """Printed cells outside of components that are not part of a picture; text has gaps, a picture has none."""
    side = max(round(2 * text_height), 3)
    pictures = cv2.morphologyEx(broken.astype(np.uint8), cv2.MORPH_OPEN, np.ones((side, side), np.uint8))
    return np.asarray(broken & (pictures == 0))

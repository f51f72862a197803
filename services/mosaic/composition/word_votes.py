"""Which photo each cell of the mosaic is taken from: words decide as a whole (4.4)."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import GrayImage, Mask
from services.mosaic.composition.patch_drawing import Rectangle
from services.mosaic.composition.sharpness import FloatMap, PatchMaps, compare_sharpness

Labels = NDArray[np.int16]
"""(rows, columns) place of a photo in the sequence, -1 where none shows anything."""


@dataclass(frozen=True, slots=True)
class VoteParameters:
    """Lengths in text heights."""

    steps: tuple[tuple[float, float, float], ...] = (
        (0.28, 0.14, 0.0),
        (0.14, 0.1, 0.0),
        (0.0, 0.0, 0.0),
        (0.0, 0.0, 0.5),
        (0.0, 0.0, 0.75),
    )
    """Across and down, by which print is dilated, and the least strength of it, 0-1. Dilated by half the gap between
    words and half that between lines at most, components are mostly words. What no photo shows whole falls apart at
    lesser dilation, then into the dark parts of letters and lines that touch."""
    border_bonus: float = 0.15
    """How much sharper a photo seems far from its border: of about equally sharp photos the border's distance then
    decides, which is smooth."""
    border_distance: float = 10.0
    """Where half of the bonus is won."""
    word_height: float = 3.5
    """What is higher is no word, even of a heading: a picture, a table, merged lines."""
    word_aspect: float = 6.0
    """What is wider than this many heights is several words."""
    rule_length: float = 6.0
    """Thin lines longer than this tie words together."""


@dataclass(frozen=True, slots=True, eq=False)
class Decisions:
    """Where the mosaic's cells are taken from.

    `labels` (rows, columns); `whole` marks the cells of components (print with its margin) that were decided as one,
    `broken` printed cells of no such component: a picture, a rule, a word that no photo shows whole.
    """

    labels: Labels
    whole: Mask
    broken: Mask


def unite_ink(maps: Sequence[PatchMaps], rows: int, columns: int) -> GrayImage:
    """Strength of the print, where any photo shows any.

    This holds all that a threshold on the average image would (4.4), also ghosts, however many photos overlap.
    """
    ink = np.zeros((rows, columns), np.uint8)
    page = Rectangle(0, 0, columns, rows)
    for patch in maps:
        part = ink[patch.box.within(page)]
        cv2.max(part, patch.ink, dst=part)
    return ink


def decide_cells(
    maps: Sequence[PatchMaps], ink: GrayImage, text_height: float, parameters: VoteParameters | None = None
) -> Labels:
    """The sharpest photo of each cell, by itself; among equals the one whose border is far."""
    p = parameters or VoteParameters()
    page = Rectangle(0, 0, ink.shape[1], ink.shape[0])
    labels = np.full(ink.shape, -1, np.int16)
    best = np.zeros(ink.shape, np.float32)
    for number, patch in enumerate(maps):
        if patch.covered.size == 0:
            continue
        at = patch.box.within(page)
        far = patch.inset / (patch.inset + np.float32(p.border_distance * text_height))
        score = compare_sharpness(patch, ink, text_height) * (1 + np.float32(p.border_bonus) * far)
        # Nothing printed: the distance alone. A cell that is not wholly shown: only if nobody shows it better.
        score += np.float32(1e-3) * (1 + far)
        score *= patch.covered.astype(np.float32) / 255
        better = score > best[at]
        best[at][better] = score[better]
        labels[at][better] = number
    return labels


def decide_words(
    maps: Sequence[PatchMaps],
    ink: GrayImage,
    cells: Labels,
    text_height: float,
    parameters: VoteParameters | None = None,
) -> Decisions:
    """Every component of print is taken from the photo that most of its `cells` vote for, among those that hold it.

    A component that no photo shows whole falls apart at lesser dilation; so does one of several words where its
    majority's choice does not hold it all. What is left keeps the decisions of its cells.
    """
    p = parameters or VoteParameters()
    labels, whole = cells.copy(), np.zeros(ink.shape, bool)
    printed = np.asarray(ink > 0)
    todo = np.asarray(printed & ~_rules(printed, p.rule_length * text_height))
    last = len(p.steps) - 1
    for number, (across, down, strength) in enumerate(p.steps):
        if strength > 0:
            todo = np.asarray(_thin(todo, text_height) & (ink > 255 * strength))
        kernel = np.ones((2 * _reach(down, text_height) + 1, 2 * _reach(across, text_height) + 1), np.uint8)
        mask = np.asarray(cv2.dilate(todo.astype(np.uint8), kernel), np.uint8)
        count, found, stats, _ = cv2.connectedComponentsWithStats(mask, connectivity=8, ltype=cv2.CV_32S)
        components = np.asarray(found, np.int32)
        votes, shown = _votes(maps, components, count, cells, mask)
        held = np.where(shown == stats[:, cv2.CC_STAT_AREA][:, None], votes, -1)
        choice = held.argmax(axis=1)
        decided = held.max(axis=1) >= 0
        if number < last:
            width, height = stats[:, cv2.CC_STAT_WIDTH], stats[:, cv2.CC_STAT_HEIGHT]
            word = (height <= p.word_height * text_height) & (width <= p.word_aspect * height)
            decided &= (held.max(axis=1) == votes.max(axis=1)) | (word & (number > 0))
        decided[0] = False
        chosen = decided[components]
        labels[chosen] = choice[components[chosen]]
        whole |= chosen
        todo &= ~chosen
        if not todo.any():
            break
    broken = np.asarray(printed & ~whole)
    _widen(maps, labels, whole)
    return Decisions(labels, whole, broken)


def _widen(maps: Sequence[PatchMaps], labels: Labels, whole: Mask) -> None:
    """Give components another cell of margin where no other photo's is claimed: for serifs too fine to be ink."""
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
    """In cells; what reaches at all reaches one."""
    return max(round(length * text_height), 1) if length > 0 else 0


def _rules(printed: Mask, length: float) -> Mask:
    """Long thin lines, across or down."""
    ink = printed.astype(np.uint8)
    side = max(round(length), 2)
    thick = cv2.morphologyEx(ink, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
    thick = cv2.dilate(thick, np.ones((3, 3), np.uint8))
    across = cv2.morphologyEx(ink, cv2.MORPH_OPEN, np.ones((1, side), np.uint8))
    down = cv2.morphologyEx(ink, cv2.MORPH_OPEN, np.ones((side, 1), np.uint8))
    return np.asarray((cv2.max(across, down) > 0) & (thick == 0))


def _votes(
    maps: Sequence[PatchMaps], components: NDArray[np.int32], count: int, cells: Labels, mask: GrayImage
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Per component (count) and photo (len(maps)): the cells that chose it, and those that it shows wholly."""
    photos = len(maps)
    page = Rectangle(0, 0, components.shape[1], components.shape[0])
    voters = (mask > 0) & (cells >= 0)
    ballot = components[voters].astype(np.int64) * photos + cells[voters]
    votes = np.bincount(ballot, minlength=count * photos).reshape(count, photos)
    shown = np.zeros((count, photos), np.int64)
    for number, patch in enumerate(maps):
        at = patch.box.within(page)
        seen = (patch.covered == 255) & (mask[at] > 0)
        shown[:, number] = np.bincount(components[at][seen], minlength=count)
    return votes, shown


def fade_weights(
    maps: Sequence[PatchMaps], decisions: Decisions, text_height: float, fade: float
) -> list[GrayImage]:
    """Weight (0-255) of each photo in the cells of its box; decided borders fade over `fade` text heights.

    Near print they are as sharp as one cell, so that no letter is drawn from two photos.
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
        # A photo is faded out before it ends.
        soft *= np.clip((patch.inset - 1) / width, 0, 1)
        mixed = own + softness[at] * (soft - own)
        weights.append(np.maximum(np.round(255 * mixed), 2 * own).astype(np.uint8))
    return weights


def _thin(broken: Mask, text_height: float) -> Mask:
    """Of print that was not decided as one: what is not part of a picture, which has no gaps as text has."""
    side = max(round(2 * text_height), 3)
    pictures = cv2.morphologyEx(broken.astype(np.uint8), cv2.MORPH_OPEN, np.ones((side, side), np.uint8))
    return np.asarray(broken & (pictures == 0))

"""The sheet of paper around the text: its brightness, hue and outline."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from services.arrays import Floats, Mask, Points, RgbImage
from services.geometry.homographies import from_resized, to_resized
from services.imaging.channels import SUMS, sum_of_channels
from services.imaging.illumination import PRINT_SHARE
from services.imaging.reduction import GROUND_PX, Halves, reduce_image
from services.robust import cauchy_weights, fit_reweighted, narrowing


@dataclass(frozen=True, slots=True)
class PaperParameters:
    """Contrasts are differences of the logarithm of brightness; hues are distances in a, b of CIE Lab."""

    long_side_px: int = GROUND_PX
    opening: float = 1 / 40
    """Of the long side: bridges to other bright things are narrower."""
    contrast: float = 0.4
    chroma: float = 16.0
    text_contrast: float = 0.8
    text_chroma: float = 40.0
    """Characters whose ground differs from the paper's by more lie on something else."""
    part_share: float = 0.05
    """Of the text, a part of a divided sheet holds at least this share."""
    text_share: float = 0.96
    """Least share of the text that the sheet must contain; else its outline is rejected."""


SHEET_SHARE = 0.12
"""Of the text, a sheet beside another one holds at least this share."""
SOLID = 0.9
"""Least area of a sheet over that of its convex hull: parts of one creased sheet have up to 0.84 on one side."""
APART = 0.92
"""Largest area of two sheets over that of their common hull. A dark fold leaves more, two sheets side by side 0.76."""
GROUND = 0.1
"""Largest share of the strip between two sheets that is like their paper."""


_LOG_OF_SUM = np.log(np.arange(SUMS, dtype=np.float64) / 3 + 1.0)
"""Logarithm of a brightness by the sum of its channels."""


Window = tuple[float, float, float, float]
"""A part (left, top, right, bottom) of a photo, in its pixels."""


@dataclass(frozen=True, slots=True, eq=False)
class Sheet:
    """One of several sheets in a photo: which of N characters lie on it, and a part of the photo that shows it whole.

    `window` ends half-way to the other sheets.
    """

    holds: NDArray[np.bool_]
    window: Window


@dataclass(frozen=True, slots=True, eq=False)
class Paper:
    """How far every pixel of the photo, resized by `factor`, is from paper, (rows, columns) each.

    `contrast` compares its brightness with a smooth surface through all the text (which separates text on paper
    from text on a desk), `near_contrast` with the paper at the nearest text (which follows the edge of a cast
    shadow), `chroma` is the distance of its hue.
    """

    contrast: Floats
    near_contrast: Floats
    chroma: Floats
    factor: float

    def _pixels(self, points: Points) -> tuple[NDArray[np.int_], NDArray[np.int_]]:
        at = np.round((points + 0.5) * self.factor - 0.5).astype(int)
        rows, columns = self.contrast.shape
        return np.clip(at[:, 1], 0, rows - 1), np.clip(at[:, 0], 0, columns - 1)

    def holds(self, points: Points, parameters: PaperParameters | None = None) -> NDArray[np.bool_]:
        """Which `points` (N, 2), photo pixels, lie on ground that may be the paper (tinted boxes included)."""
        p = parameters or PaperParameters()
        at = self._pixels(points)
        return np.asarray((np.abs(self.contrast[at]) < p.text_contrast) & (self.chroma[at] < p.text_chroma))

    def outline(self, text_points: Points, parameters: PaperParameters | None = None) -> Points | None:
        """Outline (N, 2) in photo pixels of the sheet that holds the text; None if its edge cannot be determined."""
        p = parameters or PaperParameters()
        mask = self._sheet(text_points, p)
        if mask is None:
            return None
        contours, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
        outline = max(contours, key=len)[:, 0, :].astype(np.float64)
        return from_resized(outline, self.factor)

    def hull(self, text_points: Points) -> Points | None:
        """Convex hull (N, 2), photo pixels, of all paper that holds text: a sheet that a picture divides.

        None when it is nearly all of the photo.
        """
        p = PaperParameters()
        _, labels, _ = self._parts(p)
        found = labels[self._pixels(text_points)]
        counts = np.bincount(found, minlength=int(labels.max()) + 1)
        counts[0] = 0
        mask = (counts >= p.part_share * len(found))[labels] & (labels > 0)
        if not mask.any():
            return None
        hull = cv2.convexHull(row_ends(mask))
        if cv2.contourArea(hull) >= 0.97 * mask.size:
            return None
        return from_resized(hull[:, 0, :].astype(np.float64), self.factor)

    def sheets(self, text_points: Points) -> list[Sheet]:
        """The sheets that lie side by side, the one with most of the `text_points` (N, 2), photo pixels, first.

        Between two of them lies the ground that is also round them: a picture that divides a page is unlike that. Empty
        where all paper with text may be one sheet.
        """
        p = PaperParameters()
        alike, labels, kernel = self._parts(p)
        at = self._pixels(text_points)
        counts = np.bincount(labels[at][labels[at] > 0], minlength=1)
        most = [
            k
            for k in np.argsort(-counts, kind="stable")
            if counts[k] >= max(SHEET_SHARE * len(text_points), 1)
        ]
        if len(most) < 2:
            return []
        parts = [_filled_hull(labels == k) for k in most]
        solid = [hull for hull, solidity in parts if solidity >= SOLID]
        hulls = [
            hull
            for k, hull in enumerate(solid)
            if all(self._is_between(hull, each, alike) for each in solid[:k])
        ]
        if len(hulls) < 2:
            return []
        sheets = []
        for own in hulls:
            others = [hull for hull in hulls if hull is not own]
            reach = cv2.dilate(own.astype(np.uint8), kernel).astype(bool) & ~np.any(others, axis=0)
            low, high = from_resized(_window(own, others).reshape(2, 2) - 0.5, self.factor)
            sheets.append(Sheet(np.asarray(reach[at]), (*low.tolist(), *high.tolist())))
        return sheets

    def _is_between(self, a: Mask, b: Mask, alike: Mask) -> bool:
        """Whether two sheets (filled convex hulls) lie apart, with the ground between them that is round them too."""
        p = PaperParameters()
        if (a & b).any():
            return False
        both, _ = _filled_hull(a | b)
        strip = both & ~a & ~b
        round_both = cv2.dilate(both.astype(np.uint8), np.ones((9, 9), np.uint8)).astype(bool) & ~both
        if (a.sum() + b.sum()) > APART * both.sum() or not strip.any() or not round_both.any():
            return False
        if alike[strip].mean() > GROUND:
            return False
        return all(
            abs(float(np.median(values[strip])) - float(np.median(values[round_both]))) < limit
            for values, limit in ((self.contrast, p.contrast), (self.chroma, p.chroma))
        )

    def _parts(self, p: PaperParameters) -> tuple[Mask, NDArray[np.int32], NDArray[np.uint8]]:
        """What is like the paper, its parts without narrow bridges (labels, 0 for none), and the kernel of that."""
        alike = (np.abs(self.near_contrast) < p.contrast) & (self.chroma < p.chroma)
        side = max(int(p.opening * max(alike.shape)) | 1, 3)
        kernel = np.asarray(cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side)), np.uint8)
        opened = cv2.morphologyEx(alike.astype(np.uint8), cv2.MORPH_OPEN, kernel)
        _, labels = cv2.connectedComponents(opened)
        return np.asarray(alike), np.asarray(labels, np.int32), kernel

    def _sheet(self, text_points: Points, p: PaperParameters) -> Mask | None:
        alike, labels, kernel = self._parts(p)
        found = labels[self._pixels(text_points)]
        if not (found > 0).any():
            return None
        label = int(np.bincount(found[found > 0]).argmax())
        # What the opening took from corners comes back; bridges stay cut.
        body = cv2.dilate((labels == label).astype(np.uint8), kernel).astype(bool)
        mask = np.asarray(body & alike)
        return mask if (found == label).mean() >= p.text_share and mask.mean() < 0.97 else None


def _window(own: Mask, others: Sequence[Mask]) -> NDArray[np.float64]:
    """The part (left, top, right, bottom) of a mask's image that ends half-way to each of the others."""
    window = np.array([0, 0, *own.shape[::-1]], np.float64)
    low, high = _ends(own)
    for other in others:
        first, last = _ends(other)
        gaps = np.concatenate([low - last, first - high])  # to what lies left, above, right, below
        side = int(np.argmax(gaps))
        ends = (low, high)[side // 2][side % 2], (last, first)[side // 2][side % 2]
        window[side] = (max if side < 2 else min)(window[side], sum(ends) / 2)
    return window


def _ends(mask: Mask) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Left and top, right and bottom of what a mask holds."""
    at = np.argwhere(mask)[:, ::-1]
    return at.min(axis=0).astype(np.float64), at.max(axis=0) + 1.0


def row_ends(mask: Mask) -> NDArray[np.int32]:
    """First and last pixels (N, 2) of the rows of a mask, row by row: its hull is theirs."""
    rows = np.flatnonzero(mask.any(axis=1))
    held = mask[rows]
    ends = np.stack([held.argmax(axis=1), mask.shape[1] - 1 - held[:, ::-1].argmax(axis=1)], axis=1)
    return np.stack([ends.ravel(), np.repeat(rows, 2)], axis=1).astype(np.int32)


def _filled_hull(mask: Mask) -> tuple[Mask, float]:
    """The convex hull of a mask, filled, and the mask's area over the hull's."""
    points = row_ends(mask)
    filled = np.zeros(mask.shape, np.uint8)
    cv2.fillConvexPoly(filled, cv2.convexHull(points), 1)
    return filled.astype(bool), float(mask.sum()) / max(int(filled.sum()), 1)


def model_paper(
    photo: RgbImage | Halves, text_points: Points, parameters: PaperParameters | None = None
) -> Paper:
    """Paper round `text_points` (N, 2) in `photo` (H, W, 3).

    The photo is reduced and freed of print by a closing. The paper's brightness is known at the text and
    continued from there, its hue is the text's median.
    """
    p = parameters or PaperParameters()
    halves = Halves.of(photo)
    factor = min(1.0, p.long_side_px / max(halves.image.shape[:2]))
    small = reduce_image(halves, factor, least_side_px=8)
    size = (small.shape[1], small.shape[0])
    side = max(int(PRINT_SHARE * max(size)) | 1, 3)
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side))
    blank = np.asarray(cv2.medianBlur(cv2.morphologyEx(small, cv2.MORPH_CLOSE, kernel), 5), np.uint8)
    at = np.clip(np.round(to_resized(text_points, factor)).astype(int), 0, [size[0] - 1, size[1] - 1])
    log_brightness = _LOG_OF_SUM[sum_of_channels(blank)]
    _, a, b = cv2.split(cv2.cvtColor(blank, cv2.COLOR_RGB2LAB))
    a, b = (hues - float(np.median(hues[at[:, 1], at[:, 0]])) for hues in (a, b))
    chroma = np.sqrt(a * a + b * b)
    contrast = log_brightness - continue_smoothly(log_brightness, at)
    on_paper = (np.abs(contrast[at[:, 1], at[:, 0]]) < p.text_contrast) & (
        chroma[at[:, 1], at[:, 0]] < p.text_chroma
    )
    near = log_brightness - continue_nearest(log_brightness, at[on_paper] if on_paper.any() else at)
    return Paper(contrast, near, chroma, factor)


def continue_nearest(values: Floats, at: NDArray[np.int_]) -> Floats:
    """Image (rows, columns) of the value at the nearest of the pixels `at` (N, 2), a little smoothed."""
    away = np.ones(values.shape, bool)
    away[at[:, 1], at[:, 0]] = False
    rows, columns = distance_transform_edt(away, return_distances=False, return_indices=True)
    side = max(values.shape) // 40 | 1
    return np.asarray(cv2.blur(values[rows, columns], (side, side)))


def continue_smoothly(values: Floats, at: NDArray[np.int_]) -> Floats:
    """Quadratic surface over an image (rows, columns) through its values at the pixels `at` (N, 2), robustly."""
    rows, columns = values.shape
    unit = max(rows, columns) / 2

    def terms(x: Floats, y: Floats) -> Floats:
        u, v = (x - columns / 2) / unit, (y - rows / 2) / unit
        return np.stack([np.ones_like(u), u, v, 0.5 * u * u, u * v, 0.5 * v * v], axis=-1)

    design = terms(at[:, 0].astype(np.float64), at[:, 1].astype(np.float64))
    value = values[at[:, 1], at[:, 0]]
    # Curvature is damped, since it grows quadratically where there is no text to hold it.
    damping = np.diag([1e-6, 0.01, 0.01, 0.1, 0.1, 0.1]) * len(at)
    level = np.array([np.median(value), 0, 0, 0, 0, 0.0])
    c = fit_reweighted(
        design, value, cauchy_weights, narrowing(0.3, 0.6, 0.08), 8, start=level, damping=damping
    )
    # Row by column: the products over the whole image are two.
    x, y = np.arange(columns, dtype=np.float64), np.arange(rows, dtype=np.float64)
    across, down = terms(x, np.full_like(x, rows / 2)) @ c, terms(np.full_like(y, columns / 2), y) @ c
    u, v = (x - columns / 2) / unit, (y - rows / 2) / unit
    return np.asarray(across + (down - c[0])[:, None] + np.multiply.outer(c[4] * v, u))

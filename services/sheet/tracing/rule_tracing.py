"""Straight print that is no text, traced in a flat view: staff lines, rules of tables, underlines, frames.

A rule is a thin dark stroke that goes on without gaps. Darkness is averaged over short windows along the text's
direction; thin ridges of neighbouring windows are linked, as those of text lines are. Long chains of ink without gaps
are rules: each is one line, which is straight on the flat page.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from services.arrays import Floats, GrayImage, Points, Vector
from services.geometry.page_map import PageMap
from services.geometry.photo_frame import PhotoFrame
from services.imaging.node_grid import take_values
from services.sheet.developable.observations import NO_LINES, LineObservations
from services.sheet.tracing.baselines import MIN_LENGTH
from services.sheet.tracing.line_tracing import sampling_maps
from services.sheet.tracing.page_text import MOST_PIXELS, TracedText
from services.sheet.tracing.profile_tracing import ProfileParameters, Ridges, darkness_of, link_ridges

# Lengths with `px` are pixels of the reduced photo, where rules are one to three wide; others are text heights.
BEYOND = 0.15
"""Rules are searched this far beyond the text, as a share of its extent."""
WINDOW_PX = 11
"""Of one average: a rule at ten degrees rises by two pixels in it."""
HALF_WIDTH_PX = 3
"""At this distance on both sides of a rule's middle there is paper; staff lines are at least twice as far apart."""
CONTRAST = 0.08
"""Least darkness of a ridge above both sides (0-1)."""
SPACING_PX = 6.0
"""Least distance of two rules: chains may move by parts of it from one window to the next."""
LINKS = ProfileParameters(drift=0.5, bend=0.4, gap=2, min_windows=12)

DARK_SHARE = 0.85
"""Of a rule's length, that has ink: lines of letters have gaps."""
INK = 0.4
"""Darkness that counts as ink, as a share of the rule's median."""
PIECE = 1.5
"""Length for each point of the observations."""
DEVIATION_PX = 0.35


@dataclass(frozen=True, slots=True, eq=False)
class FlatDarkness:
    """Darkness (H, W), 0-1, in a flat view; page point (u, v) lies at pixel (u, v) `scale` - `offset`."""

    darkness: NDArray[np.float32]
    scale: float
    offset: tuple[float, float]

    def to_page(self, pixels: Points) -> Points:
        """Page points (N, 2) of pixels (N, 2)."""
        return np.asarray((pixels + self.offset) / self.scale)


def trace_rules(text: TracedText, view: PhotoFrame, page_map: PageMap) -> LineObservations:
    """The rules along the text's direction, in centred coordinates of the photo; each is a line of its own."""
    characters, height = view.to_centred(text.characters), text.height_px / view.unit_px
    J = page_map.jacobians(characters)
    height_on_page = height * float(np.sqrt(np.nanmedian(np.abs(np.linalg.det(J)))))
    found: list[Points] = []
    for gray in (text.gray,) if text.positive is None else (text.gray, text.positive):
        flat = _flatten(gray, text.H_reduced_centred(view), page_map, characters)
        if flat is None:
            continue
        height_px = height_on_page * flat.scale
        step = max(round(PIECE * height_px / (WINDOW_PX // 2)), 1)
        for chain in _chains(flat.darkness):
            if np.ptp(chain[:, 0]) >= MIN_LENGTH * height_px and _goes_on(flat.darkness, chain):
                found.append(flat.to_page(chain[step // 2 :: step]))
    if not found:
        return NO_LINES
    index = np.repeat(np.arange(len(found)), [len(line) for line in found])
    seen = page_map.to_photo(np.concatenate(found))
    # Pixels of the reduced photo, whatever the view's scale.
    deviation = DEVIATION_PX / (text.factor * view.unit_px)
    known = np.isfinite(seen).all(axis=1)
    index = np.unique(index[known], return_inverse=True)[1].astype(np.intp)
    return LineObservations(seen[known], index, np.full(len(index), deviation), [], [], [], height)


def _flatten(
    gray: GrayImage, H_gray_centred: Floats, page_map: PageMap, characters: Points
) -> FlatDarkness | None:
    """Darkness of `gray` round the `characters` (N, 2), centred, in the flat view; None where that is not known."""
    page = page_map.to_page(characters)
    known = np.isfinite(page).all(axis=1)
    if known.sum() < 10:
        return None
    page, J = page[known], page_map.jacobians(characters[known])
    scale = float(H_gray_centred[0, 0]) / float(np.sqrt(np.nanmedian(np.abs(np.linalg.det(J)))))
    low, high = np.percentile(page, 0.5, axis=0), np.percentile(page, 99.5, axis=0)
    margin = BEYOND * (high - low)
    low, high = low - margin, high + margin
    scale = min(scale, float(np.sqrt(MOST_PIXELS / np.prod(high - low))))
    width, rows = (max(int(np.ceil(v)), 1) for v in (high - low) * scale)
    offset = (float(low[0]) * scale, float(low[1]) * scale)
    darkness = np.empty((rows, width), np.float32)
    for band, at in sampling_maps(page_map, width, rows, scale, offset, H_gray_centred):
        darkness[band] = darkness_of(take_values(gray, at, cv2.INTER_LINEAR, cv2.BORDER_CONSTANT, 255.0))
    return FlatDarkness(darkness, scale, offset)


def _chains(darkness: NDArray[np.float32]) -> list[Points]:
    """Points (N, 2), pixels, of thin ridges that are linked from window to window."""
    columns = np.arange(WINDOW_PX // 2, darkness.shape[1], WINDOW_PX // 2)
    S = cv2.blur(darkness, (WINDOW_PX, 1), borderType=cv2.BORDER_CONSTANT)[:, columns]
    S = cv2.GaussianBlur(S, (1, 5), 0.8)
    d = HALF_WIDTH_PX
    if S.shape[0] < 2 * d + 3:
        return []
    middle = S[d:-d]
    thin = middle - np.maximum(S[: -2 * d], S[2 * d :]) > CONTRAST
    peak = thin & (middle > S[d - 1 : -d - 1]) & (middle >= S[d + 1 : S.shape[0] - d + 1])
    window, row = np.nonzero(peak.T)
    row = row + d
    a, b, c = S[row - 1, window], S[row, window], S[row + 1, window]
    bend = np.minimum(a - 2 * b + c, -1e-6)
    y: Vector = row + np.clip(0.5 * (a - c) / bend, -1.0, 1.0)
    ridges = Ridges(window, y, y, y)
    return [
        np.stack([columns[window[members]].astype(np.float64), y[members]], axis=1)
        for members in link_ridges(ridges, SPACING_PX, LINKS)
    ]


def _goes_on(darkness: Floats | NDArray[np.float32], chain: Points) -> bool:
    """Whether there is ink nearly everywhere along a chain (N, 2), pixels."""
    x = np.arange(chain[0, 0], chain[-1, 0] + 1)
    y = np.interp(x, chain[:, 0], chain[:, 1])
    along = map_coordinates(darkness, [y, x], order=1, mode="nearest")
    return bool((along > INK * np.median(along)).mean() >= DARK_SHARE)

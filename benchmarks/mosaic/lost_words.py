"""Which words of a page cannot be read in a picture of it: by correlation with the page, piece by piece."""

from collections.abc import Callable, Sequence
from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.mosaic.errors import Mesh, mesh_at
from services.arrays import GrayImage
from services.imaging.node_grid import take_values
from simulation.flat_page import Page, PageWord, Points
from simulation.truth import Truth

LOST_BELOW = 0.5
"""Correlation of a piece with the page."""
_MARGIN_PX = 3
"""Paper around a word that belongs to its window, page pixels."""
_SEARCH_PX = 8
"""How far a word may lie beside its place, page pixels: the errors of bent sheets."""
_PHOTO_BLUR_PX = 1.0
"""Blur of the page for the comparison: photos are less sharp than it."""
_LEAST_CONTRAST = 12.0
"""Standard deviation of gray levels of a piece that has print in it."""

Place = Callable[[Points], Points]
"""Where points of the page (N, 2) lie in a picture; NaN where it does not show them."""


def lost_words(page: Page, picture: GrayImage, place: Place, words: Sequence[PageWord]) -> NDArray[np.bool_]:
    """Which of `words` are lost in `picture` (H, W), whose point `place(p)` shows the page's point p."""
    gray = page.image if page.image.ndim == 2 else cv2.cvtColor(page.image, cv2.COLOR_RGB2GRAY)
    soft = cv2.GaussianBlur(gray, (0, 0), _PHOTO_BLUR_PX)
    return np.array([_is_lost(np.asarray(soft, np.uint8), picture, place, word) for word in words], bool)


def place_in_photo(truth: Truth) -> Place:
    """Of a photo."""
    size = np.array([truth.camera.width, truth.camera.height])

    def place(points: Points) -> Points:
        seen = truth.page_to_photo(points)
        with np.errstate(invalid="ignore"):
            inside = ((seen >= 0) & (seen <= size - 1)).all(axis=1)
        return np.where(inside[:, None], seen, np.nan)

    return place


def place_in_mosaic(truths: Sequence[Truth], meshes: Sequence[Mesh | None]) -> Place:
    """Of a mosaic: the mean of what the meshes of the photos say that show the point."""
    placed = [
        (truth, mesh, place_in_photo(truth))
        for truth, mesh in zip(truths, meshes, strict=True)
        if mesh is not None
    ]

    def place(points: Points) -> Points:
        total, count = np.zeros_like(points), np.zeros(len(points))
        for truth, mesh, in_photo in placed:
            seen = in_photo(points)
            known = np.isfinite(seen).all(axis=1)
            if known.any():
                total[known] += mesh_at(mesh, seen[known], truth.camera.width, truth.camera.height)
                count += known
        return np.where(count[:, None] > 0, total / np.maximum(count, 1)[:, None], np.nan)

    return place


def _is_lost(page: GrayImage, picture: GrayImage, place: Place, word: PageWord) -> bool:
    x0, y0, x1, y1 = (round(side) for side in word.box)
    left, top = max(x0 - _MARGIN_PX, 0), max(y0 - _MARGIN_PX, 0)
    true = page[top : y1 + _MARGIN_PX + 1, left : x1 + _MARGIN_PX + 1]
    height, width = true.shape
    x, y = np.arange(-_SEARCH_PX, width + _SEARCH_PX), np.arange(-_SEARCH_PX, height + _SEARCH_PX)
    grid = np.stack(np.meshgrid(left + x, top + y), axis=-1).astype(np.float64)
    at = place(grid.reshape(-1, 2)).reshape(grid.shape)
    if not np.isfinite(at).all():
        at = np.where(np.isfinite(at), at, -1e6)
    places = np.ascontiguousarray(at, np.float32)
    seen = take_values(picture, places, cv2.INTER_LINEAR, cv2.BORDER_REPLICATE)
    match = cv2.matchTemplate(seen.astype(np.float32), true.astype(np.float32), cv2.TM_CCOEFF_NORMED)
    _, _, _, (dx, dy) = cv2.minMaxLoc(np.nan_to_num(match))
    found = seen[dy : dy + height, dx : dx + width].astype(np.float64)
    pieces = max(round(width / height), 1)
    ends = np.round(np.linspace(0, width, pieces + 1)).astype(int)
    for a, b in pairwise(ends):
        wanted = true[:, a:b].astype(np.float64)
        if wanted.std() > _LEAST_CONTRAST and _correlation(wanted, found[:, a:b]) < LOST_BELOW:
            return True
    return False


def _correlation(one: NDArray[np.float64], other: NDArray[np.float64]) -> float:
    a, b = one - one.mean(), other - other.mean()
    norm = float(np.sqrt(np.sum(a * a) * np.sum(b * b)))
    return float(np.sum(a * b)) / norm if norm > 0 else 0.0

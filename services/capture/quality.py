"""Figures of a photo that decide whether its text can be read: size of print, blur, contrast, missing text, light."""

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from services.arrays import Floats, GrayImage, Mask, Points, Vector
from services.capture.letter_size import measure_letter_rows, text_axes
from services.capture.print_patches import choose_windows, measure_patches
from services.capture.stroke_detail import measure_strokes
from services.imaging.reduction import reduce_image
from services.order_statistics import median

_PATCHES = 100
"""Characters that are looked at; more do not change the medians."""
_CELLS = 6
"""Of the grid on which the least text height is found, along each side."""
_CELL_CHARACTERS = 8
_CUT_HEIGHTS = 0.6
"""A character whose centre is this near to the photo's border is cut off."""
_OBLIQUE_COS = 0.259
"""Cosine of 75 degrees; strokes seen more obliquely run together."""
_GLARE_LEVEL = 251
_SHADOW_LEVEL = 10
_BLOB_HEIGHTS = 2.0
"""Glare and shadow are larger than this; smaller bright and dark parts are paper and ink."""
_WHITE_PAPER = 0.05
"""Share of the surroundings of a usual character that is at the highest level, from which paper is so, and glare is not
told from it: pages of files have 0.12 to 0.46, photos 0.00."""
_SHOWS_PRINT = 0.5
"""Of the page's usual density of characters, with which a white part hides none."""
_AREA_SIDE_PX = 800
"""Long side of the image on which glare and shadow are measured."""


FEWEST_EDGES = 5
SHARP_PX = 0.7
"""Blur of a sharp photo; less is not measured."""
UNEVEN = 1.6
"""A third that is more blurred than the sharpest by this factor is out of focus."""


@dataclass(frozen=True, slots=True)
class CaptureQuality:
    """Figures of one photo of a page; lengths are in pixels of the photo, shares 0-1.

    `text_height_min_px` is that of the smallest or farthest print on the page. `blur_px` is the standard deviation of
    the blur of edges, `worst_blur_px` that in the direction of the worst: motion blurs one direction only. `contrast`
    is that of ink against the paper next to it, `noise` the standard deviation of the paper as a share of that step.
    `cut_off_fraction` is the share of the characters at the photo's border or seen at more than 75 degrees.
    `blurred_side` names the part of the photo that is less sharp than the rest, if there is one. `letter_px` is the
    height of small letters by the rows of text, which blur does not change; `line_tilt_rad` is the mean angle of these
    rows to the flat page's; `detail_across` and `detail_least` are what is left of the strokes' detail
    (`StrokeDetail`). `paper_level` is the gray level of the paper next to the print, 0-255.
    """

    text_height_min_px: float
    text_height_median_px: float
    blur_px: float
    contrast: float
    cut_off_fraction: float
    glare_fraction: float
    shadow_fraction: float
    blurred_side: str | None = None
    worst_blur_px: float = 0.0
    noise: float = 0.0
    letter_px: float = 1.0
    line_tilt_rad: float = 0.0
    detail_across: float = 1.0
    detail_least: float = 1.0
    paper_level: float = 255.0

    def enlarged(self, factor: int) -> "CaptureQuality":
        """Figures of the photo that is `factor` times as large as the one that was measured, by area averages."""

        def before(blur_px: float) -> float:
            # An average over n pixels blurs as much as a Gaussian of variance (n^2 - 1) / 12.
            return float(np.sqrt(max(factor**2 * blur_px**2 - (factor**2 - 1) / 12, 0.0)))

        return replace(
            self,
            text_height_min_px=factor * self.text_height_min_px,
            text_height_median_px=factor * self.text_height_median_px,
            blur_px=before(self.blur_px),
            worst_blur_px=before(self.worst_blur_px),
            noise=factor * self.noise,
            letter_px=factor * self.letter_px,
        )


def measure_quality(
    gray: GrayImage,
    characters: Points,
    sizes: Vector,
    mesh: NDArray[np.float64] | None = None,
    *,
    is_light: bool = False,
) -> CaptureQuality | None:
    """Figures of the photo `gray` (H, W) with the given characters; None without any.

    `characters` (N, 2) are their centres and `sizes` (N,) their heights in photo pixels. `mesh` (rows, columns, 2) has
    the photo points of the flat page. Print that `is_light` on dark paper is measured as its negative; dark paper is no
    shadow.
    """

    inside = np.all((characters > 0) & (characters < [gray.shape[1] - 1, gray.shape[0] - 1]), axis=1)
    characters, sizes = characters[inside], sizes[inside]
    if len(characters) == 0:
        return None
    height = float(np.median(sizes))
    chosen = choose_windows(len(characters), _PATCHES)
    at = characters[chosen]
    axes = np.tile([1.0, 0.0], (len(at), 1)) if mesh is None else text_axes(mesh, at)
    dark_print = np.asarray(255 - gray, np.uint8) if is_light else gray
    rows = measure_letter_rows(dark_print, at, axes, height)
    strokes = measure_strokes(dark_print, at, axes, rows.height_px)
    print_ = measure_patches(dark_print, at, height)
    blurs = print_.blurs
    seen = np.isfinite(blurs)
    glare, shadow = _measure_light(gray, characters, height)
    return CaptureQuality(
        text_height_min_px=_least_height(characters, sizes),
        text_height_median_px=height,
        blur_px=float(np.median(blurs[seen])) if seen.any() else 0.0,
        contrast=float(np.median(print_.contrasts)),
        cut_off_fraction=_cut_off(gray.shape, characters, sizes, mesh),
        glare_fraction=glare,
        shadow_fraction=0.0 if is_light else shadow,
        blurred_side=_blurred_side(gray.shape, at[seen], blurs[seen]),
        worst_blur_px=print_.worst_blur_px if seen.any() else 0.0,
        noise=print_.noise,
        letter_px=rows.height_px,
        line_tilt_rad=rows.tilt_rad,
        detail_across=strokes.across,
        detail_least=strokes.least,
        paper_level=print_.paper_level,
    )


def _least_height(characters: Points, sizes: Vector) -> float:
    """Least of the median heights in the cells of a grid over the text."""
    low, extent = characters.min(axis=0), np.maximum(np.ptp(characters, axis=0), 1.0)
    cell = np.minimum(((characters - low) / extent * _CELLS).astype(int), _CELLS - 1) @ [1, _CELLS]
    medians = [
        median(sizes[cell == number])
        for number in range(_CELLS**2)
        if np.count_nonzero(cell == number) >= _CELL_CHARACTERS
    ]
    return min(medians, default=float(np.median(sizes)))


def _cut_off(
    shape: tuple[int, ...],
    characters: Points,
    sizes: Vector,
    mesh: NDArray[np.float64] | None,
) -> float:
    edge = np.minimum(characters, np.array([shape[1] - 1, shape[0] - 1]) - characters).min(axis=1)
    cut = edge < _CUT_HEIGHTS * sizes
    if mesh is not None:
        cut |= _cosines(mesh, characters) < _OBLIQUE_COS
    return float(cut.mean())


def _cosines(mesh: NDArray[np.float64], characters: Points) -> Vector:
    """Cosine of the angle at which the page is seen at each character: the map's least over its largest stretch."""
    rows, columns = mesh.shape[:2]
    aspect = (columns - 1) / max(rows - 1, 1)
    across = np.diff(mesh, axis=1)[:-1] * aspect
    down = np.diff(mesh, axis=0)[:, :-1]
    cosines = _least_over_largest(np.nan_to_num(across), np.nan_to_num(down))
    middles = (mesh[:-1, :-1] + mesh[1:, 1:]) / 2
    known = np.isfinite(middles).all(axis=-1)
    if not known.any():
        return np.ones(len(characters))
    _, nearest = cKDTree(middles[known]).query(characters)
    return np.asarray(cosines[known][nearest])


def _least_over_largest(across: Floats, down: Floats) -> Floats:
    """Ratio of the singular values of the matrices with the columns `across` and `down` (..., 2); 1 for zeros."""
    squares = np.sum(across**2, axis=-1) + np.sum(down**2, axis=-1)
    area = np.abs(across[..., 0] * down[..., 1] - across[..., 1] * down[..., 0])
    # s1^2 + s2^2 and s1 s2 give (s1 + s2)^2 and (s1 - s2)^2.
    total, apart = np.sqrt(squares + 2 * area), np.sqrt(np.maximum(squares - 2 * area, 0.0))
    return np.asarray(np.where(total > 0, (total - apart) / np.maximum(total + apart, 1e-9), 1.0))


def _measure_light(gray: GrayImage, characters: Points, height_px: float) -> tuple[float, float]:
    """Shares of the page's area that are glare, and shadow without detail."""
    factor = min(1.0, _AREA_SIDE_PX / max(gray.shape))
    small = reduce_image(gray, factor, fine=False)
    page = np.zeros(small.shape, np.uint8)
    hull = cv2.convexHull((characters * factor).astype(np.float32))
    cv2.fillConvexPoly(page, np.round(hull).astype(np.int32), 1)
    area = max(int(page.sum()), 1)
    side = max(3, round(_BLOB_HEIGHTS * height_px * factor) | 1)
    kernel = np.ones((side, side), np.uint8)
    bright = np.asarray((small >= _GLARE_LEVEL) & (page > 0), np.uint8)
    dark = np.asarray((small <= _SHADOW_LEVEL) & (page > 0), np.uint8)
    shadow = float(cv2.morphologyEx(dark, cv2.MORPH_OPEN, kernel).sum()) / area if dark.any() else 0.0
    if not bright.any():
        return 0.0, shadow
    places = np.clip(np.round(characters * factor).astype(int), 0, np.array(small.shape[::-1]) - 1)
    around = cv2.blur(bright.astype(np.float32), (side, side))[places[:, 1], places[:, 0]]
    glare = 0.0
    if np.median(around) < _WHITE_PAPER:
        blobs = np.asarray(cv2.morphologyEx(bright, cv2.MORPH_OPEN, kernel), np.uint8)
        if blobs.any():
            glare = float(_without_print(blobs, kernel, places, len(characters) / area).sum()) / area
    return glare, shadow


def _without_print(blobs: GrayImage, kernel: GrayImage, at: NDArray[np.int_], usual: float) -> Mask:
    """Those of the bright `blobs` (H, W) that hide print: a white part that shows it is paper, or a screen's.

    Of the characters, `at` pixels (N, 2), `usual` lie on a pixel of the page.
    """
    count, labels = cv2.connectedComponents(blobs)
    # The largest number of a blob next to each character, which itself is dark.
    near = cv2.dilate(labels.astype(np.float32), kernel)[at[:, 1], at[:, 0]].astype(int)
    shown = np.bincount(near, minlength=count) / np.maximum(np.bincount(labels.ravel(), minlength=count), 1)
    shown[0] = usual
    return np.asarray((shown < _SHOWS_PRINT * usual)[labels])


def _blurred_side(shape: tuple[int, ...], at: Points, blurs: Vector) -> str | None:
    """The outer third of the photo whose text is much less sharp than that of the sharpest third."""
    found: list[tuple[float, str | None]] = []
    for axis, names in ((0, ("left", None, "right")), (1, ("upper", None, "lower"))):
        third: Floats = np.floor(at[:, axis] / max(shape[1 - axis], 1) * 3)
        for part, name in enumerate(names):
            own = blurs[third == part]
            if len(own) >= FEWEST_EDGES:
                found.append((float(np.median(own)), name))
    if not found:
        return None
    sharpest = max(min(blur for blur, _ in found), SHARP_PX)
    blur, name = max((each for each in found if each[1] is not None), default=(0.0, None))
    return name if blur > UNEVEN * sharpest else None

"""Uneven illumination: its estimation, its removal for analysis, and its removal for display."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from services.arrays import GrayImage, Mask, RgbImage
from services.imaging.channels import luminance, strongest_channel

_NEIGHBOURS = tuple((rows, columns) for rows in range(3) for columns in range(3))
_BAND_PIXELS = 1 << 20
"""Full-resolution passes process row bands of about this many pixels, to limit memory."""


@dataclass(frozen=True, slots=True)
class BackgroundParameters:
    """Separation of a page's background from its print.

    Windows are fractions of the image's long side, or multiples of the text height where that is known.
    """

    working_long_side_px: int = 400
    """Size of the copy for the filters; light varies slowly, so a larger copy only takes more time."""
    closing_fraction: float = 1 / 45
    """Closing window: wider than the widest stroke (6 mm on an A4 page)."""
    median_fraction: float = 1 / 16
    """Median window: wider than the residue of a word, narrower than a shadow."""
    closing_text_heights: float = 1.0
    """Closing window if the text height is given; strokes are at most about half of it."""
    median_text_heights: float = 5.0
    """Median window if the text height is given."""
    largest_gain: float = 6.0
    """Largest gain relative to the brightest background. It limits the noise of a dark desk or a picture, while a cast
    shadow (about a third of the light) is removed completely."""


def estimate_background(
    gray: GrayImage,
    text_height_px: float | None = None,
    parameters: BackgroundParameters = BackgroundParameters(),
) -> GrayImage:
    """Brightness of the bare page at every pixel of `gray`.

    A closing with a window wider than strokes removes print, without the bias of a dilation on a slope. A large median
    filter removes the rest, and keeps the edge of a cast shadow in place. Both run on a reduced copy.

    Parameters
    ----------
    gray : (H, W) uint8
    text_height_px : height of the text (x-height plus ascender) in pixels of `gray`, if known.

    Returns
    -------
    (H, W) uint8, at least 1, at least 1/largest_gain of its brightest part.
    """
    height, width = gray.shape
    return _enlarge(_small_background(gray, text_height_px, parameters), height, width)


def flatten_illumination(
    image: NDArray[np.uint8],
    text_height_px: float | None = None,
    parameters: BackgroundParameters = BackgroundParameters(),
) -> NDArray[np.uint8]:
    """`image`, (H, W) or (H, W, 3) RGB uint8, divided by its background: bare paper becomes 255.

    All channels of a colour image get the gain of the luminance, which keeps hues. For analysis and OCR; for display
    use `normalize_illumination`. Returns a new array of the same shape.
    """
    if image.ndim == 2:
        return divide_by_light(image, _small_background(image, text_height_px, parameters))
    gray = luminance(image)
    background = estimate_background(gray, text_height_px, parameters)
    flat = np.empty_like(image)
    for rows in _row_bands(*gray.shape):
        cv2.divide(image[rows], cv2.merge([background[rows]] * 3), dst=flat[rows], scale=255.0)
    return flat


def reduced_light(gray: GrayImage) -> GrayImage:
    """Brightness of the bare page as in `estimate_background`, on the reduced copy that it is measured on."""
    return _small_background(gray, None, BackgroundParameters())


def divide_by_light(gray: GrayImage, light: GrayImage) -> GrayImage:
    """`gray` (H, W) divided by its light on a reduced copy: bare paper becomes 255."""
    return np.asarray(cv2.divide(gray, _enlarge(light, *gray.shape), scale=255.0), dtype=np.uint8)


def flatten_part(part: GrayImage, light: GrayImage, light_from_part: NDArray[np.float64]) -> GrayImage:
    """`part` (H, W) of an image divided by the image's `reduced_light`.

    `light_from_part` (2, 3) maps pixels of the part to pixels of the light.
    """
    background = cv2.warpAffine(
        light,
        light_from_part,
        (part.shape[1], part.shape[0]),
        flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
        borderMode=cv2.BORDER_REPLICATE,
    )
    return np.asarray(cv2.divide(part, background, scale=255.0), dtype=np.uint8)


def _row_bands(height: int, width: int) -> list[slice]:
    rows = max(1, _BAND_PIXELS // max(1, width))
    return [slice(top, min(height, top + rows)) for top in range(0, height, rows)]


def _reduce(image: NDArray[np.uint8], long_side_px: int) -> tuple[NDArray[np.uint8], float]:
    """Copy of `image` with at most the given long side, by area averages, and the scale factor."""
    height, width = image.shape[:2]
    factor = min(1.0, long_side_px / max(height, width))
    if factor == 1.0:
        return image, factor
    size = (max(1, round(width * factor)), max(1, round(height * factor)))
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), dtype=np.uint8), factor


def _enlarge(small: GrayImage, height: int, width: int) -> GrayImage:
    if small.shape == (height, width):
        return small
    return np.asarray(cv2.resize(small, (width, height), interpolation=cv2.INTER_LINEAR), dtype=np.uint8)


def _small_background(
    gray: GrayImage, text_height_px: float | None, parameters: BackgroundParameters
) -> GrayImage:
    """Background on a copy of at most `working_long_side_px`."""
    small, factor = _reduce(gray, parameters.working_long_side_px)
    long_side = max(small.shape)
    closing_px = parameters.closing_fraction * long_side
    median_px = parameters.median_fraction * long_side
    if text_height_px is not None:
        closing_px = parameters.closing_text_heights * text_height_px * factor
        median_px = parameters.median_text_heights * text_height_px * factor
    largest = min(255, 2 * long_side - 1)
    kernel = cv2.getStructuringElement(cv2.MORPH_RECT, (_odd(closing_px, 3, largest),) * 2)
    background = cv2.medianBlur(cv2.morphologyEx(small, cv2.MORPH_CLOSE, kernel), _odd(median_px, 3, largest))
    floor = max(1, int(np.ceil(background.max() / parameters.largest_gain)))
    return np.asarray(np.maximum(background, np.uint8(floor)), dtype=np.uint8)


def _odd(size_px: float, least: int, most: int) -> int:
    """Nearest odd integer to `size_px` within [least, most]."""
    return int(2 * np.floor(min(max(size_px, least), max(most, least)) / 2) + 1)


@dataclass(frozen=True, slots=True)
class NormalizationParameters:
    """Localized histogram normalization (dissertation 4.4); levels are shares of white or of paper, 0-1."""

    fine_median_fraction: float = 1 / 36
    """Median of the background that is divided out: it follows the corners of tinted boxes and shadows."""
    working_long_side_px: int = 1200
    """Levels are taken here, where the strokes of ten-point print on A4 are still two pixels wide."""
    tiles: int = 28
    """Tiles along the long side; a neighbourhood is three by three of them."""
    ink_contrast: float = 0.2
    """Ink is darker than its paper by this share of it, at least."""
    ink_shares: tuple[float, float] = (0.008, 0.6)
    """Share of a neighbourhood that its ink takes: less is dirt, more is a picture."""
    paper_share: float = 0.5
    """Share of a neighbourhood within `paper_spread` of its paper's level; in pictures it is less."""
    paper_spread: float = 0.08
    paper_step: float = 0.15
    """Largest difference between blank paper and the paper next to it; else it is something else."""
    darkest_paper: float = 0.25
    """Paper in the deepest shadow, against the brightest: what is darker is a desk."""
    ink_quantile: float = 0.25
    """Of the ink's histogram: its mode, as far as blurred strokes show it."""
    largest_ink: float = 0.75
    """Ink that is lighter than this is faint print, and stays so."""
    largest_chroma: float = 0.25
    """Ink whose channels differ by more than this is coloured; it shows nothing about the level of black."""
    black: float = 0.08
    """Level of ink in the result: deep dark."""


def normalize_illumination(image: RgbImage) -> RgbImage:
    """Dark ink on white paper, light and shadow evened out, colours kept; a new image (H, W, 3) RGB uint8.

    Localized histogram normalization (dissertation 4.4): the two modes of every neighbourhood's histogram
    are shifted to white and deep dark by an affine map of the luminance, so that the transition between
    them is preserved. Both levels are measured on a reduced copy and interpolated. A place that is not paper
    (a picture, a desk) takes the light of the paper around it, and its dark levels stay unchanged, so that figures
    are neither bleached nor crushed. An image without print on paper is returned as it is.
    """
    levels = measure_levels(image)
    if levels is None:
        return image.copy()
    ink = levels.ink * levels.measured
    return _apply_levels(image, level_coefficients(levels.paper, ink))


@dataclass(frozen=True, slots=True, eq=False)
class Levels:
    """The two modes of the histogram round every place of an image, all (h, w) float32 over a reduced copy of it.

    Attributes
    ----------
    paper : luminance of the paper, 1-255.
    ink : level of ink as a share of its paper's, 0-1; 0 everywhere where no ink is known.
    measured : how far (0-1) the paper was measured in this place and not taken from around it.
    """

    paper: NDArray[np.float32]
    ink: NDArray[np.float32]
    measured: NDArray[np.float32]


def level_coefficients(paper: NDArray[np.float32], ink: NDArray[np.float32]) -> NDArray[np.float32]:
    """Affine map (h, w, 3) that shifts `paper` to white and `ink`, (h, w) as in `Levels`, to black.

    Gain of every channel, slope of the strongest channel, offset: all channels take the gain 1 / paper. The strongest
    of them, v, then becomes (v - ink) contrast + black, and the others change by as much: chroma stays, and coloured
    ink, strong in one channel, hardly darkens. Where `ink` is 0 only the gain is left.
    """
    target = np.minimum(NormalizationParameters().black, ink)
    contrast = (1.0 - target) / (1.0 - ink)
    gain = 255.0 / paper
    return np.dstack([gain, gain * (contrast - 1.0), 255.0 * (target - ink * contrast)]).astype(np.float32)


def measure_levels(image: RgbImage) -> Levels | None:
    """Levels of paper and ink over `image` (H, W, 3) RGB uint8; None where nothing looks like print on paper.

    They are measured on a copy of at most `working_long_side_px`, and given on the background's copy.
    """
    parameters = NormalizationParameters()
    small, _ = _reduce(image, parameters.working_long_side_px)
    gray = luminance(small)
    # Within the wide median of this background a picture varies, and paper does not.
    background = _small_background(gray, None, BackgroundParameters())
    ground = _enlarge(background, *gray.shape)
    share = cv2.divide(gray, ground, scale=200.0)  # 200: as light as its paper
    height, width = gray.shape
    tiles = min(parameters.tiles / max(height, width), 1 / 12)
    grid = (max(1, round(width * tiles)), max(1, round(height * tiles)))
    is_ink = (share < 200 * (1.0 - parameters.ink_contrast)).astype(np.uint8)
    is_paper = (np.abs(share.astype(np.int16) - 200) <= 200 * parameters.paper_spread).astype(np.uint8)
    ink_share, _ = _tile_shares(is_ink, grid)
    # Next to a picture the neighbourhood is paper, but the tile itself is not.
    is_even = np.minimum(*_tile_shares(is_paper, grid)) >= parameters.paper_share
    samples = cv2.resize(background, (3 * grid[0], 3 * grid[1]), interpolation=cv2.INTER_NEAREST)
    level = np.median(np.reshape(samples, (grid[1], 3, grid[0], 3)), axis=(1, 3)).astype(np.float32)
    least, most = parameters.ink_shares
    printed = is_even & (ink_share >= least) & (ink_share <= most)
    if not np.any(printed):
        return None
    printed &= level >= parameters.darkest_paper * np.quantile(level[printed], 0.9)
    accepted = _grow_paper(level, printed, is_even, parameters.paper_step)
    fine = BackgroundParameters(median_fraction=parameters.fine_median_fraction)
    background = _small_background(gray, None, fine)
    paper, is_accepted = _level_paper(background, level, accepted, parameters.paper_step)
    strongest = strongest_channel(small)
    weakest = 255 - strongest_channel(np.asarray(255 - small, dtype=np.uint8))
    is_neutral = (
        cv2.divide(cv2.subtract(strongest, weakest), ground, scale=200.0) < 200 * parameters.largest_chroma
    )
    strongest = np.asarray(cv2.divide(strongest, ground, scale=200.0), dtype=np.uint8)
    ink = _level_ink(strongest, is_ink * is_neutral, printed, parameters)
    ink = np.asarray(cv2.resize(ink, paper.shape[::-1], interpolation=cv2.INTER_LINEAR), dtype=np.float32)
    return Levels(paper, ink, is_accepted)


def _tile_shares(
    mask: NDArray[np.uint8], grid: tuple[int, int]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Share of `mask` (h, w) 0/1 round every tile of a grid (columns, rows), and in the tile itself."""
    own = np.asarray(cv2.resize(mask.astype(np.float32), grid, interpolation=cv2.INTER_AREA), np.float32)
    return np.asarray(cv2.blur(own, (3, 3), borderType=cv2.BORDER_REPLICATE), np.float32), own


def _grow_paper(level: NDArray[np.float32], printed: Mask, even: Mask, step: float) -> Mask:
    """Tiles that are paper: those with print, and even ones that differ little from paper next to them."""
    accepted = printed
    padded_level = np.pad(level, 1, mode="edge")
    for _ in range(sum(level.shape)):
        padded = np.pad(accepted, 1)
        beside = np.zeros_like(accepted)
        for rows, columns in _NEIGHBOURS:
            window = (slice(rows, rows + level.shape[0]), slice(columns, columns + level.shape[1]))
            beside |= padded[window] & (np.abs(level - padded_level[window]) <= step * padded_level[window])
        grown = accepted | (even & beside)
        if np.array_equal(grown, accepted):
            break
        accepted = grown
    return accepted


def _level_paper(
    background: GrayImage, level: NDArray[np.float32], accepted: Mask, step: float
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Level of the paper (h, w), and how far (0-1) it was measured there and not taken from around.

    A pixel's background is its paper's level where it is like an accepted tile's nearby, which keeps both
    the edge of a shadow and that of a picture where they are.
    """
    height, width = background.shape
    rows = np.arange(height) * level.shape[0] // height + 1
    columns = np.arange(width) * level.shape[1] // width + 1
    padded = np.pad(np.where(accepted, level, -1.0), 1, constant_values=-1.0)
    found = background.astype(np.float32)
    is_paper = np.zeros((height, width), dtype=bool)
    for down, right in _NEIGHBOURS:
        near = padded[np.ix_(rows + down - 1, columns + right - 1)]
        is_paper |= np.abs(found - near) <= step * near
    weight = is_paper.astype(np.float32)
    paper = _fill(found, weight, max(height, width) / 32)
    smooth = cv2.GaussianBlur(paper.astype(np.float32), (0, 0), max(height, width) / 200)
    paper = np.where(is_paper, found, smooth).astype(np.float32)
    measured = cv2.GaussianBlur(weight, (0, 0), max(height, width) / 200)
    return np.maximum(paper, 1.0), np.asarray(measured, dtype=np.float32)


def _level_ink(
    strongest: NDArray[np.uint8],
    is_ink: NDArray[np.uint8],
    printed: Mask,
    parameters: NormalizationParameters,
) -> NDArray[np.float32]:
    """Mode of ink as a share of its paper for every tile, from the printed tiles around it; 0: no ink."""
    bins = 32
    y, x = np.nonzero(is_ink)
    value = strongest[y, x].astype(np.int64) * bins // 256
    row, column = y * printed.shape[0] // is_ink.shape[0], x * printed.shape[1] // is_ink.shape[1]
    tile = row * printed.shape[1] + column
    counts = np.bincount(tile * bins + value, minlength=printed.size * bins).reshape(*printed.shape, bins)
    counts = counts * printed[..., None]
    planes = np.moveaxis(counts, 2, 0).astype(np.float32)
    around = np.stack([cv2.blur(plane, (5, 5), borderType=cv2.BORDER_CONSTANT) for plane in planes])
    below = np.cumsum(around, axis=0)
    reached = np.argmax(below >= parameters.ink_quantile * below[-1], axis=0)
    ink = (reached + 0.5) * (256 / bins) / 200
    known = ((below[-1] > 0) & (ink <= parameters.largest_ink)).astype(np.float32)
    return _fill(ink.astype(np.float32), known, 5.0)


def _fill(values: NDArray[np.float32], known: NDArray[np.float32], window: float) -> NDArray[np.float32]:
    """`values` (h, w) where `known` is 1; elsewhere a mean of known ones, the nearest before all others.

    Means over windows that begin with the given width and double each weigh a hundredth of the one before.
    All is 0 where nothing is known.
    """
    if not np.any(known):
        return np.zeros_like(values)
    share, value = np.zeros_like(values), np.zeros_like(values)
    weight = 1.0
    while True:
        size = (_odd(window, 3, 4 * max(values.shape)),) * 2
        share += weight * cv2.blur(known, size, borderType=cv2.BORDER_CONSTANT)
        value += weight * cv2.blur(values * known, size, borderType=cv2.BORDER_CONSTANT)
        if window > 2 * max(values.shape):
            break
        window, weight = 2 * window, weight / 100
    return np.asarray(np.where(known > 0, values, value / share), dtype=np.float32)


def _apply_levels(image: RgbImage, coefficients: NDArray[np.float32]) -> RgbImage:
    """Channels times the first coefficient, plus the strongest channel times the second, plus the third.

    `coefficients` (h, w, 3) are interpolated to the image's size, band by band.
    """
    height, width = image.shape[:2]
    small = coefficients
    result = np.empty_like(image)
    # Rows of the small arrays; reducing by s maps y to (y + 0.5) s - 0.5.
    place = np.clip((np.arange(height) + 0.5) * small.shape[0] / height - 0.5, 0, small.shape[0] - 1)
    above = np.minimum(place.astype(np.int64), max(0, small.shape[0] - 2))
    part = (place - above).astype(np.float32)[:, None, None]
    for rows in _row_bands(height, width):
        upper = small[above[rows]]
        lower = small[np.minimum(above[rows] + 1, small.shape[0] - 1)]
        stretched = cv2.resize(upper + (lower - upper) * part[rows], (width, rows.stop - rows.start))
        gain, slope, offset = cv2.split(stretched)
        band = image[rows]
        added = cv2.add(cv2.multiply(strongest_channel(band).astype(np.float32), slope), offset)
        for channel in range(3):
            value = cv2.multiply(band[..., channel].astype(np.float32), gain)
            result[rows, :, channel] = np.clip(cv2.add(value, added) + 0.5, 0, 255)
    return result

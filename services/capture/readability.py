"""The character error that a photo's figures let expect: a small logistic model.

The coefficients are fitted to simulated photos of known text by `python -m benchmarks advice --fit`; that of glare and
shadow is set by hand. What OCR misreads is decided by how much detail of the strokes is left: blur, motion and few
pixels take it away, noise hides it. Faint print alone is read with few errors.

On creased paper, words are misread where lines are not level on the flat page, however sharp they are. These errors
come on top of the others; their coefficient is fitted to development photos by `python -m benchmarks advice --fit
--development`.

What these figures say of real pages is learned apart (`PhotoCalibration`): simulated crops have no creases, and no
letters of less than 3 pixels. Once a page has been read, the confidences of its words say more than any figure of the
photo (`ReadingModel`). Both are fitted by `python -m benchmarks expected_error`.
"""

import math
from dataclasses import dataclass

from services.capture.quality import CaptureQuality

PIXEL_BLUR_PX = 0.4
"""Blur (standard deviation) of a sharp photo: a pixel is the mean over its square (0.29), optics add as much."""
LEAST_NOISE = 0.03
"""Noise, as a share of the step from ink to paper, that makes no difference to OCR."""
LARGEST_LETTER_PX = 40.0
"""Height of small letters above which more pixels are worth nothing; the photos of the fit end at 26."""
TINY_LETTER_PX = 4.0
"""Height of small letters below which they are worse than blur and noise say; of 4 to 8 px the most likely."""
LEAST_SHARE = 0.003
"""Shares nearer to 0 or 1 make no difference."""


@dataclass(frozen=True, slots=True)
class ErrorModel:
    """Logistic model: the logit of the error is the sum of these times the features of `features_of`."""

    constant: float = 4.71
    lost_detail: float = 2.12
    blur: float = 3.65
    noise: float = 2.0
    few_pixels: float = -2.07
    """Below 0 because blur is already relative to the letters: small letters are worse by 1.58 all in all."""
    uneven_light: float = 4.0
    crooked_lines: float = 1.36
    """Share of the characters that is misread for each radian of `line_tilt_rad`."""


def features_of(quality: CaptureQuality) -> tuple[float, float, float, float, float]:
    """Features of the model; the larger, the worse.

    Logarithms of the detail across the lines over that in the worst direction, of the blur in its worst direction over
    the height of small letters, of the noise, of the letters' fewness of pixels; the share of glare and clipped shadow.
    """
    letter_px = min(max(quality.letter_px, 1.0), LARGEST_LETTER_PX)
    return (
        math.log(max(quality.detail_across, quality.detail_least) / quality.detail_least),
        math.log(math.hypot(quality.worst_blur_px, PIXEL_BLUR_PX) / letter_px),
        math.log(quality.noise + LEAST_NOISE),
        -math.log(letter_px),
        quality.glare_fraction + quality.shadow_fraction,
    )


@dataclass(frozen=True, slots=True)
class PhotoCalibration:
    """The logit of the error on real pages: a line of that of `ErrorModel`, and more the smaller tiny letters are."""

    constant: float = 2.98
    slope: float = 1.46
    tiny_letters: float = 1.06


def photo_variables(quality: CaptureQuality) -> tuple[float, float]:
    """The variables of `PhotoCalibration`: the logit of `ErrorModel`'s share, and e-folds below `TINY_LETTER_PX`."""
    tiny = math.log(TINY_LETTER_PX / max(quality.letter_px, 1.0))
    return _logit(_predict_misread(quality, ErrorModel())), max(tiny, 0.0)


def predict_character_error(quality: CaptureQuality, calibration: PhotoCalibration | None = None) -> float:
    """Share of the characters, 0-1, that OCR will not read right. What is cut off is lost."""
    c = calibration or PhotoCalibration()
    misread, tiny = photo_variables(quality)
    return _with_cut(_logistic(c.constant + c.slope * misread + c.tiny_letters * tiny), quality)


def predict_damage_error(quality: CaptureQuality, model: ErrorModel | None = None) -> float:
    """The same as on simulated photos of level print, before `PhotoCalibration`."""
    return _with_cut(_predict_misread(quality, model or ErrorModel()), quality)


def _predict_misread(quality: CaptureQuality, m: ErrorModel) -> float:
    """Share of the characters in view that OCR will not read right, without calibration."""
    weights = (m.lost_detail, m.blur, m.noise, m.few_pixels, m.uneven_light)
    logit = m.constant + sum(w * f for w, f in zip(weights, features_of(quality), strict=True))
    level = 1.0 - min(m.crooked_lines * quality.line_tilt_rad, 1.0)
    return 1.0 - (1.0 - _logistic(logit)) * level


@dataclass(frozen=True, slots=True)
class ReadingModel:
    """The logit of the error is a line of that of the share of letters in words that are probably wrong.

    A wrong word has right letters too, so that the error is less than this share. Figures of the photo add nothing.
    """

    constant: float = -0.42
    slope: float = 1.04


def reading_variable(doubtful: float) -> float:
    """The variable of `ReadingModel`, of a page with this share of `doubtful_letters`."""
    return _logit(doubtful)


def predict_error_of_reading(
    quality: CaptureQuality, doubtful: float, model: ReadingModel | None = None
) -> float:
    """Share of the characters, 0-1, that were not read right, by that of doubtful letters. What is cut off is lost."""
    m = model or ReadingModel()
    return _with_cut(_logistic(m.constant + m.slope * reading_variable(doubtful)), quality)


def _with_cut(misread: float, quality: CaptureQuality) -> float:
    return 1.0 - (1.0 - misread) * (1.0 - quality.cut_off_fraction)


def _logit(share: float) -> float:
    inside = min(max(share, LEAST_SHARE), 1.0 - LEAST_SHARE)
    return math.log(inside / (1.0 - inside))


def _logistic(logit: float) -> float:
    return 1.0 / (1.0 + math.exp(-max(min(logit, 50.0), -50.0)))

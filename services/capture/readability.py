"""The character error that a photo's figures let expect: a small logistic model.

The coefficients are fitted to 136 small simulated photos of known text by `python -m benchmarks advice --fit`; that of
glare and shadow is set by hand. What OCR misreads is decided by blur in relation to the letters above all; it reads
sharp letters of 5 pixels, faint print and noise with few errors.
"""

import math
from dataclasses import dataclass

from services.capture.quality import CaptureQuality


@dataclass(frozen=True, slots=True)
class ErrorModel:
    """Logistic model: the logit of the error is the sum of these times the features of `features_of`.

    The size of sharp letters had no weight: that of the blur against it had nearly all.
    """

    constant: float = -6.27
    blur: float = 23.72
    faint_print: float = 0.85
    uneven_light: float = 4.0


def features_of(quality: CaptureQuality) -> tuple[float, float, float]:
    """Features of the model, 0 for a good photo: blur, faint print, uneven light.

    Blur in its worst direction as a share of the text height, contrast in octaves below full, and the share of glare
    and clipped shadow.
    """
    return (
        quality.worst_blur_px / max(quality.text_height_median_px, 1.0),
        -math.log2(min(max(quality.contrast, 0.01), 1.0)),
        quality.glare_fraction + quality.shadow_fraction,
    )


def predict_character_error(quality: CaptureQuality, model: ErrorModel | None = None) -> float:
    """Share of the characters, 0-1, that OCR will not read right. What is cut off is lost."""
    m = model or ErrorModel()
    weights = (m.blur, m.faint_print, m.uneven_light)
    logit = m.constant + sum(w * f for w, f in zip(weights, features_of(quality), strict=True))
    misread = 1.0 / (1.0 + math.exp(-max(min(logit, 50.0), -50.0)))
    return 1.0 - (1.0 - misread) * (1.0 - quality.cut_off_fraction)

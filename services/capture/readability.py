"""The character error that a photo's figures let expect: a small logistic model.

The coefficients are set by hand from 16 simulated photos of known text (`python -m benchmarks advice`): print of 8
pixels was read with 1 % of errors, print of 7 pixels with more than 50 %. `--fit` prints fitted coefficients; 16 photos
are too few for them.
"""

import math
from dataclasses import dataclass

from services.capture.quality import CaptureQuality


@dataclass(frozen=True, slots=True)
class ErrorModel:
    """Logistic model: the logit of the error is the sum of these times the features of `features_of`."""

    constant: float = -4.0
    small_print: float = 4.0
    blur: float = 30.0
    faint_print: float = 0.6
    uneven_light: float = 4.0


def features_of(quality: CaptureQuality) -> tuple[float, float, float, float]:
    """Features of the model, 0 for a good photo: small print, blur, faint print, uneven light.

    Small print in octaves below 12 px, blur as share of the text height, contrast in octaves below full, and the share
    of glare and clipped shadow.
    """
    height = 0.5 * (quality.text_height_min_px + quality.text_height_median_px)
    return (
        max(0.0, math.log2(12.0 / max(height, 1.0))),
        quality.blur_px / max(height, 1.0),
        -math.log2(min(max(quality.contrast, 0.01), 1.0)),
        quality.glare_fraction + quality.shadow_fraction,
    )


def predict_character_error(quality: CaptureQuality, model: ErrorModel | None = None) -> float:
    """Share of the characters, 0-1, that OCR will not read right. What is cut off is lost."""
    m = model or ErrorModel()
    weights = (m.small_print, m.blur, m.faint_print, m.uneven_light)
    logit = m.constant + sum(w * f for w, f in zip(weights, features_of(quality), strict=True))
    misread = 1.0 / (1.0 + math.exp(-max(min(logit, 50.0), -50.0)))
    return 1.0 - (1.0 - misread) * (1.0 - quality.cut_off_fraction)

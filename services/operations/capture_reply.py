"""The `quality` of an answer: figures of a photo, the error to expect, advice."""

import math
from collections.abc import Sequence
from typing import Literal

import numpy as np

from services.arrays import RgbImage
from services.capture.advice import advise
from services.capture.quality import measure_quality
from services.capture.readability import predict_character_error, predict_error_of_reading
from services.contract.answers.capture import Quality, TextHeight
from services.imaging.channels import luminance
from services.ocr.engine import Word
from services.rectify.results import RectifyResult
from services.text.page_text import doubtful_letters


def describe_quality(
    photo: RgbImage, result: RectifyResult, reduction: int = 1, words: Sequence[Word] | None = None
) -> Quality | None:
    """Quality of a photo whose flat page is `result`; None for a page without text.

    `photo` (H, W, 3) and `result` may be those of the photo reduced by `reduction`; the figures are those of the whole.
    `words` are those that were read on the page, if it was read.
    """
    if result.print is None:
        return None
    gray = luminance(photo)
    turn, mesh = result.orientation, result.mesh
    if turn.confidence is None and turn.rotation_deg % 180:
        # A person has turned the page by a quarter: its lines run along the columns now.
        mesh = np.rot90(mesh)
    quality = measure_quality(
        gray, result.print.characters, result.print.heights_px, mesh, is_light=result.print.is_light
    )
    if quality is None:
        return None
    quality = quality.enlarged(reduction)
    source: Literal["photo", "reading"]
    if words is None:
        error, source = predict_character_error(quality), "photo"
    else:
        error, source = predict_error_of_reading(quality, doubtful_letters(words)), "reading"
    return Quality(
        text_height_px=TextHeight(
            min=round(quality.text_height_min_px, 1), median=round(quality.text_height_median_px, 1)
        ),
        blur_px=round(quality.blur_px, 2),
        contrast=round(quality.contrast, 3),
        cut_off_fraction=round(quality.cut_off_fraction, 4),
        glare_fraction=round(quality.glare_fraction, 4),
        shadow_fraction=round(quality.shadow_fraction, 4),
        line_tilt_deg=round(math.degrees(quality.line_tilt_rad), 2),
        predicted_character_error=round(error, 4),
        predicted_from=source,
        advice=list(advise(quality)),
    )

"""The `quality` of the HTTP contract: figures of a photo, the error to expect, advice."""

import math
from collections.abc import Sequence

import numpy as np

from services.arrays import RgbImage
from services.capture.advice import advise
from services.capture.quality import measure_quality
from services.capture.readability import predict_character_error, predict_error_of_reading
from services.imaging.channels import luminance
from services.ocr.engine import Word
from services.operations.replies import rounded
from services.rectify.results import RectifyResult
from services.text.page_text import doubtful_letters


def describe_quality(
    photo: RgbImage, result: RectifyResult, reduction: int = 1, words: Sequence[Word] | None = None
) -> dict[str, object] | None:
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
    quality = measure_quality(gray, result.print.characters, result.print.heights_px, mesh)
    if quality is None:
        return None
    quality = quality.enlarged(reduction)
    if words is None:
        error, source = predict_character_error(quality), "photo"
    else:
        error, source = predict_error_of_reading(quality, doubtful_letters(words)), "reading"
    return {
        "text_height_px": {
            "min": rounded(quality.text_height_min_px, 1),
            "median": rounded(quality.text_height_median_px, 1),
        },
        "blur_px": rounded(quality.blur_px, 2),
        "contrast": rounded(quality.contrast, 3),
        "cut_off_fraction": rounded(quality.cut_off_fraction),
        "glare_fraction": rounded(quality.glare_fraction),
        "shadow_fraction": rounded(quality.shadow_fraction),
        "line_tilt_deg": rounded(math.degrees(quality.line_tilt_rad), 2),
        "predicted_character_error": rounded(error),
        "predicted_from": source,
        "advice": [{"code": each.code, "detail": each.detail} for each in advise(quality)],
    }

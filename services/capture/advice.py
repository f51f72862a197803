"""What to do better in the next photo, with the figures that say so."""

import math

from services.capture.quality import CaptureQuality
from services.contract.answers.capture import Advice

_GOOD_HEIGHT_PX = 14.0
"""Small letters of this height read well also with some blur and noise."""
_LEAST_HEIGHT_PX = 9.0
"""Of simulated photos, those with letters of 8 px read well only without blur; below 7 px most were lost."""
_BLUR_HEIGHTS = 0.16
"""Blur, as share of the text height, above which strokes run together."""
_LINE_TILT_RAD = math.radians(2.0)
"""Of development photos with more crooked lines half have more than 10 % of errors, of the others 2 %; of simulated
flat pages 1 % seem so crooked."""
_DARK_PAPER = 90.0
"""Gray level of paper that has too little light: photos with light enough have 110 and more, a copy at a fifth of its
brightness 43."""
_CUT_OFF = 0.01
_LIGHT = 0.02


def advise(quality: CaptureQuality) -> tuple[Advice, ...]:
    """Advice, the most important first; none for a photo that reads well."""

    found: list[Advice] = []
    if quality.cut_off_fraction > _CUT_OFF:
        share = max(1, round(100 * quality.cut_off_fraction))
        found.append(
            Advice(
                code="show-all-text",
                detail=f"{share} % of the text is cut off or seen too obliquely: take the whole page into view, "
                "from above.",
            )
        )
    if quality.text_height_min_px < _LEAST_HEIGHT_PX:
        height = round(quality.text_height_min_px)
        found.append(
            Advice(
                code="come-closer",
                detail=f"Come closer: letters are {height} pixels high, {_GOOD_HEIGHT_PX:g} read well.",
            )
        )
    if max(quality.blur_px, quality.worst_blur_px) > _BLUR_HEIGHTS * quality.text_height_median_px:
        where = f"The {quality.blurred_side} third" if quality.blurred_side else "The text"
        found.append(
            Advice(
                code="hold-still",
                detail=f"{where} is out of focus or blurred: hold still and focus on the text.",
            )
        )
    elif quality.blurred_side is not None:
        found.append(
            Advice(
                code="focus-evenly",
                detail=f"The {quality.blurred_side} third is out of focus: hold the camera parallel to the page.",
            )
        )
    if quality.line_tilt_rad > _LINE_TILT_RAD:
        found.append(
            Advice(
                code="flatten-sheet",
                detail="Lines of text are crooked: smooth the sheet out, or hold it flat at its corners.",
            )
        )
    if quality.paper_level < _DARK_PAPER:
        found.append(
            Advice(
                code="more-light",
                detail=f"The paper is dark ({round(quality.paper_level)} of 255): use more light.",
            )
        )
    if quality.glare_fraction > _LIGHT:
        share = max(1, round(100 * quality.glare_fraction))
        found.append(
            Advice(
                code="avoid-glare",
                detail=f"Glare covers {share} % of the text: switch off the flash, or move the lamp.",
            )
        )
    if quality.shadow_fraction > _LIGHT:
        share = max(1, round(100 * quality.shadow_fraction))
        found.append(
            Advice(
                code="avoid-shadow",
                detail=f"Shadow without detail covers {share} % of the text: let light fall on it.",
            )
        )
    return tuple(found)

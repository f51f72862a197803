"""Print that is no part of the page's lines: stamps, watermarks, labels of charts.

On a sheet, bent or not, the directions of lines change from place to place by little. A stamp's differ from those
beside it, or on the way to it, at once. And directions are measured in windows that hold a few lines of the page's
text: of letters that are much larger they show strokes. Neither shows anything of the sheet's shape.
"""

from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from services.rectify.analysis.found_text import MIN_FLOW_SAMPLES
from services.rectify.analysis.page_analysis import PageAnalysis
from services.sheet.plane.pose import most_common_direction
from services.texture_flow.field import FlowSamples, angle_difference
from services.texture_flow.regression import OUTLIER_RAD
from services.texture_flow.text_identification import SIZE_RATIO, keep_characters


def without_slanted_print(analysis: PageAnalysis) -> PageAnalysis:
    """The `analysis` of that print alone whose size and directions go over into those of most characters.

    All of it, where too little would be left to show a direction. Each character counts once: few letters of a stamp
    have as much ink as many lines of text.
    """
    text, minor, characters = analysis.text, analysis.minor, analysis.characters
    small = text.components.sizes < SIZE_RATIO * text.text_height_px
    letters = cKDTree(characters)
    major = analysis.major.select(small[letters.query(analysis.major.points)[1]])
    if len(major) < MIN_FLOW_SAMPLES:
        return analysis
    places = cKDTree(major.points)
    shown = places.query(characters)[1]
    count = np.bincount(shown[small], minlength=len(major)).astype(float)
    off = angle_difference(
        major.angles, most_common_direction(FlowSamples(major.points, major.angles, count))
    )
    level = np.abs(off) < OUTLIER_RAD
    while not level.all():
        nearest = np.flatnonzero(level)[cKDTree(major.points[level]).query(major.points)[1]]
        grown = level | (np.abs(angle_difference(off, off[nearest])) < OUTLIER_RAD)
        if (grown == level).all():
            break
        level = grown
    kept = small & level[shown]
    if kept.all() or level.sum() < MIN_FLOW_SAMPLES:
        return analysis
    return replace(
        analysis,
        text=replace(keep_characters(text, kept), rejected_fraction=text.rejected_fraction),
        major=major.select(level),
        minor=None if minor is None else minor.select(kept[letters.query(minor.points)[1]]),
    )

"""Print that flows in another direction than most of the page's: stamps, watermarks, labels of charts.

On a sheet, bent or not, the directions of lines change from place to place by little. A stamp's differ from those
beside it, or on the way to it, at once. It shows nothing of the sheet's shape.
"""

from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from services.rectify.analysis.page_analysis import PageAnalysis
from services.sheet.plane.pose import most_common_direction
from services.texture_flow.field import FlowSamples, angle_difference
from services.texture_flow.regression import OUTLIER_RAD
from services.texture_flow.text_identification import keep_characters


def without_slanted_print(analysis: PageAnalysis) -> PageAnalysis:
    """The `analysis` of that print alone whose directions go over into those of most characters.

    Each character counts once: few letters of a stamp have as much ink as many lines of text.
    """
    major, characters = analysis.major, analysis.characters
    places = cKDTree(major.points)
    shown = places.query(characters)[1]
    votes = FlowSamples(major.points, major.angles, np.bincount(shown, minlength=len(major)).astype(float))
    off = angle_difference(major.angles, most_common_direction(votes))
    level = np.abs(off) < OUTLIER_RAD
    while not level.all():
        nearest = np.flatnonzero(level)[cKDTree(major.points[level]).query(major.points)[1]]
        grown = level | (np.abs(angle_difference(off, off[nearest])) < OUTLIER_RAD)
        if (grown == level).all():
            break
        level = grown
    if level.all():
        return analysis
    text, minor = analysis.text, analysis.minor
    return replace(
        analysis,
        text=replace(keep_characters(text, level[shown]), rejected_fraction=text.rejected_fraction),
        major=major.select(level),
        minor=None if minor is None else minor.select(level[places.query(minor.points)[1]]),
    )

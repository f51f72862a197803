"""Text outside of the detected sheet: where there is some, the sheet does not end there.

A coloured head or foot of a page, with dark or light text on it, differs from the paper as a desk does.
"""

import cv2
import numpy as np

from services.arrays import Points
from services.rectify.analysis.page_analysis import PageAnalysis
from services.rectify.view.print_kept import groups_within
from services.texture_flow.text_identification import TextComponents

# What is text of this page.
CHARACTERS = 15
"""Least number of dark characters; a desk gives only single components of the text's size."""
LIGHT_SHARE = 0.3
"""Least number of light characters relative to all dark ones; the grain of wood gives up to 0.15."""
REACH = 1.5
"""Text heights from letter to letter of a word, ..."""
WORD = 6
"""... and least letters of one: of 351 of a coloured head 189 stand so, of 96 and 57 specks of two desks 0 and 8."""
SIZES = (0.5, 2.5)
"""Range of heights relative to the page's text; smaller components are texture, larger ones are objects."""


def of_text_height(components: TextComponents, text_height_px: float) -> Points:
    """Centres (N, 2) of the `components` that are about as high as the text."""
    low, high = (share * text_height_px for share in SIZES)
    return np.asarray(components.centres[(components.sizes >= low) & (components.sizes <= high)])


def is_outside_text(dark: int, light: int, all_dark: int) -> bool:
    """Whether these numbers of dark and light characters outside of an edge, and `all_dark` on the page, are text."""
    return dark >= CHARACTERS or light >= max(CHARACTERS, LIGHT_SHARE * all_dark)


def has_text_outside(analysis: PageAnalysis, sheet: Points) -> bool:
    """Whether the page has text outside of `sheet` (N, 2), photo pixels, which then outlines a part of it only.

    Letters stand in words; grain of a desk does not.
    """
    if analysis.facing_page:
        return False
    inside = np.zeros(analysis.reduced.shape, np.uint8)
    cv2.fillPoly(inside, [np.round((sheet + 0.5) * analysis.factor - 0.5).astype(np.int32)], (1,))
    printed = of_text_height(analysis.printed, analysis.text.text_height_px)
    x, y = np.floor(printed + 0.5).astype(int).T
    outside = printed[inside[y, x] == 0]
    if not len(outside):
        return False
    word = groups_within(outside, REACH * analysis.text.text_height_px)
    in_words = int(np.count_nonzero(np.bincount(word)[word] >= WORD))
    return is_outside_text(in_words, 0, len(printed))

"""Characters of a page in the photo, for figures of the photo's quality."""

import numpy as np

from services.arrays import Mask, Vector
from services.rectify.analysis.page_analysis import PageAnalysis
from services.rectify.results import PrintSample
from services.texture_flow.text_identification import FEWEST_CHARACTERS, IdentifiedText

WORD = 2.0
"""Length over height of a box, from which it is that of a word whose letters touch."""


def sample_print(analysis: PageAnalysis, on_page: Mask) -> PrintSample | None:
    """Characters of the page with their heights; None if there are too few for text.

    `on_page` (N,) marks those of the characters that were found that belong to the page.
    """
    if np.count_nonzero(on_page) < FEWEST_CHARACTERS:
        return None
    heights = print_heights(analysis.text) / analysis.factor
    return PrintSample(analysis.characters[on_page], heights[on_page])


def print_heights(text: IdentifiedText) -> Vector:
    """Heights (N,) of the characters in pixels of the analysed image.

    In a blurred photo the letters of a word are one component, whose extent is not that of a letter.
    """
    shortest = text.components.boxes[:, 2:].min(axis=1).astype(np.float64)
    longest = text.components.boxes[:, 2:].max(axis=1)
    return np.asarray(np.where(longest > WORD * shortest, shortest, text.components.sizes))

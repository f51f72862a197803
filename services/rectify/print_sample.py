"""Characters of a page in the photo, for figures of the photo's quality."""

import numpy as np

from services.arrays import Points, Vector
from services.rectify.analysis import PageAnalysis
from services.rectify.results import PrintSample
from services.texture_flow.text_identification import IdentifiedText

WORD = 2.0
"""Length over height of a box, from which it is that of a word whose letters touch."""


def sample_print(analysis: PageAnalysis, characters: Points) -> PrintSample | None:
    """Characters of the page with their heights; None if most of what was taken for text is none.

    `characters` (N, 2) are those that belong to the page.
    """
    if len(characters) == 0 or len(characters) != len(analysis.characters):
        return None
    return PrintSample(analysis.characters, print_heights(analysis.text) / analysis.factor)


def print_heights(text: IdentifiedText) -> Vector:
    """Heights (N,) of the characters in pixels of the analysed image.

    In a blurred photo the letters of a word are one component, whose extent is not that of a letter.
    """
    shortest = text.components.boxes[:, 2:].min(axis=1).astype(np.float64)
    longest = text.components.boxes[:, 2:].max(axis=1)
    return np.asarray(np.where(longest > WORD * shortest, shortest, text.components.sizes))

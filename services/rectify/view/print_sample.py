"""Characters of a page in the photo, for figures of the photo's quality."""

import numpy as np

from services.arrays import Vector
from services.rectify.results import PrintSample
from services.rectify.shape_choice.shaped_page import ShapedPage
from services.texture_flow.text_identification import FEWEST_CHARACTERS, IdentifiedText

WORD = 2.0
"""Length over height of a box, from which it is that of a word whose letters touch."""


def sample_print(page: ShapedPage) -> PrintSample | None:
    """Characters of the page with their heights; None if there are too few for text."""
    seen = page.text or page.analysis
    if seen is None:
        return None
    on_page = page.on_page if seen is page.analysis else np.ones(len(seen.characters), bool)
    if np.count_nonzero(on_page) < FEWEST_CHARACTERS:
        return None
    is_light = page.analysis is not None and page.analysis.positive is not None
    return PrintSample(seen.characters[on_page], (print_heights(seen.text) / seen.factor)[on_page], is_light)


def print_heights(text: IdentifiedText) -> Vector:
    """Heights (N,) of the characters in pixels of the analysed image.

    In a blurred photo the letters of a word are one component, whose extent is not that of a letter.
    """
    shortest = text.components.boxes[:, 2:].min(axis=1).astype(np.float64)
    longest = text.components.boxes[:, 2:].max(axis=1)
    return np.asarray(np.where(longest > WORD * shortest, shortest, text.components.sizes))

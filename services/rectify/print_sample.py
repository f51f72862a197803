"""Characters of a page in the photo, for figures of the photo's quality."""

from services.arrays import Points
from services.rectify.analysis import PageAnalysis
from services.rectify.results import PrintSample


def sample_print(analysis: PageAnalysis, characters: Points) -> PrintSample | None:
    """Characters of the page with their heights; None if most of what was taken for text is none.

    `characters` (N, 2) are those that belong to the page.
    """
    if len(characters) == 0 or len(characters) != len(analysis.characters):
        return None
    return PrintSample(analysis.characters, analysis.text.components.sizes / analysis.factor)

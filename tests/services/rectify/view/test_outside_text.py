"""Words beside a sheet are its text, so that it does not end there; grain of a desk is none."""

from dataclasses import replace

import numpy as np
import pytest

from services.arrays import Points
from services.rectify.analysis.page_analysis import PageAnalysis
from services.rectify.view.outside_text import has_text_outside
from tests.services.scenes import Album

pytestmark = pytest.mark.pipeline


def upper_part(analysis: PageAnalysis, share: float) -> Points:
    """A polygon round this share of the page's height."""
    low, high = analysis.characters.min(axis=0) - 20, analysis.characters.max(axis=0) + 20
    end = low[1] + share * (high[1] - low[1])
    return np.array([low, [high[0], low[1]], [high[0], end], [low[0], end]])


def test_words_outside_are_text(album: Album) -> None:
    analysis = album["plain"].analysis
    assert has_text_outside(analysis, upper_part(analysis, 0.5))
    assert not has_text_outside(analysis, upper_part(analysis, 1.0))


def test_single_specks_outside_are_none(album: Album) -> None:
    analysis = album["plain"].analysis
    # Every twelfth letter: as many as speak for text, but none has a neighbour within a word's reach.
    sparse = np.arange(len(analysis.printed.sizes)) % 12 == 0
    assert sparse.sum() > 60
    specks = replace(
        analysis,
        printed=type(analysis.printed)(
            **{
                name: getattr(analysis.printed, name)[sparse]
                for name in analysis.printed.__dataclass_fields__
            }
        ),
    )
    assert not has_text_outside(specks, upper_part(analysis, 0.2))

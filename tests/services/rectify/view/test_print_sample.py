"""Which characters figures of a photo's quality are measured on."""

from types import SimpleNamespace

import numpy as np
import pytest

from services.rectify.view.print_sample import print_heights, sample_print
from services.texture_flow.text_identification import FEWEST_CHARACTERS
from tests.services.scenes import Album

pytestmark = pytest.mark.pipeline


def test_only_characters_of_the_page_are_sampled(album: Album) -> None:
    analysis = album["plain"].analysis
    upper = analysis.characters[:, 1] < np.median(analysis.characters[:, 1])
    sample = sample_print(SimpleNamespace(text=None, analysis=analysis, on_page=upper))
    assert sample is not None
    np.testing.assert_array_equal(sample.characters, analysis.characters[upper])
    np.testing.assert_allclose(sample.heights_px, print_heights(analysis.text)[upper] / analysis.factor)


def test_a_few_characters_are_no_text(album: Album) -> None:
    analysis = album["plain"].analysis
    few = np.arange(len(analysis.characters)) < FEWEST_CHARACTERS - 1
    assert sample_print(SimpleNamespace(text=None, analysis=analysis, on_page=few)) is None
    # Where only the sides were asked, all text that was found is the page's.
    found = sample_print(SimpleNamespace(text=analysis, analysis=None, on_page=few))
    assert found is not None
    assert len(found.characters) == len(analysis.characters)

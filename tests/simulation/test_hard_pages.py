"""Hard pages: they differ from the plain ones in what makes them hard, and in no zone of text."""

import numpy as np
import pytest

from simulation.hard_pages import DIFFICULTIES, Difficulty, hard_page

NEVER_PLAIN = {"margin-notes"}
SET_ANEW = {"footnotes", "two-columns", "three-columns", "listing"}
"""Their text has other places on the plain page."""
ADDED_TEXT = {"line-numbers", "page-number"}


@pytest.mark.parametrize("difficulty", [each for each in DIFFICULTIES if each not in NEVER_PLAIN])
def test_a_hard_page_has_the_text_of_the_plain_one(difficulty: Difficulty) -> None:
    plain, hard = (hard_page(np.random.default_rng(7), difficulty, plain=each) for each in (True, False))
    assert plain.image is not None
    assert hard.image is not None
    assert not np.array_equal(plain.image, hard.image)
    texts = [{(z.text, z.box) for z in page.zones if z.kind == "text"} for page in (plain, hard)]
    if difficulty in SET_ANEW:
        assert plain.zones[0].label == hard.zones[0].label
    else:
        assert texts[0] <= texts[1]
        assert len(texts[1] - texts[0]) == (difficulty in ADDED_TEXT)


@pytest.mark.parametrize("difficulty", DIFFICULTIES)
def test_a_zone_of_a_hard_page_is_round_ink(difficulty: Difficulty) -> None:
    page = hard_page(np.random.default_rng(3), difficulty)
    assert page.image is not None
    for zone in page.zones:
        x0, y0, x1, y1 = zone.box
        assert 0 <= x0 < x1 <= page.width
        assert 0 <= y0 < y1 <= page.height
        assert np.count_nonzero(page.image[y0:y1, x0:x1] < 160) > 20


def test_the_number_of_the_seed_decides_the_page() -> None:
    first, again, other = (hard_page(np.random.default_rng(seed), "form") for seed in (1, 1, 2))
    assert first.zones == again.zones
    assert first.zones != other.zones

"""Features of a zone from the title of the section that it belongs to: its own first words, or a title above it.

All section titles of a publication have one label, and two paragraphs may differ in nothing but the title above them:
"Abstract" here, "1 Introduction" there. No attribute of one zone, nor the label of a neighbour, has that.
"""

import numpy as np
from numpy.typing import NDArray

from services.layout.graph.node_attributes import order_from_top
from services.layout.page import Page

SECTION_FEATURES = ("section:abstract", "section:text")
"""Confidences that a zone belongs to the abstract, and to another section of text. Both are 0 where no title is."""

_ABSTRACT, _TITLE = "abstract", "heading"
_OTHER_TITLES = ("keywords", "references")
"""Content features that begin a section (Table 5.1 and beyond); those of `_OTHER_TITLES` end the one above, and
begin neither of the two."""

SAME_COLUMN = 0.5
"""Least common width of a title and a zone of its section, as a share of the narrower one: a title is as far left as
its text, or centred over it; notes in the margin share no width with it."""


def measure_sections(page: Page, boxes: NDArray[np.float64]) -> NDArray[np.float64]:
    """`SECTION_FEATURES` (N, 2) of all zones of a page that was read.

    A zone that begins with a title has the section of its own title. Of the titles above others in their column the
    nearest decides, as far as it is sure; the next one decides about the rest.

    Parameters
    ----------
    page
        The page; its zones already carry their content features.
    boxes
        Its boxes (N, 4), in any unit.
    """
    titled, kinds = _find_titles(page)
    from_top = np.argsort(-order_from_top(boxes))
    x0, _, x1, _ = boxes.T
    shared = np.minimum(x1[:, None], x1) - np.maximum(x0[:, None], x0)
    in_column = shared >= SAME_COLUMN * np.minimum((x1 - x0)[:, None], x1 - x0)
    # Columns from the lowest zone of the page to the highest: a zone's own title, then those above it.
    sure = np.where(in_column, titled, 0.0)[:, from_top]
    place = np.empty(len(from_top), dtype=np.intp)
    place[from_top] = np.arange(len(from_top))
    sure[np.arange(len(from_top)) < place[:, None]] = 0.0
    undecided = np.cumprod(1 - sure, axis=1)
    before = np.hstack([np.ones((len(sure), 1)), undecided[:, :-1]])
    return np.asarray((before * sure) @ kinds[from_top])


def _find_titles(page: Page) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """For each zone how surely it begins with a title (N,), and what share of that each of `SECTION_FEATURES` has."""
    names = (_ABSTRACT, _TITLE, *_OTHER_TITLES)
    cues = np.array([[zone.content.get(name, 0.0) for name in names] for zone in page.zones])
    cues = np.clip(cues.reshape(-1, len(names)), 0.0, 1.0)
    titled = cues.max(axis=1, initial=0.0)
    # Titles of abstracts, keywords and references are titles of sections, too: a section of text has none of these.
    special, title = cues[:, [0, *range(2, len(names))]], cues[:, 1]
    text = np.maximum(0.0, title - special.max(axis=1, initial=0.0))
    # A sure title of a section that is a weak cue of an abstract ("Summary") mostly begins a text.
    special = np.maximum(0.0, special - np.maximum(0.0, title[:, None] - special))
    shares = np.column_stack([special[:, 0], text])
    total = special.sum(axis=1) + text
    return titled, shares / np.maximum(total, 1e-9)[:, None]

"""Words by rows: which words of a page stand beside each other."""

from collections.abc import Iterable
from typing import Protocol, TypeVar

from services.contract.boxes import SAME_ROW
from services.layout.page import Box


class _Printed(Protocol):
    """Whatever has a box in pixels: a word that was read, a word of a zone."""

    @property
    def box(self) -> Box: ...


W = TypeVar("W", bound=_Printed)


def rows_of_words(words: Iterable[W]) -> list[list[W]]:
    """The rows of words, from the top down by the mean height of their words, each from left to right.

    From the left each word is put to the row whose last word is most at its height, so that rows may slant.
    """
    rows: list[list[W]] = []
    for word in sorted(words, key=lambda each: each.box[0]):
        y0, y1 = word.box[1], word.box[3]
        best, most = None, SAME_ROW
        for row in rows:
            a, b = row[-1].box[1], row[-1].box[3]
            common = (min(y1, b) - max(y0, a)) / max(1e-6, min(y1 - y0, b - a))
            if common > most:
                best, most = row, common
        if best is None:
            rows.append([word])
        else:
            best.append(word)
    return sorted(rows, key=lambda row: sum(word.box[1] + word.box[3] for word in row) / len(row))

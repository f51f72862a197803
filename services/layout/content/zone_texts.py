"""Texts for zones from a client, taken from the words that OCR read on the page."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from services.layout.page import Page, Zone
from services.layout.read_words import read_words
from services.ocr.engine import Word


def fill_texts(page: Page, words: Sequence[Word]) -> Page:
    """The page; zones without a text get the words inside them, one line for each row of print.

    A word belongs to the smallest zone that contains its centre. `words` are in reading order, as OCR engines give
    them.
    """
    if not words or not page.zones:
        return page
    boxes = np.array([zone.box for zone in page.zones])
    areas = (boxes[:, 2] - boxes[:, 0]) * (boxes[:, 3] - boxes[:, 1])
    held: list[list[Word]] = [[] for _ in page.zones]
    for word in words:
        x, y = (word.box[0] + word.box[2]) / 2, (word.box[1] + word.box[3]) / 2
        inside = (boxes[:, 0] <= x) & (x <= boxes[:, 2]) & (boxes[:, 1] <= y) & (y <= boxes[:, 3])
        if inside.any():
            held[int(np.argmin(np.where(inside, areas, np.inf)))].append(word)
    return replace(
        page,
        zones=tuple(
            zone if zone.text or not mine else _with_words(zone, _lines_of(mine))
            for zone, mine in zip(page.zones, held, strict=True)
        ),
    )


def _with_words(zone: Zone, lines: Sequence[Sequence[Word]]) -> Zone:
    """The zone with the text and the words of its lines."""
    return replace(
        zone,
        text="\n".join(" ".join(word.text for word in line) for line in lines),
        words=read_words(lines),
    )


def _lines_of(words: Sequence[Word]) -> list[list[Word]]:
    """Words in reading order by their lines.

    A word begins a line that starts left of the last one and lies lower, or that lies below it altogether.
    """
    lines: list[list[Word]] = [[]]
    last: Word | None = None
    for word in words:
        if last is not None and (
            (word.box[0] < last.box[0] and word.box[3] > last.box[3]) or word.box[1] >= last.box[3]
        ):
            lines.append([])
        lines[-1].append(word)
        last = word
    return lines

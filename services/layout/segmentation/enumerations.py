"""Items of enumerations, "(1) ...", "(2) ...": each is a paragraph of its own, however it is set."""

import re
from collections.abc import Sequence

from services.layout.segmentation.text_lines import Line
from services.layout.segmentation.typical_print import EDGE_SLACK, UNRELIABLE_STEP

_NUMBER = re.compile(r"(?P<open>[(\[]?)(?P<number>\d{1,3}|[a-z])(?P<close>[)\].])\s+\S")
"""What an item begins with; letters need a bracket, since "a." begins a line of names."""


def item_starts(lines: Sequence[Line], texts: Sequence[str]) -> set[int]:
    """Indices of the lines that begin an item: one with the number before or after it begins another one.

    Both lines begin at one edge, with numbers in the same brackets, and are of one size. `texts` are those of the
    lines, "" where none was read.
    """
    found = [(index, *read) for index, text in enumerate(texts) if (read := _read(text)) is not None]
    starts: set[int] = set()
    for place, (first, style, number) in enumerate(found):
        for second, other_style, other in found[place + 1 :]:
            if style == other_style and abs(number - other) == 1:
                upper, lower = (first, second) if number < other else (second, first)
                if _are_neighbours(lines[upper], lines[lower]):
                    starts |= {first, second}
    return starts


def _read(text: str) -> tuple[str, int] | None:
    """The brackets of an item's number and the number."""
    read = _NUMBER.match(text)
    if read is None:
        return None
    number, close = read["number"], read["close"]
    if number.isdigit():
        return read["open"] + close, int(number)
    return None if close == "." else (f"{read['open']}a{close}", ord(number))


def _are_neighbours(upper: Line, lower: Line) -> bool:
    em = max(upper.em, lower.em)
    down = lower.baseline - upper.baseline
    edge = abs(upper.box[0] - lower.box[0])
    alike = em < UNRELIABLE_STEP * min(upper.em, lower.em)
    return bool(alike and down > 0 and edge < EDGE_SLACK * em)

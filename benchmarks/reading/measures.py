"""Figures of a text that was read, as lines, against the printed lines."""

from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import pairwise

from rapidfuzz import fuzz
from rapidfuzz.distance import Levenshtein

from benchmarks.common.reading import LOST_BELOW, normalise_text

NEARLY = 0.1
"""Edit distance over length up to which a long value of a receipt was nearly read."""


def aligned_error(printed: Sequence[str], read: Sequence[str]) -> float:
    """Character error in 0-1 after the lines that were read are put where the printed ones have their text.

    The order of blocks and columns costs nothing; words that were put into another line do, and so does text that is
    not printed.
    """
    lines = [line for line in map(normalise_text, printed) if line]
    truth = " ".join(lines)
    placed: list[tuple[int, int, str]] = []
    place = 0
    for number, line in enumerate(line for line in map(normalise_text, read) if line):
        found = fuzz.partial_ratio_alignment(line, truth) if len(line) <= len(truth) else None
        if found is not None and found.score >= 100 * LOST_BELOW:
            place = found.dest_start
        placed.append((place, number, line))
    text = " ".join(line for *_, line in sorted(placed))
    return Levenshtein.distance(truth, text) / max(len(truth), 1)


def neighbours_kept(printed: Sequence[str], read: Sequence[str]) -> tuple[int, int]:
    """How many of the neighbours within printed lines are neighbours within lines that were read, and of how many.

    Only words count that were read as often as they are printed: what was misread says nothing of its line.
    """
    wanted = [normalise_text(line).split() for line in printed]
    found = [normalise_text(line).split() for line in read]
    printed_words, read_words = (
        Counter(word for line in lines for word in line) for lines in (wanted, found)
    )
    as_often = {word for word, count in printed_words.items() if read_words[word] == count}
    true = Counter(pair for pair in _pairs(wanted) if as_often.issuperset(pair))
    return (true & Counter(_pairs(found))).total(), true.total()


def _pairs(lines: Sequence[Sequence[str]]) -> Iterator[tuple[str, str]]:
    return (pair for line in lines for pair in pairwise(line))


def value_read(value: str, read: Sequence[str]) -> tuple[bool, bool]:
    """Whether a value is in the text in full, and whether it is there with an edit distance of `NEARLY` at most.

    Lines are joined by spaces; upper and lower case are one.
    """
    wanted, text = (normalise_text(each).upper() for each in (value, " ".join(read)))
    if wanted in text:
        return True, True
    found = fuzz.partial_ratio_alignment(wanted, text) if len(text) > len(wanted) else None
    if found is None:
        return False, False
    part = text[found.dest_start : found.dest_end]
    return False, Levenshtein.distance(wanted, part) <= NEARLY * len(wanted)

"""The letters of a word in the order of reading, from their order on the page.

`tesserocr` gives the letters of every word from left to right, also of Arabic and Hebrew ones: it calls the method of
`LTRResultIterator`, which is not virtual. This turns such words round, as the Unicode Bidirectional Algorithm (UAX #9)
orders one word: numbers and Latin letters keep their order, brackets are mirrored.
"""

import unicodedata

_RIGHT_TO_LEFT = frozenset({"R", "AL"})
_LEFT_TO_RIGHT = frozenset({"L", "EN", "AN"})
_BETWEEN = frozenset({"ES", "CS"})
"""Signs that belong to a number on both sides of them, as in 12/5."""
_BESIDE = "ET"
"""Signs that belong to a number next to them, as in 50 %."""
_MARK = "NSM"
_MIRRORED = dict(zip("()[]{}<>«»‹›", ")(][}{><»«›‹", strict=True))


def order_letters(seen: str) -> str:
    """The word `seen`, letters from left to right on the page, in the order in which it is read.

    A word without right-to-left letters is returned as it is.
    """
    letters = _clusters(seen)
    kinds = [unicodedata.bidirectional(letter[0]) for letter in letters]
    if not _RIGHT_TO_LEFT.intersection(kinds):
        return seen
    kept = [_keeps_order(kinds, index) for index in range(len(kinds))]
    turned: list[str] = []
    run: list[str] = []
    for letter, keeps in zip(reversed(letters), reversed(kept), strict=True):
        if keeps:
            run.insert(0, letter)
            continue
        turned += [*run, _MIRRORED.get(letter, letter)]
        run = []
    return "".join([*turned, *run])


def _clusters(text: str) -> list[str]:
    """Characters with the marks that follow them."""
    clusters: list[str] = []
    for character in text:
        if clusters and unicodedata.bidirectional(character) == _MARK:
            clusters[-1] += character
        else:
            clusters.append(character)
    return clusters


def _keeps_order(kinds: list[str], index: int) -> bool:
    """Whether the letter at `index` belongs to a run that is read from left to right."""
    kind = kinds[index]
    before = kinds[index - 1] if index > 0 else ""
    after = kinds[index + 1] if index + 1 < len(kinds) else ""
    if kind in _BETWEEN:
        return before in _LEFT_TO_RIGHT and after in _LEFT_TO_RIGHT
    if kind == _BESIDE:
        return "EN" in (before, after)
    return kind in _LEFT_TO_RIGHT

"""The language of a page by its function words: which word lists its content features take."""

import re
from collections.abc import Iterable, Mapping

_LEAST_WORDS = 4
"""Function words that only this language has; a letter of five lines has ten and more."""
_LEAST_RATIO = 2.0
"""So many times the function words that only the base language has: an English page may quote another language."""
_MOST_CHARACTERS = 20_000
"""Characters of a page that are searched; a full page of small print has about 8000."""


_WORD = re.compile(r"[^\W\d_]++")


def own_words(words: Mapping[str, Iterable[str]]) -> dict[str, frozenset[str]]:
    """For every language its function words, casefolded, without those that another language has too."""
    folded = {language: {word.casefold() for word in listed} for language, listed in words.items()}
    return {
        language: frozenset(listed.difference(*(folded[other] for other in folded if other != language)))
        for language, listed in folded.items()
    }


def find_language(texts: Iterable[str], words: Mapping[str, frozenset[str]], base: str) -> str:
    """The language whose own function words are most in `texts`; `base` where none is clear.

    Parameters
    ----------
    texts
        The texts of a page's zones.
    words
        Function words of every language, as from `own_words`; `base` among them.
    base
        The language of pages with few words.
    """

    counts = dict.fromkeys(words, 0)
    left = _MOST_CHARACTERS
    for text in texts:
        if left <= 0:
            break
        for word in _WORD.findall(text[:left].casefold()):
            for language, listed in words.items():
                counts[language] += word in listed
        left -= len(text)
    best = max(counts, key=lambda language: counts[language])
    enough = max(_LEAST_WORDS, _LEAST_RATIO * counts[base])
    return best if counts[best] >= enough else base

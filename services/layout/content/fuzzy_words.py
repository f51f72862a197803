"""Search for listed words in text with OCR errors.

Letters that OCR confuses are replaced by one letter. The result may differ from a listed word by one or two edits,
depending on its length. Candidates come from an index of the listed words with letters deleted (as in SymSpell), so
that the time of a look-up does not depend on the length of the list.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import combinations

from rapidfuzz.distance import OSA

LONGEST_WORD = 18
"""Longer words must match exactly, since the size of the index grows with the square of the length."""
_FOLD = str.maketrans({"0": "o", "1": "l", "i": "l", "5": "s", "8": "b", "c": "e", "v": "u"})
_CACHED = 20_000


@dataclass(frozen=True, slots=True)
class Tolerance:
    """Least lengths of a word at which confused letters, one edit, or two edits are accepted."""

    folded_from: int
    one_edit_from: int
    two_edits_from: int

    def edits(self, length: int) -> int:
        """Largest edit distance for a listed word of this length."""
        return int(length >= self.one_edit_from) + int(length >= self.two_edits_from)


ANCHORED = Tolerance(folded_from=3, one_edit_from=4, two_edits_from=8)
"""At positions where key words are expected: `ene` matches `enc`, `Deer` `Dear`, `Sincersiy` `Sincerely`."""
ANYWHERE = Tolerance(folded_from=4, one_edit_from=6, two_edits_from=10)
"""Within running text, where `match` must not be read as `March`."""


def fold(word: str) -> str:
    """The casefolded word with one letter for each set of confused letters: `rn` and `m`, `1` `i` `l`, `c` `e`."""
    return word.replace("rn", "m").replace("vv", "w").translate(_FOLD)


class FuzzyWords:
    """An index of casefolded words."""

    def __init__(self, words: Iterable[str], tolerance: Tolerance) -> None:
        self._words = frozenset(words)
        self._tolerance = tolerance
        self._index: dict[str, list[str]] = {}
        self._seen: dict[str, tuple[str, ...]] = {}
        for word in sorted(self._words):
            if word.isdigit() or not tolerance.folded_from <= len(word) <= LONGEST_WORD:
                continue
            for key in _shortened(fold(word), tolerance.edits(len(word))):
                self._index.setdefault(key, []).append(word)

    def __contains__(self, word: str) -> bool:
        return word in self._words

    def near(self, word: str) -> tuple[str, ...]:
        """The listed words, except `word` itself, of which `word` (casefolded) may be a misreading."""
        found = self._seen.get(word)
        if found is None:
            found = self._search(word)
            if len(self._seen) >= _CACHED:
                self._seen.clear()
            self._seen[word] = found
        return found

    def is_near(self, word: str, listed: str) -> bool:
        """Whether `word` is `listed`, or may be a misreading of it."""
        if word == listed:
            return True
        length = len(listed)
        if not self._tolerance.folded_from <= length <= LONGEST_WORD or word.isdigit():
            return False
        edits = self._tolerance.edits(length)
        return OSA.distance(fold(word), fold(listed), score_cutoff=edits) <= edits

    def _search(self, word: str) -> tuple[str, ...]:
        # A single letter or a number is never treated as misread.
        if word.isdigit() or not 2 <= len(word) <= LONGEST_WORD + 2:
            return ()
        keys = _shortened(fold(word), self._tolerance.edits(len(word) + 1))
        candidates = {listed for key in keys for listed in self._index.get(key, ())}
        return tuple(sorted(listed for listed in candidates if listed != word and self.is_near(word, listed)))


def _shortened(word: str, count: int) -> set[str]:
    """The word, and the word with up to `count` (at most 2) letters left out."""
    found = {word}
    if count >= 1:
        found.update(word[:i] + word[i + 1 :] for i in range(len(word)))
    if count >= 2:
        found.update(word[:i] + word[i + 1 : j] + word[j + 1 :] for i, j in combinations(range(len(word)), 2))
    return found

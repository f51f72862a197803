"""Content features of zones (dissertation 5.6.2, Table 5.1): the confidence that a text is a date, a greeting, ...

A settings file has the words and patterns (`content_settings`); this module searches for them. The texts come from
OCR, so key words may have misread letters (`fuzzy_words`). The time for any text is bounded. Word lists are those of
the page's language (`text_language`).
"""

import re
import unicodedata
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cache, lru_cache
from itertools import islice
from pathlib import Path

from services.contract.bounded_patterns import LONGEST_TEXT
from services.layout.content.content_settings import (
    BASE_LANGUAGE,
    LANGUAGE_FILES,
    FeatureSettings,
    Place,
    read_function_words,
    read_settings,
)
from services.layout.content.fuzzy_words import ANCHORED, ANYWHERE, FuzzyWords
from services.layout.content.text_language import find_language, own_words
from services.layout.page import Page

WEAK = 0.5
"""Confidence of a weak cue: it is as likely to be something else."""
AFTER_NOISE = 0.8
"""Confidence of a cue after one word of up to two letters, which may be OCR noise."""
LONGEST_END = 400
"""Characters that are searched at the end of a text longer than `LONGEST_TEXT`."""
MOST_LINES = 80
"""Lines of a zone that are searched; a column of a page has fewer."""
MOST_HITS = 600
"""Largest number of places of one feature in one zone."""
_WORD = re.compile(r"[^\W_]++")
_BLANKS = re.compile(r"[^\S\n]++")
_LINE_ENDS = re.compile(r" ?\n\s*+")
_EDGES = " \t\n'\"‘’“”`~_*|.-—–:;,"
"""Characters that OCR reads from dirt around the text of a zone."""

Hit = tuple[int, int, float]
"""Start and end (exclusive) of a cue in characters, and its confidence."""


@dataclass(frozen=True, slots=True)
class _Phrase:
    feature: int
    words: tuple[str, ...]
    confidence: float


@dataclass(frozen=True, slots=True)
class _Pattern:
    feature: int
    at: Place
    every: bool
    """Whether all places count, or only the first one."""
    pattern: re.Pattern[str]
    confidence: float


@dataclass(frozen=True, slots=True)
class _Text:
    text: str
    bare: str
    """The text without `_EDGES` around it."""
    words: list[str]
    """Casefolded."""
    spans: list[tuple[int, int]]
    line_starts: list[int]
    line_words: list[int]
    """The first word of each line that has one."""

    def capital(self, number: int) -> bool:
        return self.text[self.spans[number][0]].isupper()


class ContentFeatures:
    """Measures all features of the settings. Threads can share it.

    `in_language` gives the same features with the word lists of another language; None: there are no others.
    """

    def __init__(
        self,
        settings: Iterable[FeatureSettings],
        in_language: Callable[[str], "ContentFeatures"] | None = None,
    ) -> None:
        self._in_language = in_language
        self._settings = tuple(settings)
        phrases: dict[bool, dict[str, list[_Phrase]]] = {True: {}, False: {}}
        patterns: list[_Pattern] = []
        for number, feature in enumerate(self._settings):
            anchored, every = feature.at != "anywhere", feature.full_share is not None
            for entries, confidence in ((feature.phrases, 1.0), (feature.weak_phrases, WEAK)):
                for entry in entries:
                    words = tuple(_read(entry).words)
                    if words:
                        begun = phrases[anchored].setdefault(words[0], [])
                        begun.append(_Phrase(number, words, confidence))
            for found, confidence in ((feature.patterns, 1.0), (feature.weak_patterns, WEAK)):
                patterns += [_Pattern(number, feature.at, every, pattern, confidence) for pattern in found]
        self._patterns = tuple(patterns)
        self._phrases = phrases
        self._fuzzy = {
            anchored: FuzzyWords(
                (word for begun in index.values() for phrase in begun for word in phrase.words),
                ANCHORED if anchored else ANYWHERE,
            )
            for anchored, index in phrases.items()
        }

    @classmethod
    def load(cls, path: Path | None = None) -> "ContentFeatures":
        """The features of this package, extended or replaced by a user's settings file.

        The word lists of other languages are indexed when the first page needs them.

        Raises
        ------
        InvalidContentSettings
            When the file is invalid; the error names the file and the key.
        """
        others = {language: read_settings(path, language) for language in LANGUAGE_FILES}
        return cls(read_settings(path), cache(lambda language: cls(others[language])))

    @property
    def names(self) -> tuple[str, ...]:
        """The features, in the order of their settings."""
        return tuple(feature.name for feature in self._settings)

    def measure(self, text: str) -> dict[str, float]:
        """Confidence, 0-1, of every feature in a zone's text, by the word lists of the base language.

        At most `LONGEST_TEXT` characters are searched.
        """
        read = _read(text)
        if not read.text:
            return dict.fromkeys(self.names, 0.0)
        # Features of short zones are not searched in long ones.
        sizes = [_size_factor(feature, len(read.words)) for feature in self._settings]
        hits: list[list[Hit]] = [[] for _ in self._settings]
        self._find_phrases(read, sizes, hits)
        self._find_patterns(read, sizes, hits)
        return {
            feature.name: _graded(feature, found, read, size) if found else 0.0
            for feature, found, size in zip(self._settings, hits, sizes, strict=True)
        }

    def measure_page(self, page: Page) -> Page:
        """The page with content features for every zone that has a text and no features yet.

        They are measured by the word lists of the page's language.
        """
        if all(zone.content or not zone.text.strip() for zone in page.zones):
            return page
        own = self.in_language_of(page)
        measured: dict[str, Mapping[str, float]] = {}
        zones = []
        for zone in page.zones:
            if zone.content or not zone.text.strip():
                zones.append(zone)
                continue
            if zone.text not in measured:
                measured[zone.text] = own.measure(zone.text)
            zones.append(replace(zone, content=measured[zone.text]))
        return replace(page, zones=tuple(zones))

    def in_language_of(self, page: Page) -> "ContentFeatures":
        """The features with the word lists of the page's language."""
        language = page_language(page)
        if self._in_language is None or language == BASE_LANGUAGE:
            return self
        return self._in_language(language)

    def _find_phrases(self, read: _Text, sizes: list[float], hits: list[list[Hit]]) -> None:
        index, known, fuzzy = self._phrases[False], self._fuzzy[True], self._fuzzy[False]
        for number, word in enumerate(read.words):
            if word in index:
                self._add(read, number, index[word], 1.0, sizes, hits)
            elif word not in fuzzy and word not in known:
                for listed in fuzzy.near(word):
                    self._add(read, number, index.get(listed, ()), 1.0, sizes, hits)
        if not any(
            size for size, feature in zip(sizes, self._settings, strict=True) if feature.at != "anywhere"
        ):
            return
        for line, number in enumerate(read.line_words):
            self._find_anchored(read, number, 1.0, line, sizes, hits)
            if len(read.words[number]) <= 2 and number + 1 < len(read.words):
                self._find_anchored(read, number + 1, AFTER_NOISE, line, sizes, hits)

    def _find_anchored(
        self, read: _Text, number: int, factor: float, line: int, sizes: list[float], hits: list[list[Hit]]
    ) -> None:
        """Add the phrases that begin with a word at the start of a line."""
        index, word = self._phrases[True], read.words[number]
        if word in index:
            candidates = [word]
        elif word in self._fuzzy[True] or word in self._fuzzy[False]:
            # A listed word is not a misreading of another one.
            candidates = []
        else:
            candidates = [listed for listed in self._fuzzy[True].near(word) if listed in index]
        for candidate in candidates:
            phrases = [p for p in index[candidate] if line == 0 or self._settings[p.feature].at == "line"]
            self._add(read, number, phrases, factor, sizes, hits)

    def _add(
        self,
        read: _Text,
        number: int,
        phrases: Iterable[_Phrase],
        factor: float,
        sizes: list[float],
        hits: list[list[Hit]],
    ) -> None:
        """Add the hits of the phrases that begin at word `number`."""
        for phrase in phrases:
            feature = self._settings[phrase.feature]
            if sizes[phrase.feature] == 0.0 or len(hits[phrase.feature]) >= MOST_HITS:
                continue
            end = number + len(phrase.words)
            here = tuple(read.words[number:end])
            if feature.at == "whole" and end != len(read.words):
                continue
            if here != phrase.words:
                fuzzy = self._fuzzy[feature.at != "anywhere"]
                if len(here) != len(phrase.words) or not all(map(fuzzy.is_near, here, phrase.words)):
                    continue
            confidence = factor * phrase.confidence * (1.0 if here == phrase.words else feature.fuzzy)
            if confidence == 0.0 or (feature.capitalised and not read.capital(number)):
                continue
            last = min(end + feature.capitals_after, len(read.words))
            while end < last and read.capital(end):
                end += 1
            hits[phrase.feature].append((read.spans[number][0], read.spans[end - 1][1], confidence))

    def _find_patterns(self, read: _Text, sizes: list[float], hits: list[list[Hit]]) -> None:
        for entry in self._patterns:
            if sizes[entry.feature] > 0.0:
                for hit in _places(entry, read):
                    if hit and hit.end() > hit.start():
                        hits[entry.feature].append((hit.start(), hit.end(), entry.confidence))


def _places(entry: _Pattern, read: _Text) -> Iterable[re.Match[str] | None]:
    """Matches of a pattern at the places that its feature allows."""
    pattern = entry.pattern
    match entry.at:
        case "whole":
            return (pattern.fullmatch(read.bare) or pattern.fullmatch(read.text),)
        case "start":
            return (pattern.match(read.text),)
        case "line":
            return [pattern.match(read.text, start) for start in read.line_starts]
        case "anywhere":
            return islice(pattern.finditer(read.text), MOST_HITS if entry.every else 1)


def _read(text: str) -> _Text:
    """The normalized text: one form of every character, one blank between words, no empty lines, bounded length."""
    if len(text) > LONGEST_TEXT:
        # The start and the end of a text have most of the cues.
        text = f"{text[: LONGEST_TEXT - LONGEST_END]} {text[-LONGEST_END + 1 :]}"
    if not text.isascii():
        text = unicodedata.normalize("NFKC", text)[:LONGEST_TEXT]
    text = _LINE_ENDS.sub("\n", _BLANKS.sub(" ", "\n".join(text.splitlines()))).strip()
    spans = [match.span() for match in _WORD.finditer(text)]
    words = [text[start:end].casefold() for start, end in spans]
    starts, firsts, number = [0], list[int](), 0
    while len(starts) < MOST_LINES and (end := text.find("\n", starts[-1])) >= 0:
        starts.append(end + 1)
    for start, behind in zip(starts, [*starts[1:], len(text)], strict=True):
        while number < len(spans) and spans[number][0] < start:
            number += 1
        if number < len(spans) and spans[number][0] < behind:
            firsts.append(number)
    return _Text(text, text.strip(_EDGES), words, spans, starts, firsts)


def _size_factor(feature: FeatureSettings, words: int) -> float:
    """1 for zones of the feature's size, falling to 0 at three times the allowed number of words."""
    if feature.words_at_most is not None and words > feature.words_at_most:
        return max(0.0, 1.5 - 0.5 * words / feature.words_at_most)
    return min(1.0, words / feature.words_at_least) if words else 1.0


def _graded(feature: FeatureSettings, hits: list[Hit], read: _Text, size: float) -> float:
    """The best cue's confidence, or the share of the letters that cues cover."""
    if feature.full_share is None:
        return round(size * max(confidence for *_, confidence in hits), 4)
    letters = len(read.text) - read.text.count(" ") - read.text.count("\n")
    full, best = feature.full_share * max(1, letters), 0.0
    # Weak cues add to the covered letters with their own confidence only.
    for level in sorted({confidence for *_, confidence in hits}, reverse=True):
        if level > best:
            spans = sorted((start, end) for start, end, confidence in hits if confidence >= level)
            best = max(best, level * min(1.0, _covered(read.text, spans) / full))
    return round(size * best, 4)


def _covered(text: str, spans: Iterable[tuple[int, int]]) -> int:
    """Letters under spans that are sorted by their start."""
    count = reached = 0
    for start, end in spans:
        if end > reached:
            begin = max(start, reached)
            count += end - begin - text.count(" ", begin, end)
            reached = end
    return count


def page_language(page: Page) -> str:
    """Language of a page's texts, of those that have a settings file; the base language where it is not clear."""
    return find_language((zone.text for zone in page.zones), _own_words(), BASE_LANGUAGE)


@cache
def _own_words() -> dict[str, frozenset[str]]:
    return own_words(read_function_words())


@lru_cache(maxsize=4)
def content_features(settings: Path | None = None) -> ContentFeatures:
    """The content features of a settings file (None: those of this package), read once.

    Raises
    ------
    ValueError
        When the file is no valid settings file; the message names the key.
    """
    return ContentFeatures.load(settings)

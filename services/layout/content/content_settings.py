"""Settings of content features: word lists and patterns, read from TOML files.

A file has one table for each feature; `content_features.toml` of this package shows every key and has English words.
For pages in other languages a file of the folder `languages` is laid over it, and over both a user's file:

- a table of a new name adds a feature;
- a table of a known name adds its `phrases`, `weak_phrases`, `patterns` and `weak_patterns` to those of the
  feature, and its other keys take the place of the feature's;
- with `replace = true` the table takes the place of the whole feature; with `remove = true` it drops it.
"""

import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from re import Pattern
from typing import Any, Literal, get_args

from services.contract.bounded_patterns import UnboundedPattern, compile_bounded

PACKAGED = Path(__file__).with_name("content_features.toml")
BASE_LANGUAGE = "eng"
"""The language of `PACKAGED`, by ISO 639-2/T, as OCR names it."""
LANGUAGE_FILES = {file.stem: file for file in sorted(PACKAGED.with_name("languages").glob("*.toml"))}
"""Settings files of the other languages; they change no set of features, so that all pages can be compared."""
FUNCTION_WORDS = "prose"
"""The feature whose phrases are the words that hold sentences together; they show the language of a page."""
Place = Literal["start", "line", "anywhere", "whole"]
PLACES: tuple[Place, ...] = get_args(Place)
LISTS = ("phrases", "weak_phrases", "patterns", "weak_patterns")
LARGEST_FILE = 1 << 20
MOST_FEATURES = 200
"""Every feature is an attribute of every node of a layout graph."""
MOST_ENTRIES = 20_000


class InvalidContentSettings(ValueError):
    """A settings file is invalid; `key` names the entry, as in `greeting.patterns[2]`."""

    def __init__(self, path: Path, key: str, reason: str) -> None:
        super().__init__(path, key, reason)
        self.path = path
        self.key = key
        self.reason = reason

    def __str__(self) -> str:
        return f"{self.path}: {self.key}: {self.reason}" if self.key else f"{self.path}: {self.reason}"


@dataclass(frozen=True, slots=True)
class FeatureSettings:
    """One feature: its phrases and patterns, where they are searched, and how they give a confidence.

    The cues are found at the `start` of a zone, of each `line`, `anywhere`, or must be the `whole` zone. A phrase
    or pattern counts 1, a weak one 0.5, a phrase with letters misread `fuzzy` times that (0: never). With
    `words_at_most` the confidence falls with longer zones, to 0 at three times this number; with
    `words_at_least` it grows in proportion up to this number. With `full_share` it is the share of the zone's letters
    that the cues cover, 1 from `full_share` on. `capitalised` phrases count only where they begin with a capital;
    up to `capitals_after` capitalised words behind a phrase are covered too.
    """

    name: str
    at: Place = "anywhere"
    phrases: tuple[str, ...] = ()
    weak_phrases: tuple[str, ...] = ()
    patterns: tuple[Pattern[str], ...] = ()
    weak_patterns: tuple[Pattern[str], ...] = ()
    fuzzy: float = 0.7
    words_at_most: int | None = None
    words_at_least: int = 1
    full_share: float | None = None
    capitalised: bool = False
    capitals_after: int = 0


def _number(value: Any, least: float, most: float) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and least <= value <= most


def _whole(value: Any, least: int, most: int) -> bool:
    return isinstance(value, int) and _number(value, least, most)


_GRADES: dict[str, tuple[Callable[[Any], bool], str]] = {
    "at": (lambda value: value in PLACES, f"one of {', '.join(PLACES)}"),
    "fuzzy": (lambda value: _number(value, 0.0, 1.0), "a number from 0 to 1"),
    "words_at_most": (lambda value: _whole(value, 1, 10_000), "a whole number from 1 to 10000"),
    "words_at_least": (lambda value: _whole(value, 1, 1000), "a whole number from 1 to 1000"),
    "full_share": (lambda value: _number(value, 0.01, 1.0), "a number from 0.01 to 1"),
    "capitalised": (lambda value: isinstance(value, bool), "true or false"),
    "capitals_after": (lambda value: _whole(value, 0, 5), "a whole number from 0 to 5"),
}
"""For each key of a feature: a check of its value, and the allowed values in words."""


def read_settings(path: Path | None = None, language: str = BASE_LANGUAGE) -> tuple[FeatureSettings, ...]:
    """The features of this package for pages in `language`, extended or replaced by a user's settings file.

    Raises
    ------
    InvalidContentSettings
        When a file is no such TOML, a key is unknown or of the wrong type, or a pattern's work is not bounded.
    """
    features: dict[str, FeatureSettings] = {}
    for file in (PACKAGED, LANGUAGE_FILES.get(language), path):
        if file is not None:
            _lay_over(features, file)
    if not 1 <= len(features) <= MOST_FEATURES:
        raise InvalidContentSettings(path or PACKAGED, "", f"there must be 1 to {MOST_FEATURES} features")
    return tuple(features.values())


def read_function_words() -> dict[str, tuple[str, ...]]:
    """Function words of every language that has a settings file, the base language among them."""
    files = {BASE_LANGUAGE: PACKAGED, **LANGUAGE_FILES}
    return {language: tuple(_tables(file)[FUNCTION_WORDS]["phrases"]) for language, file in files.items()}


def _lay_over(features: dict[str, FeatureSettings], path: Path) -> None:
    """Change `features` as the tables of the file at `path` say."""
    for name, table in _tables(path).items():
        if (removed := table.pop("remove", False)) is True:
            features.pop(name, None)
            continue
        if removed is not False:
            raise InvalidContentSettings(path, f"{name}.remove", "must be true or false")
        anew = table.pop("replace", False)
        if not isinstance(anew, bool):
            raise InvalidContentSettings(path, f"{name}.replace", "must be true or false")
        features[name] = _feature(path, name, table, None if anew else features.get(name))


def _tables(path: Path) -> dict[str, dict[str, Any]]:
    try:
        if path.stat().st_size > LARGEST_FILE:
            raise InvalidContentSettings(path, "", f"larger than {LARGEST_FILE} bytes")
        document = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InvalidContentSettings(path, "", f"cannot be read: {error.strerror}") from error
    except (UnicodeDecodeError, tomllib.TOMLDecodeError, RecursionError) as error:
        raise InvalidContentSettings(path, "", f"no TOML: {error}") from error
    for name, table in document.items():
        if not isinstance(table, dict):
            raise InvalidContentSettings(path, name, "must be a table, [name], of a feature's settings")
        if not 1 <= len(name) <= 60:
            raise InvalidContentSettings(path, name[:60], "a feature's name has 1 to 60 characters")
    return document


def _feature(
    path: Path, name: str, table: Mapping[str, Any], base: FeatureSettings | None = None
) -> FeatureSettings:
    """Check one table and join it with the feature that it adds to."""

    changes: dict[str, Any] = {}
    base = base or FeatureSettings(name)
    for key, value in table.items():
        where = f"{name}.{key}"
        if key in LISTS:
            entries = _entries(path, where, value, compiled=key.endswith("patterns"))
            changes[key] = getattr(base, key) + entries
            if len(changes[key]) > MOST_ENTRIES:
                raise InvalidContentSettings(path, where, f"more than {MOST_ENTRIES} entries")
        elif key not in _GRADES:
            raise InvalidContentSettings(path, where, "no such key")
        else:
            accepted, reason = _GRADES[key]
            if not accepted(value):
                raise InvalidContentSettings(path, where, f"must be {reason}")
            changes[key] = value
    feature = replace(base, **changes)
    if not any(getattr(feature, key) for key in LISTS):
        raise InvalidContentSettings(path, name, "neither phrases nor patterns")
    return feature


def _entries(path: Path, key: str, value: Any, *, compiled: bool) -> tuple[Any, ...]:
    if not isinstance(value, list):
        raise InvalidContentSettings(path, key, "must be a list of strings")
    entries: list[Any] = []
    for number, entry in enumerate(value):
        if not isinstance(entry, str) or not entry.strip() or (not compiled and len(entry) > 200):
            raise InvalidContentSettings(path, f"{key}[{number}]", "a string that is not empty nor too long")
        try:
            entries.append(compile_bounded(entry) if compiled else entry)
        except UnboundedPattern as error:
            raise InvalidContentSettings(path, f"{key}[{number}]", str(error)) from error
    return tuple(entries)

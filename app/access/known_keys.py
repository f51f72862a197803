"""The API keys of API_KEYS and of API_KEYS_FILE: their names, their roles, and the digests by which they are known.

An entry of API_KEYS is `name:key`, or a key alone, whose name is made from its digest. Such keys have no role; the one
named `admin` has the role admin. Elsewhere a name means nothing.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path

from app.roles import ADMIN, InvalidKeys, Key, digest_of_key, read_keys_file

FEWEST_CHARACTERS = 16
"""Shorter keys can be guessed; the log says so at the start."""
_NAMED = re.compile(r"([A-Za-z][A-Za-z0-9_.-]{0,62}):(.+)", re.DOTALL)


def known_keys(entries: Sequence[str], path: Path | None) -> Mapping[str, Key]:
    """The keys of API_KEYS and of the file by their digests; a key that may be sent in several forms has several.

    Raises
    ------
    InvalidKeys
        When the file cannot be used or holds no key, when an entry is `name:`, whose key everybody could guess, or when
        two entries are the same key.
    """
    for number, entry in enumerate(entries, 1):
        if entry.endswith(":") and entry.count(":") == 1:
            raise InvalidKeys(
                f"entry {number} of API_KEYS has nothing behind its colon, and everybody could guess such a key: write "
                "name:key, or a key alone"
            )
    of_file = [] if path is None else read_keys_file(path)
    keys: dict[str, Key] = {}
    for digests, key in (*map(_forms_of_entry, entries), *(({key.digest}, key) for key in of_file)):
        if twice := digests & keys.keys():
            raise InvalidKeys(
                f"the same key is there twice, as {keys[twice.pop()].name} and as {key.name}: remove one of them from "
                "API_KEYS or API_KEYS_FILE"
            )
        keys |= dict.fromkeys(digests, key)
    return keys


def short_keys(entries: Sequence[str]) -> list[str]:
    """Which entries have a key that can be guessed: their numbers, and names where they have one."""
    return [
        f"entry {number} ({named[1]})" if (named := _NAMED.fullmatch(entry)) else f"entry {number}"
        for number, entry in enumerate(entries, 1)
        if len(spellings_of_key(entry)[-1]) < FEWEST_CHARACTERS
    ]


def each_key(keys: Mapping[str, Key]) -> Iterable[Key]:
    """The keys, each once."""
    return dict.fromkeys(keys.values())


def name_of_key(entry: str) -> str:
    """The name of an entry of API_KEYS."""
    named = _NAMED.fullmatch(entry)
    return named[1] if named else "key-" + digest_of_key(_utf8(entry))[:12]


def spellings_of_key(entry: str) -> tuple[str, ...]:
    """What clients may send for an entry: the key; the whole entry too, since a key may have had a colon before."""
    named = _NAMED.fullmatch(entry)
    return (entry, named[2]) if named else (entry,)


def _forms_of_entry(entry: str) -> tuple[set[str], Key]:
    """Digests of all that may be sent for an entry of API_KEYS, and its key."""
    name = name_of_key(entry)
    digests = {digest_of_key(form) for spelled in spellings_of_key(entry) for form in _bytes_of(spelled)}
    return digests, Key(name, ADMIN if name == ADMIN else None, digest_of_key(_utf8(entry)))


def _bytes_of(key: str) -> set[bytes]:
    """The bytes that clients may send for a key: UTF-8 (curl), or Latin-1 if it can encode the key (browsers)."""
    forms = {_utf8(key)}
    with suppress(UnicodeEncodeError):
        forms.add(key.encode("latin-1"))
    return forms


def _utf8(key: str) -> bytes:
    return key.encode("utf-8", "surrogateescape")

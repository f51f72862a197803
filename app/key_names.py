"""Names of API keys. An entry of API_KEYS is `name:key`, or a key alone, whose name is made from its digest."""

import hashlib
import re

_NAMED = re.compile(r"([A-Za-z][A-Za-z0-9_.-]{0,62}):(.+)", re.DOTALL)


def name_of_key(key: str) -> str:
    """The name of an entry of API_KEYS."""
    named = _NAMED.fullmatch(key)
    return (
        named[1]
        if named
        else "key-" + hashlib.sha256(key.encode("utf-8", "surrogateescape")).hexdigest()[:12]
    )


def spellings_of_key(key: str) -> tuple[str, ...]:
    """What clients may send for an entry: the key; the whole entry too, since a key may have had a colon before."""
    named = _NAMED.fullmatch(key)
    return (key, named[2]) if named else (key,)

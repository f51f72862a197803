"""Identifiers that sort by creation time (ULID): 48 bits of milliseconds, 80 random bits."""

import re
import secrets
import threading
from datetime import datetime

_ALPHABET = "0123456789ABCDEFGHJKMNPQRSTVWXYZ"
"""Crockford's base 32: no I, L, O, U."""
_FORM = re.compile(f"[0-7][{_ALPHABET}]{{25}}")
_RANDOM_BITS = 80
_VALUE = {character: value for value, character in enumerate(_ALPHABET)}


class UlidFactory:
    """Makes identifiers that increase strictly within one process, also when the clock stops or steps back."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._last = 0

    def make(self, moment: datetime, after: str | None = None) -> str:
        """An identifier of 26 characters for an aware time, larger than the identifier `after`.

        It does not help to guess the identifiers of other milliseconds.
        """
        fresh = (int(moment.timestamp() * 1000) << _RANDOM_BITS) | secrets.randbits(_RANDOM_BITS)
        with self._lock:
            last = self._last if after is None else max(self._last, _number(after))
            if fresh <= last:
                # The step is random (32 bits), so that the next id of the same millisecond cannot be guessed easily.
                fresh = last + 1 + secrets.randbits(32)
            self._last = fresh
        return "".join(_ALPHABET[(fresh >> shift) & 31] for shift in range(125, -1, -5))


def _number(ulid: str) -> int:
    number = 0
    for character in ulid:
        number = number << 5 | _VALUE[character]
    return number


def is_ulid(text: str) -> bool:
    """Whether `text` has the form of such an identifier."""
    return _FORM.fullmatch(text) is not None

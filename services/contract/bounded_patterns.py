"""Regular expressions with a bounded number of matching steps.

Python's engine backtracks without a limit. A pattern is accepted only if an upper bound of the number of its matching
attempts, from one position of a text of `LONGEST_TEXT` characters, is small. Then matching is fast for every text.
"""

import re

LONGEST_TEXT = 2000
"""Characters of a text that are searched: about thirty lines, enough to recognize the kind of a zone."""
MOST_WAYS = 20_000
"""Largest number of matching attempts from one position; three optional parts of a few words each need far fewer."""
LONGEST_PATTERN = 2000
_UNCOUNTED = 10**9
_COUNT = re.compile(r"\{(\d{0,4})(?:(,)(\d{0,4}))?\}")
_GROUP = re.compile(r"\((?:\?(?:[ims]{1,3}:|:|=|!|>|<=|<!|P<\w{1,40}>))?")
_FLAGS = re.compile(r"\(\?[ims]{1,3}\)")


class UnboundedPattern(ValueError):
    """A pattern is no regular expression, or could take too long."""


def compile_bounded(pattern: str) -> re.Pattern[str]:
    """The compiled pattern; its matching attempts are counted first.

    Raises
    ------
    UnboundedPattern
        When it is no regular expression of Python, is too long, has a back reference, or needs more than `MOST_WAYS`
        attempts (use `{0,5}` for `*`, or the possessive `*+`, which needs one).
    """
    if len(pattern) > LONGEST_PATTERN:
        raise UnboundedPattern(f"the pattern is longer than {LONGEST_PATTERN} characters")
    try:
        compiled = re.compile(pattern)
    except (re.error, RecursionError, OverflowError) as error:
        raise UnboundedPattern(f"{pattern!r} is no regular expression: {error}") from error
    ways = _Reader(pattern).read()
    if ways > MOST_WAYS:
        raise UnboundedPattern(
            f"{pattern!r} can be tried in too many ways: bound its repetitions, as in {{0,5}}"
        )
    return compiled


class _Reader:
    """Counts the matching attempts of a valid pattern from the structure of its groups and repetitions."""

    def __init__(self, pattern: str) -> None:
        self._pattern = pattern
        self._at = 0

    def read(self) -> int:
        flags = _FLAGS.match(self._pattern)
        self._at = flags.end() if flags else 0
        return self._alternatives(0)

    def _alternatives(self, depth: int) -> int:
        if depth > 20:
            raise UnboundedPattern("groups of the pattern are nested too deeply")
        total, ways = 0, 1
        while self._at < len(self._pattern) and self._pattern[self._at] != ")":
            if self._pattern[self._at] == "|":
                self._at += 1
                total, ways = total + ways, 1
            else:
                ways = min(ways * self._repeated(self._atom(depth)), _UNCOUNTED)
        return min(total + ways, _UNCOUNTED)

    def _atom(self, depth: int) -> int:
        letter = self._pattern[self._at]
        if letter == "(":
            opening = _GROUP.match(self._pattern, self._at)
            if opening is None or self._pattern[opening.end() : opening.end() + 1] == "?":
                raise UnboundedPattern(f"{self._pattern!r}: this kind of group is not taken")
            self._at = opening.end()
            ways = self._alternatives(depth + 1)
            self._at += 1
            return ways
        if letter == "[":
            self._at += 2 if self._pattern[self._at + 1] == "^" else 1
            # A closing bracket at the start is a member of the set.
            self._at += 1 if self._pattern[self._at] == "]" else 0
            while self._pattern[self._at] != "]":
                self._at += 2 if self._pattern[self._at] == "\\" else 1
        elif letter == "\\":
            self._at += 1
            if self._pattern[self._at] in "123456789":
                raise UnboundedPattern(f"{self._pattern!r} refers back to a group")
        self._at += 1
        return 1

    def _repeated(self, ways: int) -> int:
        """The attempts of an atom with its repetition, if it has one."""
        sign = self._pattern[self._at : self._at + 1]
        count = _COUNT.match(self._pattern, self._at) if sign == "{" else None
        if sign and sign in "*+?":
            least, most = (1 if sign == "+" else 0), (1 if sign == "?" else LONGEST_TEXT)
            self._at += 1
        elif count is not None and (count[1] or count[2]):
            least = int(count[1] or 0)
            most = least if count[2] is None else int(count[3] or LONGEST_TEXT)
            self._at = count.end()
        else:
            return ways
        manner = self._pattern[self._at : self._at + 1]
        self._at += 1 if manner in {"?", "+"} else 0
        if manner == "+":
            # A possessive repetition does not backtrack.
            return ways
        if ways == 1:
            return max(1, most - least + 1)
        if most * max(1, ways.bit_length() - 1) > 64:
            return _UNCOUNTED
        return int(min(sum(ways**times for times in range(least, most + 1)), _UNCOUNTED))

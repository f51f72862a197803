"""Regular expressions whose work is bounded before they see a text.

Python's engine backtracks without a limit. A pattern is accepted only when the number of ways in which it can be
tried from one place of a text of `LONGEST_TEXT` characters, counted from above, is small: then no text can keep
the engine busy for long.
"""

import re

LONGEST_TEXT = 2000
"""Characters of a text that are looked at: some thirty lines, enough to tell what a zone is."""
MOST_WAYS = 20_000
"""Ways to try a pattern from one place; three optional parts of a few words each stay far below."""
LONGEST_PATTERN = 2000
_UNCOUNTED = 10**9
_COUNT = re.compile(r"\{(\d{0,4})(?:(,)(\d{0,4}))?\}")
_GROUP = re.compile(r"\((?:\?(?:[ims]{1,3}:|:|=|!|>|<=|<!|P<\w{1,40}>))?")
_FLAGS = re.compile(r"\(\?[ims]{1,3}\)")


class UnboundedPattern(ValueError):
    """A pattern that is no regular expression, or might take too long."""


def compile_bounded(pattern: str) -> re.Pattern[str]:
    """Compile a pattern after counting what it may cost.

    Raises
    ------
    UnboundedPattern
        When it is no regular expression of Python, is too long, refers back to a group, or has more than
        `MOST_WAYS` ways to be tried (use `{0,5}` for `*`, or the possessive `*+`, which has one).
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
    """Counts the ways of a pattern that compiles, by the structure of its groups and repetitions."""

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
            # A bracket that stands first is a letter of the set.
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
        """The ways of an atom with the repetition that follows it, if one does."""
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
            # Possessive: what was taken is never given back.
            return ways
        if ways == 1:
            return max(1, most - least + 1)
        if most * max(1, ways.bit_length() - 1) > 64:
            return _UNCOUNTED
        return int(min(sum(ways**times for times in range(least, most + 1)), _UNCOUNTED))

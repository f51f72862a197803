"""Kinds of values by what they look like: those that a text has, and the one that it is as a whole.

Whether a text has such a value is not decided here; `services.layout.values` reads them.
"""

import re

_DATE = r"\d{1,4}([./-])\d{1,2}\1\d{1,4}"
_NUMBER = r"[-−–(]?\d{1,3}(?:[.,'’ \u00a0\u202f]?\d{3})*"
_SIGN = r"(?:[A-Z]{3}|[^\W\d_]{0,2}[$€£¥₹]|kr|Kč|zł|Fr\.?)"

_WITHIN: tuple[tuple[str, re.Pattern[str]], ...] = (
    ("date", re.compile(rf"(?<!\d)(?<!\d[./-]){_DATE}(?![./-]?\d)")),
    (
        "named-date",
        re.compile(r"\d{1,2}\W{0,3}[^\W\d_]{3,9}\W{0,3}\d{2,4}|[^\W\d_]{3,9}\W{0,2}\d{1,2}\W{1,3}\d{4}"),
    ),
    ("time", re.compile(r"(?<!\d)\d{1,2}:\d{2}(?!\d)")),
    ("amount", re.compile(r"(?<![\d.,])\d{1,3}(?:[.,' ]?\d{3}){0,3}[.,]\d{2}(?![.,]?\d)")),
    ("percent", re.compile(r"\d\s?%")),
    ("currency", re.compile(r"[$€£¥₹₽]|(?<![^\W\d_])(?:[A-Z]{2,3})(?=\s?\d+[.,]\d{2})")),
    ("phone", re.compile(r"(?<![\w.])\+?\(?\d{2,4}\)?[ /-]\d{3}[\d -]{2,10}(?!\w)")),
    ("mail", re.compile(r"\S@\S")),
    ("web", re.compile(r"www\.|https?:")),
    ("postal-code", re.compile(r"(?<![\w.,/-])\d{4,6}(?![\w.,/-])")),
    ("long-number", re.compile(r"\d{7}")),
    ("identifier", re.compile(r"(?<!\w)(?=\w*\d)(?=\w*[A-Za-z])[\w/-]{5,}")),
)
"""Of values within a text, several of which it may have."""
_WHOLE: tuple[tuple[str, re.Pattern[str]], ...] = (
    ("integer", re.compile(rf"{_NUMBER}")),
    ("percent", re.compile(r"\d{1,3}(?:[.,]\d{1,2})?\s?%")),
    ("amount", re.compile(rf"(?:{_SIGN}\s?)?{_NUMBER}[.,]\d{{2}}\)?(?:\s?{_SIGN})?|{_NUMBER},[-–—]{{1,2}}")),
    ("amount", re.compile(rf"{_SIGN}\s?{_NUMBER}|{_NUMBER}\s?{_SIGN}")),
    ("decimal", re.compile(rf"{_NUMBER}[.,]\d{{1,4}}")),
    ("date", re.compile(_DATE)),
    ("code", re.compile(r"(?=\S*\d)\S{3,}")),
    ("short", re.compile(r"\S{1,4}")),
)
"""Of a whole text, as of a cell; the first one counts."""
KINDS = ("integer", "percent", "amount", "decimal", "date", "code", "short", "words")
"""What `kind_of` may return."""
NUMERIC = frozenset(("integer", "amount", "decimal", "percent"))
"""Kinds of texts that are a number."""


def kinds_within(text: str) -> list[str]:
    """The kinds of values that are somewhere in a text."""
    return [name for name, pattern in _WITHIN if pattern.search(text)]


def kind_of(text: str) -> str:
    """Which of `KINDS` a text is as a whole."""
    plain = " ".join(text.split())
    return next((name for name, pattern in _WHOLE if pattern.fullmatch(plain)), "words")

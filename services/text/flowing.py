"""Printed lines as the running text of a paragraph."""

import re
from collections.abc import Iterable

_HYPHEN = re.compile(r"(?<=[^\W\d_])[-\u00ad\u2010]$")
"""A hyphen at the end of a line, after a letter."""


def join_lines(lines: Iterable[str]) -> str:
    """The lines as one; a word that a hyphen divides at the end of a line is joined."""
    text = ""
    for line in lines:
        divided = line[:1].islower() and _HYPHEN.search(text) is not None
        text = text[:-1] + line if divided else f"{text} {line}".lstrip()
    return text

"""Plain text and Markdown of pages, in reading order."""

import re
from collections.abc import Sequence

from services.text.flowing import join_lines
from services.text.page_text import PageText, TextBlock

PAGE_BREAK = "\f"
"""Between pages of plain text, as of `pdftotext` and Tesseract."""
_PAGE_RULE = "\n\n---\n\n"
_SPECIAL = re.compile(r"([\\`*_\[\]<>])")
_AT_START = re.compile(r"^(\s*)(#{1,6}(?=\s)|[-+](?=\s)|>|\d+(?=[.)]\s)|={3,}\s*$|-{3,}\s*$|~{3,}|\|)")
_NUMBERED = re.compile(r"^\s*\d+$")


def write_plain_text(pages: Sequence[PageText]) -> bytes:
    """UTF-8: lines as printed, an empty line between blocks, a form feed between pages."""
    texts = [
        "\n\n".join("\n".join(line.text for line in block.lines) for block in page.blocks) for page in pages
    ]
    return (PAGE_BREAK.join(f"{text}\n" for text in texts)).encode("utf-8", "replace")


def write_markdown(pages: Sequence[PageText]) -> bytes:
    """UTF-8, CommonMark: a paragraph for every block, headings by their print, a rule between pages.

    Characters of the page that have a meaning in Markdown are escaped. Words that a hyphen divides at the end of a line
    are joined.
    """
    texts = ["\n\n".join(_markdown_block(block) for block in page.blocks) for page in pages]
    return (_PAGE_RULE.join(texts) + "\n").encode("utf-8", "replace")


def _markdown_block(block: TextBlock) -> str:
    text = join_lines(_SPECIAL.sub(r"\\\1", line.text) for line in block.lines)
    if block.kind == "heading":
        return f"{'#' * block.level} {text}"
    return _escape_start(text)


def _escape_start(text: str) -> str:
    """The paragraph with the first characters escaped where they would begin a list, a heading or a rule."""
    found = _AT_START.match(text)
    if found is None:
        return text
    space, mark = found.groups()
    rest = text[found.end() :]
    if _NUMBERED.match(mark):
        return f"{space}{mark}\\{rest}"
    return f"{space}\\{mark}{rest}"

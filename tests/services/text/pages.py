"""Pages of text for tests: words on a grid, two columns, scripts."""

from services.ocr.engine import Word
from services.text.arrangement import rows_of
from services.text.page_text import PageText, ReadLine, TextBlock


def word(
    text: str, left: float, top: float, width: float = 80.0, height: float = 30.0, line: int | None = None
) -> Word:
    """A word whose box begins at (left, top), in a `line` of the engine."""
    return Word(text, (left, top, left + width, top + height), 0.9, line)


def line(top: float, *texts: str, left: float = 100.0) -> ReadLine:
    """Words of 80 pixels every 100 pixels."""
    return ReadLine(tuple(word(text, left + 100 * index, top) for index, text in enumerate(texts)))


def rows_of_words(words: list[Word]) -> tuple[ReadLine, ...]:
    """Rows of words of which no lines are known."""
    return rows_of([[word] for word in words])


def page(*lines: ReadLine, heading: str = "") -> PageText:
    """A page of 850 x 1100 px with one paragraph, and a heading of the first level if it is given."""
    blocks = [TextBlock(lines)]
    if heading:
        blocks.insert(0, TextBlock((line(20, heading),), "heading", 1))
    return PageText(850, 1100, "eng", tuple(blocks))

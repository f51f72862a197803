"""Text of a page in responses."""

from pydantic import Field

from services.contract.answers.page import Answer, Point


class PageWord(Answer):
    """One word that was read."""

    text: str
    confidence: float = Field(ge=0, le=1)
    box: tuple[float, float, float, float] = Field(description="x0, y0, x1, y1 in pixels of the flat page.")
    photo: tuple[Point, Point, Point, Point] | None = Field(
        description="Corners of the word in the photo, clockwise from the top left of the flat page; null: the word is "
        "of no single photo."
    )
    line: int = Field(ge=0, description="Number of the text line, from 0, in reading order.")


class ReadText(Answer):
    """The text of the page, in reading order."""

    language: str = Field(description="Language that was read, as Tesseract names it.")
    confidence: float | None = Field(
        ge=0, le=1, description="Mean confidence of the words by their length; null: no word was read."
    )
    words: list[PageWord]

"""Quality of a photo in responses."""

from typing import Literal

from pydantic import Field

from services.contract.answers.page import Answer


class TextHeight(Answer):
    """Height of the letters in photo pixels."""

    min: float = Field(ge=0, description="Of the smallest or farthest print on the page.")
    median: float = Field(ge=0)


class Advice(Answer):
    """What to do better in the next photo."""

    code: str = Field(
        description="`show-all-text`, `come-closer`, `hold-still`, `focus-evenly`, `flatten-sheet`, `more-light`, "
        "`avoid-glare` or `avoid-shadow`."
    )
    detail: str = Field(description="A sentence for the person who takes the photo.")


class Quality(Answer):
    """How well the text of a photo can be read."""

    text_height_px: TextHeight
    blur_px: float = Field(ge=0, description="Standard deviation of the blur of edges.")
    contrast: float = Field(ge=0, le=1, description="Of print against the paper next to it.")
    cut_off_fraction: float = Field(
        ge=0, le=1, description="Share of the letters at the photo's border, or seen at more than 75 degrees."
    )
    glare_fraction: float = Field(ge=0, le=1, description="Share of the text's area that is glare.")
    shadow_fraction: float = Field(ge=0, le=1, description="Share of it that is shadow without detail.")
    line_tilt_deg: float = Field(
        ge=0,
        description="Mean angle of the text lines to the rows of the flat page: creased paper leaves some.",
    )
    predicted_character_error: float = Field(
        ge=0, le=1, description="Share of the characters that OCR will probably not read right."
    )
    predicted_from: Literal["photo", "reading"] = Field(
        description="What the error is predicted from: figures of the photo, or confidences of its words (text=true)."
    )
    advice: list[Advice] = Field(description="The most important first; empty for a photo that reads well.")

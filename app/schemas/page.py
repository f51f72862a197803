"""What the answers that describe a page share."""

from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

Point = tuple[float, float]


class Answer(BaseModel):
    """Part of an answer: nothing but what is documented, and no number that JSON cannot hold."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)


class Orientation(Answer):
    """How the flat view was turned so that it reads."""

    rotation_deg: Literal[0, 90, 180, 270] = Field(description="Clockwise, after the mirroring if any.")
    mirrored: bool
    confidence: float | None = Field(ge=0, le=1, description="null: nothing was read.")


class Warning(Answer):
    """Something that the caller should know of the result."""

    code: str
    detail: str

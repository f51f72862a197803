"""Parts of responses that describe a page."""

from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

Point = tuple[float, float]


class Answer(BaseModel):
    """Part of a response. It allows documented fields only, and no infinite numbers or NaN."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)


class Orientation(Answer):
    """Rotation and mirroring that turned the flat view upright."""

    rotation_deg: Literal[0, 90, 180, 270] = Field(description="Clockwise, after the mirroring if any.")
    mirrored: bool
    confidence: float | None = Field(ge=0, le=1, description="null: no text was read.")


class Warning(Answer):
    """Remark on the quality of the result."""

    code: str
    detail: str

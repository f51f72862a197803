"""Responses about cameras."""

import math
from datetime import datetime

from pydantic import Field

from services.contract.answers.page import Answer
from services.contract.cameras import FEWEST_PHOTOS, CameraMemory


class RememberedCamera(Answer):
    """The focal length of a camera, as its pages have shown it."""

    name: str
    field_of_view_deg: float = Field(gt=0, lt=180, description="Along the diagonal.")
    deviation: float = Field(ge=0, description="Standard deviation of the logarithm of the focal length.")
    photos: int = Field(ge=1, description="Number of photos that show it; of the newest 24.")
    decides: bool = Field(description="Whether there are enough photos, so that it is used.")
    used_at: datetime

    @classmethod
    def of(cls, memory: CameraMemory, used_at: datetime, *, is_used: bool) -> "RememberedCamera":
        """From what the store has."""
        return cls(
            name=memory.name,
            field_of_view_deg=round(math.degrees(2 * math.atan(math.exp(-memory.log_focal))), 3),
            deviation=round(memory.deviation, 4),
            photos=memory.photos,
            decides=is_used and memory.photos >= FEWEST_PHOTOS,
            used_at=used_at,
        )


class CameraList(Answer):
    """The cameras of one key."""

    cameras: list[RememberedCamera]

"""What the versions of a model, their comparison and rollback take and answer."""

from datetime import datetime
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from app.schemas.options import WHOLE
from app.schemas.page import Answer

MOST_VERSION = 2**31 - 1


class Version(Answer):
    """One of a model's versions; all are kept."""

    version: int = Field(ge=1)
    origin: Literal["initialize", "import", "feedback", "train", "rollback"] = Field(
        description="What made it."
    )
    note: str = Field(description="What its maker said about it.")
    created: datetime


class VersionList(Answer):
    """Versions of a model, newest first."""

    name: str
    versions: list[Version]


class RollbackBody(BaseModel):
    """The version to return to."""

    model_config = ConfigDict(extra="forbid", strict=True)

    version: Annotated[int, Field(ge=1, le=MOST_VERSION), WHOLE]


class RestoredModel(Answer):
    """The version that a rollback made; it holds what the restored one holds."""

    name: str
    version: int = Field(ge=1)
    restored: int = Field(ge=1, description="The earlier version.")
    labels: list[str]


class Change(Answer):
    """One number of a model that is another in the later version; null where there was or is none."""

    part: Literal["node", "edge", "model"]
    labels: list[str | None] = Field(
        description="Of the node, or of the upper and lower node of the edge; null is the node of zones without label."
    )
    attribute: str = Field(
        description="What changed: `left:value`, `left:variance`, `content:date`, `cost`, `count:2`, `zones` of a "
        "node; `top-top:above` of an edge; `weight:left`, `calibration:mean`, `samples` of the model."
    )
    old: float | None
    new: float | None


class Difference(Answer):
    """What changed between two versions, what moves costs most first."""

    name: str
    version: int
    against: int
    total: int = Field(ge=0, description="All changes.")
    changes: list[Change] = Field(description="The largest of them.")

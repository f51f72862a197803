"""Requests and responses of versions of a model, their difference, and rollback."""

from datetime import datetime
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from app.schemas.options import WHOLE
from models.records import MOST_INTEGER
from services.contract.answers.learning import Change
from services.contract.answers.page import Answer


class Version(Answer):
    """One version of a model; all versions are kept."""

    version: int = Field(ge=1)
    origin: Literal["initialize", "import", "feedback", "train", "rollback", "undo"] = Field(
        description="Operation that created it."
    )
    note: str = Field(description="Short description of its creation.")
    created: datetime


class VersionList(Answer):
    """Versions of a model, newest first."""

    name: str
    versions: list[Version]


class RollbackBody(BaseModel):
    """The version to return to."""

    model_config = ConfigDict(extra="forbid", strict=True)

    version: Annotated[int, Field(ge=1, le=MOST_INTEGER), WHOLE]
    drop_later_samples: bool = Field(
        default=False, description="Delete the samples that came after that version."
    )


class RestoredModel(Answer):
    """The version that a rollback created; its content equals that of the restored one."""

    name: str
    version: int = Field(ge=1)
    restored: int = Field(ge=1, description="The earlier version.")
    labels: list[str]
    samples: int = Field(ge=0, description="Number of samples that remain.")
    later_samples: list[str] = Field(
        description="Ids of the remaining samples that came after that version; `drop_later_samples` deletes them."
    )
    dropped_samples: int = Field(ge=0, description="Number of samples that were deleted.")


class Difference(Answer):
    """Differences between two versions, ordered by their effect on costs, largest first."""

    name: str
    version: int
    against: int
    total: int = Field(ge=0, description="Number of all changes.")
    changes: list[Change] = Field(description="The largest changes.")

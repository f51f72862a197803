"""What /layout/models and /layout/models/{name} take and answer."""

import re
from datetime import datetime
from typing import Annotated

from fastapi import Path
from pydantic import AfterValidator, Field

from app.schemas.layout import MODEL_NAME_PATTERN
from app.schemas.page import Answer


def checked_name(name: str) -> str:
    """The name of a model, as it is; ValueError when it is none."""
    if not re.fullmatch(MODEL_NAME_PATTERN, name):
        raise ValueError("expected 1-60 letters, digits, dots, underscores and hyphens, no dot first")
    return name


ModelName = Annotated[
    str,
    AfterValidator(checked_name),
    Path(
        json_schema_extra={"pattern": MODEL_NAME_PATTERN},
        description="Of the model, that is of the document class: 1-60 letters, digits, dots, underscores and "
        "hyphens, no dot first.",
    ),
]


NameInBody = Annotated[
    str, AfterValidator(checked_name), Field(json_schema_extra={"pattern": MODEL_NAME_PATTERN})
]


class Health(Answer):
    """What feedback tells of a class: how much recognition errs, lately and before that.

    Errors are shares, 0-1, null where there is nothing to look at: of zones whose label was wrong, of pages whose
    class was. When `recent_zone_error` has grown over `earlier_zone_error` the class may have changed.
    """

    feedbacks: int = Field(ge=0, description="All that found or verified this class.")
    recent: int = Field(ge=0, description="The last of them, which the recent errors are of.")
    recent_zone_error: float | None = Field(ge=0, le=1)
    recent_class_error: float | None = Field(ge=0, le=1)
    earlier_zone_error: float | None = Field(ge=0, le=1, description="Of as many feedbacks before those.")
    last_feedback: datetime | None


class ModelSummary(Answer):
    """A layout model, or a class that has samples and no model yet."""

    name: str
    version: int | None = Field(ge=1, description="Its newest; null: POST .../initialize makes the first.")
    samples: int = Field(ge=0)
    labels: list[str] = Field(description="Of the newest version.")
    health: Health
    created: datetime
    updated: datetime


class ModelList(Answer):
    """All layout models, by name."""

    models: list[ModelSummary]


class InitializedModel(Answer):
    """The version that was made of a model's samples."""

    name: str
    version: int = Field(ge=1)
    samples: int = Field(ge=1, description="So many pages it was made of.")
    labels: dict[str, int] = Field(description="Its labels, and how many zones of the samples have each.")


class ImportedModel(Answer):
    """The version that an import became."""

    name: str
    version: int = Field(ge=1)
    labels: list[str]

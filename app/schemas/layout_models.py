"""Requests and responses of /layout/models and /layout/models/{name}."""

import re
from datetime import datetime
from typing import Annotated

from fastapi import Path
from pydantic import AfterValidator, Field

from app.schemas.layout import MODEL_NAME_PATTERN
from services.contract.answers.page import Answer, Warning


def checked_name(name: str) -> str:
    """The unchanged `name`; ValueError if it is not a valid model name."""
    if not re.fullmatch(MODEL_NAME_PATTERN, name):
        raise ValueError("expected 1-60 letters, digits, dots, underscores and hyphens, no dot first")
    return name


ModelName = Annotated[
    str,
    AfterValidator(checked_name),
    Path(
        json_schema_extra={"pattern": MODEL_NAME_PATTERN},
        description="Name of the model, which is the name of the document class: 1-60 letters, digits, dots, "
        "underscores and hyphens, no dot first.",
    ),
]


NameInBody = Annotated[
    str, AfterValidator(checked_name), Field(json_schema_extra={"pattern": MODEL_NAME_PATTERN})
]


class Health(Answer):
    """Error rates of recognition for a class, computed from feedback: recent ones and earlier ones.

    Zone errors are the share (0-1) of zones with a wrong label, without cells of tables; class errors are the share of
    pages with a wrong class; null without feedback. If `recent_zone_error` is larger than `earlier_zone_error`, the
    class may have changed.
    """

    feedbacks: int = Field(ge=0, description="Number of feedbacks that found or verified this class.")
    recent: int = Field(ge=0, description="Number of feedbacks in the recent error rates.")
    recent_zone_error: float | None = Field(ge=0, le=1)
    recent_class_error: float | None = Field(ge=0, le=1)
    recent_text_error: float | None = Field(
        default=None, ge=0, le=1, description="Share of wrong letters in the texts that feedback gave."
    )
    earlier_zone_error: float | None = Field(
        ge=0, le=1, description="From as many feedbacks before the recent ones."
    )
    last_feedback: datetime | None


class ModelSummary(Answer):
    """A layout model, or a class that has samples and no model yet."""

    name: str
    version: int | None = Field(
        ge=1, description="The newest version; null: POST .../initialize makes the first."
    )
    samples: int = Field(ge=0)
    labels: list[str] = Field(description="Labels of the newest version.")
    health: Health
    created: datetime
    updated: datetime


class ModelList(Answer):
    """All layout models, by name."""

    models: list[ModelSummary]


class InitializedModel(Answer):
    """The version that was made from a model's samples."""

    name: str
    version: int = Field(ge=1)
    samples: int = Field(ge=1, description="Number of pages that it was made from.")
    labels: dict[str, int] = Field(
        description="Its labels, and the number of zones of the samples with each."
    )
    warnings: list[Warning] = Field(
        default=[],
        description="Of the table of the class: `column-without-cells`, `column-outside-rows`, `two-cells-in-line`, "
        "`several-cells-in-box`.",
    )


class ImportedModel(Answer):
    """The version that an import created."""

    name: str
    version: int = Field(ge=1)
    labels: list[str]

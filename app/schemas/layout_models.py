"""What /layout/models and the paths below it take and answer."""

import re
from datetime import datetime
from typing import Annotated, Literal

from fastapi import Path
from pydantic import AfterValidator, BaseModel, Field

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


class SampleReceipt(Answer):
    """A sample that was stored."""

    id: str
    model: str
    zones: int = Field(ge=1)
    labels: dict[str, int] = Field(description="How many zones have each label.")


class SampleSummary(Answer):
    """A stored sample, without its zones."""

    id: str
    zones: int
    labels: dict[str, int]
    created: datetime


class SampleList(Answer):
    """Samples of a model, oldest first."""

    model: str
    samples: list[SampleSummary]


class PageZone(BaseModel):
    """One region of a labelled page; what is left out or null was not measured."""

    id: str | int
    box: tuple[float, float, float, float] = Field(
        description="x0, y0, x1, y1 in pixels of the page, x0 < x1, y0 < y1."
    )
    label: str | None = Field(default=None, description="null: none of the model's.")
    kind: Literal["text", "figure", "rule", "noise"] | None = None
    lines: int | None = Field(default=None, ge=0)
    font_size: float | None = Field(default=None, ge=0, description="Em, pixels.")
    line_spacing: float | None = Field(default=None, ge=0, description="Pixels from baseline to baseline.")
    weight: float | None = Field(default=None, ge=0, description="Stroke width as a share of the font size.")
    alignment: Literal["left", "right", "centre", "justified"] | None = None
    text: str | None = None
    content: dict[str, float] | None = Field(
        default=None, description="Content features, each a confidence of 0-1."
    )


class PageBody(BaseModel):
    """A labelled page: what /layout answers, with the labels that are right; at least one zone has a label.

    Other keys are passed over.
    """

    width: float = Field(gt=0, description="Pixels.")
    height: float = Field(gt=0, description="Pixels.")
    zones: list[PageZone] = Field(min_length=1)


class Sample(Answer):
    """A stored sample, with all that was measured; its page may be sent to POST .../samples again as it is."""

    id: str
    model: str
    created: datetime
    width: float
    height: float
    zones: list[PageZone]
    found: PageBody | None = Field(
        default=None,
        description="The same page in the zones that were found in its image, with the labels of the verified zones "
        "that cover them: the model learns from both. null: there was no image, or they are the same.",
    )

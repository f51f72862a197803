"""What /layout/results/{id}/feedback and /layout/models/{name}/feedback take and answer."""

from datetime import datetime
from typing import Annotated, Self

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

from app.schemas.layout_models import NameInBody
from app.schemas.page import Answer
from services.contract.layout import LONGEST_LABEL

Label = Annotated[str, Field(min_length=1, max_length=LONGEST_LABEL), AfterValidator(str.strip)]


class FeedbackBody(BaseModel):
    """What a person says of a result."""

    model_config = ConfigDict(
        extra="forbid",
        strict=True,
        json_schema_extra={"anyOf": [{"required": ["class"]}, {"required": ["labels"]}]},
    )

    class_: NameInBody | None = Field(
        default=None,
        alias="class",
        description="The document's class; null: none of those that there are. Left out: the one that was found is "
        "right.",
    )
    labels: dict[str, Label | None] = Field(
        default={},
        description="Labels of zones by their ids, in printable characters; null: none of the model's. Zones that are "
        "left out keep the label that was found; when the class was wrong they take the one that the right class's "
        "model finds.",
    )

    @model_validator(mode="after")
    def _says_something(self) -> Self:
        if not self.model_fields_set:
            raise ValueError("send class, labels, or both")
        return self


class FoundAndVerified(Answer):
    """The class that was found, and the one that it is; null: none."""

    found: str | None
    verified: str | None


class WrongLabel(Answer):
    """A zone whose label was wrong."""

    zone: str
    found: str | None
    verified: str | None


class CostChange(Answer):
    """The cost of one labelling of the page under a model, before it adapted and after; null where there is none."""

    before: float | None
    after: float | None


class AdaptedModel(Answer):
    """A model that learned of the feedback.

    It has come nearer to what was verified when `cost_verified` less `cost_found` is smaller after than before.
    """

    name: str
    old_version: int | None = Field(description="null: the page and the samples made the first.")
    new_version: int
    cost_found: CostChange | None = Field(
        description="Of the labels that were found; null for a first version."
    )
    cost_verified: CostChange | None = Field(description="Of the labels that are right.")


class Feedback(Answer):
    """What became of a feedback."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, serialize_by_alias=True)

    id: str
    result: str = Field(description="Id of the result that it is about.")
    created: bool = Field(
        description="false: it had come before; nothing changed, and this is its answer again."
    )
    class_: FoundAndVerified = Field(alias="class")
    zones: int = Field(ge=0, description="Of the page.")
    wrong: list[WrongLabel] = Field(description="Zones whose label was wrong.")
    models: list[AdaptedModel] = Field(description="The models that changed, by name.")
    sample: str | None = Field(
        description="Id of the sample of the verified class that the page has become; null: none, or no longer."
    )


class FeedbackVersions(Answer):
    """The version that a feedback made of a model."""

    name: str
    old_version: int | None
    new_version: int


class FeedbackEntry(Answer):
    """One feedback in the history of a model."""

    model_config = ConfigDict(extra="forbid", serialize_by_alias=True)

    id: str
    result: str
    class_: FoundAndVerified = Field(alias="class")
    zones: int
    wrong: int = Field(description="How many zones had a wrong label.")
    models: list[FeedbackVersions]
    sample: str | None
    created: datetime


class FeedbackList(Answer):
    """The last feedbacks that found or verified a class, newest first."""

    model: str
    feedback: list[FeedbackEntry]

"""Requests and responses of /layout/results/{id}/feedback and /layout/models/{name}/feedback."""

from datetime import datetime
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, FiniteFloat, model_validator

from app.schemas.layout_models import NameInBody
from app.schemas.layout_settings import LabelName
from services.contract.answers.learning import CostChange, FoundAndVerified, GivenText, WrongLabel
from services.contract.answers.page import Answer, Warning

LONGEST_GIVEN_TEXT = 20_000
"""Characters of one zone; a page of small print has 8000."""

Label = Annotated[LabelName, AfterValidator(str.strip)]


class FeedbackZone(BaseModel):
    """A zone that a person drew."""

    model_config = ConfigDict(extra="forbid")

    id: str | None = Field(
        default=None,
        min_length=1,
        description="Absent: that of the zone of the result at its place, or a new one. An id of the result may be "
        "used again.",
    )
    box: tuple[FiniteFloat, FiniteFloat, FiniteFloat, FiniteFloat] = Field(
        description="x0, y0, x1, y1 in pixels of the page, x0 < x1, y0 < y1."
    )
    label: Label | None = Field(description="null: no label of the model.")
    text: str | None = Field(default=None, description="Absent: the text of the zones found there.")
    kind: Literal["text", "figure", "rule", "noise"] | None = None


class FeedbackBody(BaseModel):
    """A person's corrections of a result."""

    model_config = ConfigDict(
        extra="forbid",
        strict=True,
        json_schema_extra={"anyOf": [{"required": [name]} for name in ("class", "labels", "texts", "zones")]},
    )

    class_: NameInBody | None = Field(
        default=None,
        alias="class",
        description="The document's class; null: none of the existing classes. Absent: the class that the result shows "
        "is correct.",
    )
    new_class: bool = Field(
        default=False,
        description="true: a class of this name is made if there is none, with this page as its first sample.",
    )
    labels: dict[str, Label | None] = Field(
        default={},
        description="Labels of zones by their ids, in printable characters; null: no label of the model. Absent zones "
        "keep the label that the result shows; if the class was wrong, they take the label that the correct class's "
        "model finds.",
    )

    texts: dict[str, Annotated[str, Field(min_length=1, max_length=LONGEST_GIVEN_TEXT)]] = Field(
        default={},
        description="Texts of zones by their ids, where OCR read them wrong. A text that was read right may be sent "
        "too; it counts as right in the model's health. The result shows the texts, and its values follow.",
    )
    zones: Annotated[list[FeedbackZone], Field(min_length=1)] | None = Field(
        default=None,
        description="All zones of the page in reading order, with their labels: they replace those of the result "
        "(corrected, divided, merged or added boxes). Zones at the same place keep what was measured.",
    )

    @model_validator(mode="after")
    def _says_something(self) -> Self:
        if not self.model_fields_set - {"new_class"}:
            raise ValueError("send class, labels, texts or zones")
        if self.new_class and self.class_ is None:
            raise ValueError("send the name of the new class as `class`")
        if self.zones is not None and self.labels:
            raise ValueError("send labels either in `zones` or in `labels`, not in both")
        if self.zones is not None and self.texts:
            raise ValueError("send texts either in `zones` or in `texts`, not in both")
        return self


class AdaptedModel(Answer):
    """A model that learned from the feedback.

    It fits the verified labels better if `cost_verified` minus `cost_found` is smaller after than before.
    """

    name: str
    old_version: int | None = Field(
        description="null: this is the first version, from the page and the samples."
    )
    new_version: int
    cost_found: CostChange | None = Field(description="Cost of the found labels; null for a first version.")
    cost_verified: CostChange | None = Field(description="Cost of the verified labels.")


class UndoneModel(Answer):
    """A model from which a feedback was taken back; null as the new version: it has none without that feedback."""

    name: str
    old_version: int | None
    new_version: int | None


class UndoneFeedback(Answer):
    """Effect of taking the feedback on a result back."""

    result: str
    feedback: list[str] = Field(description="Ids of the feedback that was deleted, oldest first.")
    models: list[UndoneModel] = Field(
        description="The models that changed, by name. A model that was rolled back, imported or initialized without "
        "this feedback since is not among them."
    )
    samples: int = Field(ge=0, description="Number of samples that were deleted.")


class Feedback(Answer):
    """Effect of a feedback."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, serialize_by_alias=True)

    id: str
    result: str = Field(description="Id of the result that the feedback corrects.")
    created: bool = Field(
        description="false: the feedback was sent before; nothing changed, and this is the earlier response."
    )
    class_: FoundAndVerified = Field(alias="class")
    zones: int = Field(ge=0, description="Number of zones of the page.")
    wrong: list[WrongLabel] = Field(description="Zones whose label was wrong.")
    texts: list[GivenText] = Field(
        default=[], description="The texts that were sent, in `texts` or in `zones`."
    )
    models: list[AdaptedModel] = Field(description="The models that changed, by name.")
    taken_back: list[UndoneModel] = Field(
        description="Models from which this feedback took back what earlier feedback on the result had taught; the "
        "models in `models` learned after that."
    )
    sample: str | None = Field(
        description="Id of the sample of the verified class made from the page; null: none, or deleted since."
    )
    warnings: list[Warning] = Field(
        description="`new-label`: a label that the class did not have. `earlier-lesson-kept`: earlier feedback on the "
        "result could not be taken back. `nothing-learned`: the page has no zones. `two-cells-in-line`: of one column "
        "of a table. `rolled-back`, `replaced`: a repeated feedback is not in effect any more."
    )


class FeedbackVersions(Answer):
    """The version of a model that a feedback created."""

    name: str
    old_version: int | None
    new_version: int
    without_effect: Literal["rolled-back", "replaced"] | None = Field(
        description="Why the model does not contain this feedback any more: `replaced` by later feedback on the "
        "result; `rolled-back`: the model has left the version (rollback, import or initialization). null: it "
        "contains it, or the class was deleted."
    )


class FeedbackEntry(Answer):
    """One feedback in the history of a model."""

    model_config = ConfigDict(extra="forbid", serialize_by_alias=True)

    id: str
    result: str
    class_: FoundAndVerified = Field(alias="class")
    zones: int
    wrong: int = Field(description="Number of zones with a wrong label.")
    models: list[FeedbackVersions]
    sample: str | None
    created: datetime


class FeedbackList(Answer):
    """The latest feedbacks that found or verified a class, newest first."""

    model: str
    feedback: list[FeedbackEntry]

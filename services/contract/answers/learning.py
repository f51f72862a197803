"""Parts of responses of learning: feedback, rounds of training, differences of models."""

from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

from services.contract.answers.page import Answer, Warning

Verdict = tuple[str | None, float, bool]
"""Found label of a zone, its confidence, and whether a person found it right."""


class FoundAndVerified(Answer):
    """The found class and the verified class; null: none."""

    found: str | None
    verified: str | None


class WrongLabel(Answer):
    """A zone whose label was wrong."""

    zone: str
    found: str | None
    verified: str | None


class CostChange(Answer):
    """Cost of one labelling of the page under a model, before and after it adapted; null: no such version."""

    before: float | None
    after: float | None


class LabellingCosts(Answer):
    """Costs of the found and of the verified labelling of a page under one model."""

    model: str
    found: CostChange
    verified: CostChange


class GivenText(Answer):
    """A text that the person gave, and the one that was read there."""

    zone: str
    found: str
    verified: str
    edits: int = Field(ge=0, description="Letters to insert, delete or replace.")


class FeedbackReport(BaseModel):
    """What a feedback has changed, as it is stored beside it; other fields of later releases are left out."""

    model_config = ConfigDict(extra="ignore", serialize_by_alias=True, validate_by_name=True)

    class_: FoundAndVerified = Field(alias="class")
    zones: int
    wrong: list[WrongLabel]
    costs: list[LabellingCosts]
    texts: list[GivenText] = []
    verdicts: list[Verdict] = []
    warnings: list[Warning] = []


class Round(Answer):
    """Errors after one round, as shares of zones; round 0 is initialization from the samples."""

    round: int = Field(ge=0)
    error: float = Field(ge=0, le=1, description="On the training samples.")
    held_out_error: float | None = Field(
        ge=0, le=1, description="On held-out samples; null: too few samples to hold one out."
    )


class Change(Answer):
    """One number of a model that changed; null where it did not exist."""

    part: Literal["node", "edge", "model"]
    labels: list[str | None] = Field(
        description="Label of the node, or of the upper and lower node of the edge; null: the node of unlabelled zones."
    )
    attribute: str = Field(
        description="The number: `left:value`, `left:variance`, `content:date`, `cost`, `count:2`, `zones` of a "
        "node; `top-top:above` of an edge; `weight:left`, `calibration:mean`, `samples` of the model."
    )
    old: float | None
    new: float | None

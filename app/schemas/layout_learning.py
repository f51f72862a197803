"""What training, rollback, comparison and settings of /layout/models take and answer."""

from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

from app.schemas.layout_models import Health, NameInBody
from app.schemas.page import Answer
from models.layout_graph import Learner

MOST_ROUNDS = 100
"""Of one training; the dissertation's curves (5.6) end there."""
MOST_VERSION = 2**31 - 1


def _whole(value: Any) -> Any:
    """JSON does not tell 3.0 from 3."""
    return int(value) if isinstance(value, float) and value.is_integer() else value


class TrainBody(BaseModel):
    """How a model is trained."""

    model_config = ConfigDict(extra="forbid", strict=True)

    rounds: Annotated[int, Field(ge=1, le=MOST_ROUNDS), BeforeValidator(_whole)] = Field(
        default=3, description="At most so many times all samples are shown; three are those of Figure 5.7."
    )


class Round(Answer):
    """Errors after one round, as shares of zones; round 0 is initialization from the samples."""

    round: int = Field(ge=0)
    error: float = Field(ge=0, le=1, description="On the samples that it learns from.")
    held_out_error: float | None = Field(
        ge=0, le=1, description="On samples that it does not learn from; null: too few to hold one out."
    )


class TrainedModel(Answer):
    """What training made of a model."""

    name: str
    version: int = Field(ge=1, description="The newest: the one that training made, or the one that it left.")
    changed: bool = Field(description="false: no round was better, and there is no new version.")
    samples: int = Field(ge=1, description="So many pages it was shown.")
    learner: Learner
    rounds: list[Round]
    kept_round: int = Field(ge=0, description="The round whose model is kept.")
    stopped: Literal["rounds", "held-out", "no-errors", "effort"] = Field(
        description="All rounds were done; the error on held-out samples rose; nothing was wrong any more; or the work "
        "of one training was spent."
    )


class RollbackBody(BaseModel):
    """The version to return to."""

    model_config = ConfigDict(extra="forbid", strict=True)

    version: Annotated[int, Field(ge=1, le=MOST_VERSION), BeforeValidator(_whole)]


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


class Settings(Answer):
    """What is set for a model beside its versions."""

    learner: Learner = Field(description="How it learns from feedback and in training.")
    genre: str | None = Field(description="The genre of the class; null: found by likeness.")
    continues: str | None = Field(
        description="The model whose later pages this one describes; null: it describes first pages."
    )


class SettingsBody(BaseModel):
    """The settings to change; those that are left out stay."""

    model_config = ConfigDict(extra="forbid", strict=True)

    learner: Learner | None = Field(default=None, description="null: the service's default.")
    genre: NameInBody | None = None
    continues: NameInBody | None = None


class ModelHealthReport(Health):
    """The same of one model, with its name."""

    name: str

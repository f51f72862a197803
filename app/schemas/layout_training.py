"""What POST /layout/models/{name}/train takes and answers."""

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from app.schemas.options import WHOLE
from app.schemas.page import Answer
from services.contract.layout_learning import Learner

MOST_ROUNDS = 100
"""Of one training; the dissertation's curves (5.6) end there."""


class TrainBody(BaseModel):
    """How a model is trained."""

    model_config = ConfigDict(extra="forbid", strict=True)

    rounds: Annotated[int, Field(ge=1, le=MOST_ROUNDS), WHOLE] = Field(
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

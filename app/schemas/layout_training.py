"""Request and response of POST /layout/models/{name}/train."""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from app.schemas.options import WHOLE
from services.contract.answers.learning import Round
from services.contract.answers.page import Answer
from services.contract.layout_learning import Learner, Stop

MOST_ROUNDS = 100
"""Largest number of rounds of one training, as in the dissertation's curves (5.6)."""


class TrainBody(BaseModel):
    """Parameters of a training."""

    model_config = ConfigDict(extra="forbid", strict=True)

    rounds: Annotated[int, Field(ge=1, le=MOST_ROUNDS), WHOLE] = Field(
        default=3, description="Largest number of passes over all samples; three as in Figure 5.7."
    )


class TrainedModel(Answer):
    """Result of a training."""

    name: str
    version: int = Field(ge=1, description="The newest version, which may be the one before the training.")
    changed: bool = Field(description="false: no round was better, and there is no new version.")
    samples: int = Field(ge=1, description="Number of pages in the training.")
    learner: Learner
    rounds: list[Round]
    kept_round: int = Field(ge=0, description="The round whose model is kept.")
    stopped: Stop = Field(
        description="Reason for the end: all rounds were done; the held-out error rose; no error was left; a round "
        "changed nothing although errors are left (the learner counting changes nothing in rounds); or the work "
        "limit of one training was reached."
    )

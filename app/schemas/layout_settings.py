"""Requests and responses of /layout/models/{name}/settings and /layout/models/{name}/health."""

from pydantic import BaseModel, ConfigDict, Field

from app.schemas.layout_models import Health, NameInBody
from app.schemas.page import Answer
from services.contract.layout_learning import Learner


class Settings(Answer):
    """Settings of a model. They do not belong to a version."""

    learner: Learner = Field(description="Learning method for feedback and training.")
    genre: str | None = Field(description="The genre of the class; null: chosen by similarity.")
    continues: str | None = Field(
        description="The class whose later pages this model describes; null: it describes first pages."
    )


class SettingsBody(BaseModel):
    """The settings to change; absent ones keep their values."""

    model_config = ConfigDict(extra="forbid", strict=True)

    learner: Learner | None = Field(default=None, description="null: the service's default.")
    genre: NameInBody | None = None
    continues: NameInBody | None = None


class ModelHealthReport(Health):
    """Error rates of one model, with its name."""

    name: str

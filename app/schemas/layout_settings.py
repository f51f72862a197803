"""What /layout/models/{name}/settings and /layout/models/{name}/health take and answer."""

from pydantic import BaseModel, ConfigDict, Field

from app.schemas.layout_models import Health, NameInBody
from app.schemas.page import Answer
from services.contract.layout_learning import Learner


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

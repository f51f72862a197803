"""Response of /layout/proposals; the worker leaves `next` empty, since only the app knows requests."""

from pydantic import Field

from services.contract.answers.page import Answer


class NewClass(Answer):
    """A group of similar unknown pages."""

    pages: list[str] = Field(min_length=1, description="Ids of the unknown pages, newest first.")
    typical: str = Field(description="Id of the page that is most similar to the others: label it first.")
    cohesion: float = Field(ge=0, le=1, description="1: all pages are equal, 0: they have nothing in common.")
    recurring_zones: list[dict[str, str]] = Field(
        description="Zones that most of the pages have. Each entry maps page ids to the id of this zone on that page. "
        "A label for the zone of the typical page applies to all of them."
    )
    next: list[str] = Field(description="Requests, in their order, that make a class of these pages.")


class Merge(Answer):
    """Two models that recognition cannot distinguish."""

    models: list[str] = Field(min_length=2, max_length=2)
    fit: float = Field(
        description="How well each model explains the other's samples compared with the other model; the smaller of "
        "both values; 1: equally well."
    )
    unsure: float = Field(
        ge=0,
        le=1,
        description="Share of the samples of both whose class is decided wrongly or with low confidence.",
    )
    agreement: float = Field(ge=0, le=1, description="Share of zones on whose labels both models agree.")
    labels: dict[str, str | None] = Field(
        description="Maps labels of the first model to different labels of the second; null: no label."
    )
    next: list[str] = Field(description="Requests, in their order, that merge both models.")


class ModelPart(Answer):
    """Similar samples of a model."""

    samples: list[str] = Field(min_length=1, description="Ids of the compared samples.")
    typical: str = Field(description="Id of the sample that is most similar to the others.")


class Split(Answer):
    """A model whose samples form two groups."""

    model: str
    parts: list[ModelPart] = Field(min_length=2, max_length=2, description="The larger one first.")
    gain: float = Field(
        description="Relative reduction of the costs of held-out samples by separate models of the parts."
    )
    better: float = Field(ge=0, le=1, description="Share of the held-out samples with a lower cost.")
    next: list[str] = Field(description="Requests, in their order, that split the model.")


class LookedAt(Answer):
    """Numbers of compared pages, models and samples; some are left out if there are very many."""

    unknown_pages: int = Field(ge=0)
    models: int = Field(ge=0)
    samples: int = Field(ge=0)


class Proposals(Answer):
    """Proposed changes of the set of models; nothing was changed."""

    new_classes: list[NewClass] = Field(description="The largest first.")
    merges: list[Merge] = Field(description="The most similar first.")
    splits: list[Split]
    looked_at: LookedAt

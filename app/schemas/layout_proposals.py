"""What /layout/unknown-pages and /layout/proposals answer."""

from datetime import datetime

from pydantic import Field

from app.schemas.layout_samples import PageZone
from app.schemas.page import Answer


class UnknownPageSummary(Answer):
    """A page that fitted no class, without its zones."""

    id: str
    result: str = Field(description="Id of the result in which it fitted no class; that may be gone.")
    zones: int = Field(ge=0)
    created: datetime


class UnknownPageList(Answer):
    """Pages that fitted no class, newest first."""

    pages: list[UnknownPageSummary]


class UnknownPage(Answer):
    """A page that fitted no class, with all that was measured.

    With the labels that are right it may be sent to POST /layout/models/{name}/samples as it is.
    """

    id: str
    result: str
    created: datetime
    width: float
    height: float
    zones: list[PageZone]


class NewClass(Answer):
    """Unknown pages that are alike."""

    pages: list[str] = Field(min_length=1, description="Ids of the unknown pages, newest first.")
    typical: str = Field(description="Id of the page that is most like the others: the one to label first.")
    cohesion: float = Field(
        ge=0, le=1, description="1: all pages are the same, 0: they have nothing in common."
    )
    recurring_zones: list[dict[str, str]] = Field(
        description="Zones that most of the pages have: for each, its id on every page that has it, by the page's id. "
        "Who labels the typical page has labelled these on all."
    )
    next: list[str] = Field(description="What to do if these pages are a class: requests, in their order.")


class Merge(Answer):
    """Two models that recognition cannot tell apart."""

    models: list[str] = Field(min_length=2, max_length=2)
    fit: float = Field(
        description="How well each one explains the other's samples beside its own, the lesser of both; 1: as well."
    )
    unsure: float = Field(
        ge=0, le=1, description="Share of both's samples whose class is decided wrongly or not clearly."
    )
    agreement: float = Field(ge=0, le=1, description="Share of zones on whose labels both models agree.")
    labels: dict[str, str | None] = Field(
        description="Labels of the second model by the first one's, where they are not the same; null: no label."
    )
    next: list[str] = Field(description="What to do if they are one class: requests, in their order.")


class ModelPart(Answer):
    """Samples of a model that are of one kind."""

    samples: list[str] = Field(min_length=1, description="Ids, of those that were looked at.")
    typical: str = Field(description="Id of the sample that is most like the others.")


class Split(Answer):
    """A model whose samples are of two kinds."""

    model: str
    parts: list[ModelPart] = Field(min_length=2, max_length=2, description="The larger one first.")
    gain: float = Field(
        description="By how much of their costs models of the parts explain samples better that they did not have."
    )
    better: float = Field(ge=0, le=1, description="Share of the samples that they explain better.")
    next: list[str] = Field(description="What to do if these are two classes: requests, in their order.")


class LookedAt(Answer):
    """What the proposals are made of; very many pages or samples are not all looked at."""

    unknown_pages: int = Field(ge=0)
    models: int = Field(ge=0)
    samples: int = Field(ge=0)


class Proposals(Answer):
    """What a person may want to change about the set of models; nothing was changed."""

    new_classes: list[NewClass] = Field(description="The largest first.")
    merges: list[Merge] = Field(description="The most alike first.")
    splits: list[Split]
    looked_at: LookedAt

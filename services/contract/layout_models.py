"""Layout models: made of labelled pages, compared, proposed."""

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, slots=True)
class ModelDraft:
    """A layout model that has no version number yet, and its labels."""

    document: dict[str, object]
    labels: list[str]


@dataclass(frozen=True, slots=True)
class ModelDifference:
    """What changed from one version of a model to another: `total` changes, of which `changes` are the largest.

    Each is `{"part", "labels", "attribute", "old", "new"}`; see `services.operations.layout_diff`.
    """

    total: int
    changes: list[dict[str, Any]]


@dataclass(frozen=True, slots=True)
class StoredPage:
    """A page as the store has it, an unknown page or a sample: its id, and its document."""

    id: str
    document: dict[str, Any]

"""Labelled pages in, layout models out; what changed from one version to another."""

from dataclasses import dataclass
from typing import Any

from app.operations.layout import LayoutSettings, ModelDocument, layout_settings, stored_models


@dataclass(frozen=True, slots=True)
class ModelDraft:
    """A layout model that is no version yet, and its labels."""

    document: dict[str, object]
    labels: list[str]


@dataclass(frozen=True, slots=True)
class ModelDifference:
    """What changed from one version of a model to another: `total` entries, of which `changes` are the largest.

    Each is `{"part", "labels", "attribute", "old", "new"}`; `services.operations.layout_diff` tells what they mean.
    """

    total: int
    changes: list[dict[str, Any]]


def measure_sample(image: bytes | None, zones: bytes, settings: LayoutSettings) -> dict[str, object]:
    """A labelled page, made complete by its image; raises the `DocumentError`s of `services.operations`."""
    from services.operations import layout_models

    return layout_models.measure_sample(image, zones, layout_settings(settings))


def initialize_model(name: str, samples: list[dict[str, Any]], settings: LayoutSettings) -> ModelDraft:
    """The layout model of `samples`; raises the `DocumentError`s of `services.operations`."""
    from services.operations import layout_models

    draft = layout_models.initialize_from_samples(name, samples, layout_settings(settings))
    return ModelDraft(draft.document, draft.labels)


def import_model(name: str, document: bytes) -> ModelDraft:
    """The layout model in `document`, as it will be kept; raises the `DocumentError`s of `services.operations`."""
    from services.operations import layout_models

    draft = layout_models.import_model(name, document)
    return ModelDraft(draft.document, draft.labels)


def compare_models(old: ModelDocument, new: ModelDocument, most: int) -> ModelDifference:
    """The `most` largest changes from `old` to `new`, versions of one model, and how many there are.

    Raises the `DocumentError`s of `services.operations`.
    """
    from services.operations import layout_diff

    before, after = stored_models([old, new])
    difference = layout_diff.compare_models(before, after, most)
    return ModelDifference(difference.total, difference.changes)

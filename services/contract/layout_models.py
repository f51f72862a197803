"""Input and output of operations on layout models: initialization, comparison, proposals."""

from dataclasses import dataclass
from typing import Any

MOST_COMPARED_SAMPLES = 24
"""Largest number of samples of a class that proposals read, the newest ones; more do not change the mean costs and
distances."""

SEGMENTATION = "2026-11-26"
"""Name of the present segmentation. Whoever changes which zones it finds gives it a new name (a date, `.2` for the
second of a day), so that samples and versions say by which one they were measured: `python -m app remeasure`."""


@dataclass(frozen=True, slots=True)
class MeasuredSample:
    """A labelled page in its stored form, and the `warnings` of the HTTP contract about its file of zones."""

    document: dict[str, object]
    warnings: list[dict[str, str]]


@dataclass(frozen=True, slots=True)
class ModelDraft:
    """A layout model without a version number, and its labels."""

    document: dict[str, object]
    labels: list[str]


@dataclass(frozen=True, slots=True)
class ModelDifference:
    """Differences between two versions of a model: their number `total`, and the largest ones as `changes`.

    Each change is `{"part", "labels", "attribute", "old", "new"}`; see `services.operations.layout_diff`.
    """

    total: int
    changes: list[dict[str, Any]]


@dataclass(frozen=True, slots=True)
class PageDocument:
    """A stored page (an unknown page or a sample): its id and its document."""

    id: str
    document: dict[str, Any]

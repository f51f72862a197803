"""Input and output of operations on layout models: initialization, comparison, proposals."""

from dataclasses import dataclass, field

from services.contract.answers.learning import Change
from services.contract.answers.page import Warning
from services.contract.model_json import ModelJson
from services.contract.page_json import SampleJson

MOST_COMPARED_SAMPLES = 24
"""Largest number of samples of a class that proposals read, the newest ones; more do not change the mean costs and
distances."""

SEGMENTATION = "2026-11-27.2"
"""Name of the present segmentation. Whoever changes which zones it finds gives it a new name (a date, `.2` for the
second of a day), so that samples and versions say by which one they were measured: `python -m app remeasure`."""


@dataclass(frozen=True, slots=True)
class MeasuredSample:
    """A labelled page in its stored form, and warnings about its file of zones."""

    document: SampleJson
    warnings: list[Warning]


@dataclass(frozen=True, slots=True)
class ModelDraft:
    """A layout model without a version number, its labels, and what was doubtful in the samples of its table."""

    document: ModelJson
    labels: list[str]
    warnings: list[Warning] = field(default_factory=list)


@dataclass(frozen=True, slots=True)
class ModelDifference:
    """Differences between two versions of a model: their number `total`, and the largest ones as `changes`."""

    total: int
    changes: list[Change]


@dataclass(frozen=True, slots=True)
class PageDocument:
    """A stored page (an unknown page or a sample): its id and its document."""

    id: str
    document: SampleJson

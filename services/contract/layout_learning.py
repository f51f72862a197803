"""Models that learn: from what a person said of one page, and from rounds over all verified ones."""

from dataclasses import dataclass
from typing import Any, Final, Literal

Learner = Literal["passive-aggressive", "counting", "error-correction"]
"""How a model learns from a verified page; what each does is told by `services.layout.learning.learners`."""
DEFAULT_LEARNER: Final[Learner] = "passive-aggressive"
"""Of models whose settings name none: fewest errors on streams of verified pages (docs/decisions.md, 2026-11-22)."""


@dataclass(frozen=True, slots=True)
class FeedbackTask:
    """What a person said of a recognized page, beside what was found.

    `page` is the page of the kept result, `found_labels` the label of each of its zones there (of the class
    `found_class`; of the nearest one when that is None). `verified_class` None: the page is of no class. `labels` are
    those that were sent, maybe not of all zones: the others keep their label where the class was right, and take else
    the one that the verified class's model finds beside the named ones. `learners` tells how each model learns.
    """

    page: dict[str, Any]
    found_class: str | None
    found_labels: dict[str, str | None]
    verified_class: str | None
    labels: dict[str, str | None]
    learners: dict[str, str]


@dataclass(frozen=True, slots=True)
class Adaptation:
    """What a feedback makes of the models that it concerns.

    `documents` holds the new model of each of them by name; `verified_labels` the label of every zone, and `wrong`
    those that were found otherwise, each `{"zone", "found", "verified"}`. `costs` are those of both labellings under
    each model, `{"model", "found": {"before", "after"}, "verified": {"before", "after"}}`. `sample` is the verified
    page as `measure_sample` would answer it, of `zones` zones.
    """

    documents: dict[str, dict[str, Any]]
    verified_labels: dict[str, str | None]
    wrong: list[dict[str, Any]]
    costs: list[dict[str, Any]]
    sample: dict[str, Any]
    zones: int


@dataclass(frozen=True, slots=True)
class Training:
    """What rounds of training made of a model.

    `rounds` has one `{"round", "error", "held_out_error"}` for each, from round 0 on, which is initialization from
    the samples (or, when the model has seen more pages than there are samples, the model as it was); errors are
    shares of zones, the second None where no page is held out. `document` is the model after round `kept_round`.
    `stopped` says why there were no more: as many as were asked for, the error on held-out pages rose, or there was
    none left to learn from.
    """

    document: dict[str, Any]
    labels: list[str]
    rounds: list[dict[str, Any]]
    kept_round: int
    stopped: Literal["rounds", "held-out", "no-errors", "effort"]

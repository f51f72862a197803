"""Models that learn: from the feedback on one page, and in rounds over all samples."""

from dataclasses import dataclass
from typing import Any, Final, Generic, Literal, TypeVar

Learner = Literal["passive-aggressive", "counting", "error-correction"]
"""How a model learns from a verified page; `services.layout.learning.learners` has each."""
DEFAULT_LEARNER: Final[Learner] = "passive-aggressive"
"""Of models whose settings name none: fewest errors on streams of verified pages (docs/decisions.md, 2026-11-22)."""

Stop = Literal["rounds", "held-out", "no-errors", "effort"]
"""Why training ended: all rounds were done, the error on held-out pages rose, no error was left, or the work of one
training was spent."""

P = TypeVar("P")
Q = TypeVar("Q")


@dataclass(frozen=True, slots=True)
class VerifiedPage(Generic[P]):
    """A recognized page and a person's feedback on it.

    Parameters
    ----------
    page
        The page of the kept result: its document between processes, a `Page` inside of the worker.
    found_class
        The class that recognition chose; None: no class.
    found_labels
        The label of every zone by its id: of the model of `found_class`, or of the nearest one when that is None.
    verified_class
        The class that is right; None: the page is of no class.
    labels
        The labels that the person gave, by zone id. The other zones keep their found label where the class was right,
        and get the one that the model of the verified class finds otherwise.
    """

    page: P
    found_class: str | None
    found_labels: dict[str, str | None]
    verified_class: str | None
    labels: dict[str, str | None]

    def with_page(self, page: Q) -> "VerifiedPage[Q]":
        """The same feedback with the page in another form."""
        return VerifiedPage(page, self.found_class, self.found_labels, self.verified_class, self.labels)


@dataclass(frozen=True, slots=True)
class Adaptation:
    """What a verified page changes.

    `documents` has the new document of every model that learned, by name. `wrong` has the zones with a wrong label,
    each `{"zone", "found", "verified"}`. `costs` has the costs of both labellings under each model,
    `{"model", "found": {"before", "after"}, "verified": {"before", "after"}}`. `sample` is the verified page as
    `measure_sample` answers it, `zones` the number of its zones.
    """

    documents: dict[str, dict[str, Any]]
    wrong: list[dict[str, Any]]
    costs: list[dict[str, Any]]
    sample: dict[str, Any]
    zones: int


@dataclass(frozen=True, slots=True)
class Round:
    """Errors after a round of training, as shares of zones; `held_out_error` None: no page was held out.

    Round 0 is initialization from the samples, or the model as it was if it has seen more pages than these.
    """

    number: int
    error: float
    held_out_error: float | None


@dataclass(frozen=True, slots=True)
class TrainingReport:
    """All rounds of a training from round 0 on, the round whose model is kept, and why there were no more."""

    rounds: tuple[Round, ...]
    kept_round: int
    stopped: Stop

"""Input and output of learning: from feedback on one page, and in training rounds over all samples."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final, Generic, Literal, NotRequired, TypedDict, TypeVar

from services.contract.answers.learning import GivenText, LabellingCosts, Round, WrongLabel
from services.contract.answers.page import Warning
from services.contract.fields import FieldSetting
from services.contract.model_json import ModelJson
from services.contract.page_json import PageJson, SampleJson
from services.contract.result_json import LabelledZoneJson, TableJson

Learner = Literal["passive-aggressive", "counting", "error-correction"]
"""Algorithms by which a model learns from a verified page; `services.layout.learning.learners` implements them."""
DEFAULT_LEARNER: Final[Learner] = "passive-aggressive"
"""The learner of models whose settings name none. It made the fewest errors on streams of verified pages
(docs/decisions/learning.md)."""

Stop = Literal["rounds", "held-out", "no-errors", "no-change", "effort"]
"""Why training ended: after the last round; the error on held-out pages rose; no error was left; a round changed
nothing although errors are left; the limit of work was reached."""

P = TypeVar("P")
Q = TypeVar("Q")


@dataclass(frozen=True, slots=True)
class VerifiedPage(Generic[P]):
    """A recognized page and a person's feedback on it.

    Parameters
    ----------
    page
        The page of the stored result: a JSON document between processes, a `Page` inside the worker.
    found_class
        The class that recognition chose; None: no class fitted.
    found_labels
        The recognized label of every zone, by zone id. It comes from the model of `found_class`, or from the nearest
        model when `found_class` is None.
    verified_class
        The correct class; None: the page belongs to no class.
    labels
        The labels that the person gave, by zone id. If the class was right, the other zones keep their recognized
        label. Otherwise the model of the verified class finds their label.
    found_page
        Where the person drew zones: the page in the zones that were found, from which the model learns which pieces of
        segmentation belong together. None: the zones are the found ones.
    """

    page: P
    found_class: str | None
    found_labels: dict[str, str | None]
    verified_class: str | None
    labels: dict[str, str | None]
    found_page: P | None = None

    def read_by(self, read: Callable[[P], Q]) -> "VerifiedPage[Q]":
        """The same feedback with its pages in another form."""
        found = None if self.found_page is None else read(self.found_page)
        return VerifiedPage(
            read(self.page), self.found_class, self.found_labels, self.verified_class, self.labels, found
        )


class LessonJson(TypedDict):
    """A `VerifiedPage` as it is stored, with the labels of all zones, and the learners of its models by their names."""

    page: PageJson
    found_page: NotRequired[PageJson]
    found_class: str | None
    found_labels: dict[str, str | None]
    verified_class: str | None
    labels: dict[str, str | None]
    learners: dict[str, Learner]


@dataclass(frozen=True, slots=True)
class Adaptation:
    """The changes that a verified page causes.

    Parameters
    ----------
    documents
        The new document of every model that learned, by name.
    wrong
        The zones with a wrong label.
    costs
        The costs of both labellings under each model.
    sample
        The verified page, in the form of `measure_sample`.
    zones
        Number of zones of the page, without cells.
    tables
        The tables of the page by the verified class's model after learning; None where this may not change them.
    columns
        The labels of the columns of the verified class's table.
    warnings
        What is doubtful in the cells that the person labelled.
    """

    documents: dict[str, ModelJson]
    wrong: list[WrongLabel]
    costs: list[LabellingCosts]
    sample: SampleJson
    zones: int
    tables: list[TableJson] | None = None
    columns: tuple[str, ...] = ()
    warnings: list[Warning] = field(default_factory=list)


@dataclass(frozen=True, slots=True)
class RevisedPage:
    """A page with the zones or texts of a person: the page with all measurements, and the `zones` of its result.

    `texts` are those that the person gave.
    """

    page: PageJson
    zones: list[LabelledZoneJson]
    texts: list[GivenText]


@dataclass(frozen=True, slots=True)
class Correction:
    """What a person said of a page.

    Parameters
    ----------
    class_name
        The class; None: none of the classes.
    labels
        The labels of all zones, by their ids.
    texts
        Ids of the zones whose text the person gave.
    fields
        The types of the fields of the class, by label.
    continues
        The class whose later pages this class describes; None: none.
    tolerated_error
        Of the class, as the operator states it.
    items
        The columns of the class's table.
    tables
        As of the `Adaptation`.
    """

    class_name: str | None
    labels: Mapping[str, str | None]
    texts: frozenset[str]
    fields: Mapping[str, FieldSetting]
    continues: str | None
    tolerated_error: float
    items: tuple[str, ...] = ()
    tables: Sequence[TableJson] | None = None


@dataclass(frozen=True, slots=True)
class TrainingReport:
    """All rounds of a training, the round whose model is kept, and why training ended.

    Round 0 is initialization from the samples. If the model has learned from more pages than these, round 0 is the
    unchanged model.
    """

    rounds: tuple[Round, ...]
    kept_round: int
    stopped: Stop

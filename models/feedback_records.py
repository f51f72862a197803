"""What the store takes and gives of feedback: its lessons, what models learned from it, and taking it back."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import Literal, NotRequired, TypedDict

from models.documents import Document
from models.records import Origin, ReviewDraft, UnknownPageDraft
from services.contract.answers.learning import Verdict
from services.contract.layout_learning import LessonJson
from services.contract.model_json import ModelJson
from services.contract.page_json import GivenZoneJson

_Given = TypedDict("_Given", {"class": NotRequired[str | None]})


class GivenJson(_Given):
    """The body of a feedback: what a person said of a result."""

    new_class: NotRequired[bool]
    labels: dict[str, str | None]
    texts: NotRequired[dict[str, str]]
    zones: NotRequired[list[GivenZoneJson]]


class ReportJson(TypedDict):
    """`FeedbackReport`: the store reads of each recognized zone its label, its confidence, and whether it was right."""

    verdicts: NotRequired[list[Verdict]]


@dataclass(frozen=True, slots=True, eq=False)
class ModelChange:
    """A new document of a class, made from version `expected_version` (None: the class has no version yet)."""

    name: str
    document: ModelJson
    expected_version: int | None


@dataclass(frozen=True, slots=True)
class ModelStep:
    """One step of a model's history: how version `version` was made.

    `feedback_id` is the feedback of a version of origin "feedback", None when it was deleted.
    """

    version: int
    origin: Origin
    note: str
    feedback_id: str | None


@dataclass(frozen=True, slots=True, eq=False)
class ModelPast:
    """What is needed to compute a model as if it had never learned from the feedback on one result.

    Parameters
    ----------
    current
        The newest version; None: none.
    base
        The version before the first lesson on the result, without any lesson that was taken back earlier. None: the
        model had no version.
    steps
        The steps after `base`, oldest first, without those to be taken back; None: the newest version contains no
        lesson on the result, and the model does not change.
    superseded
        The versions that contain what is taken back.
    """

    name: str
    current: int | None
    base: int | None
    steps: tuple[ModelStep, ...] | None
    superseded: tuple[int, ...]


@dataclass(frozen=True, slots=True, eq=False)
class ModelUndo:
    """The document of a class without the lessons on one result; None: the class has no version without them.

    `changes` is False if the newest version contains none of these lessons. Then the document is not stored.
    """

    name: str
    document: ModelJson | None
    expected_version: int | None
    superseded: tuple[int, ...]
    changes: bool = True


@dataclass(frozen=True, slots=True, eq=False)
class FeedbackUndo:
    """What taking back the feedback on a result has done.

    `versions` has the version before and after for every model that changed; None after: the model has no version now.
    `samples` counts the deleted samples.
    """

    feedback_ids: tuple[str, ...]
    versions: Mapping[str, tuple[int | None, int | None]]
    samples: int


@dataclass(frozen=True, slots=True, eq=False)
class Lesson:
    """The lesson of a feedback (`FeedbackDraft.lesson`), and the versions of its models before and after it."""

    result_id: str
    document: LessonJson
    versions: Mapping[str, tuple[int | None, int]]


@dataclass(frozen=True, slots=True, eq=False)
class FeedbackDraft:
    """A person's feedback on a result, with its consequences.

    Parameters
    ----------
    request
        The parsed body. An equal body on the same result counts once.
    report
        The answer; a repeated request gets it again. The store does not read it.
    zones, wrong_zones
        Number of zones of the page, and of zones with a wrong label.
    sample
        The verified page. It becomes a sample of `verified_class` if both are given.
    unknown_page
        Stored in the same transaction, once for each result.
    lesson
        The verified page with all labels, from which the models can learn again. The store does not read it.
    owner
        Name of the API key that gave it; None without keys.
    revised
        Page and result as the person has verified them; None: they do not change.
    review
        Their place in the review queue.
    may_create_class
        The verified class is created if it does not exist.
    letters, wrong_letters
        Number of letters of the texts that the person gave, and of the edits that made them of the read ones.
    is_corrected
        Whether the result as verified differs from the recognized one. Wrong zones, a wrong class and wrong letters
        say so too.
    """

    result_id: str
    key: str | None
    request: Document
    report: Document
    found_class: str | None
    verified_class: str | None
    zones: int
    wrong_zones: int
    class_wrong: bool
    sample: Document | None
    unknown_page: UnknownPageDraft | None = None
    lesson: Document | None = None
    owner: str | None = None
    revised: Document | None = None
    review: ReviewDraft | None = None
    may_create_class: bool = False
    letters: int | None = None
    wrong_letters: int | None = None
    is_corrected: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class StoredFeedback:
    """A stored feedback. `created` is False when it was stored before (same key, or same body and result).

    `versions` has the version before (None: none) and after the feedback for every model that it changed. `sample_id`
    is None when there is no sample, or it was deleted. The result itself may have expired. `taken_back` has the version
    before and after for every model from which this feedback took earlier lessons on the same result back.
    """

    id: str
    result_id: str
    request: GivenJson
    report: ReportJson
    versions: Mapping[str, tuple[int | None, int]]
    sample_id: str | None
    created_at: datetime
    created: bool
    taken_back: Mapping[str, tuple[int | None, int | None]] = field(default_factory=dict)


NoEffect = Literal["rolled-back", "replaced"]
"""Why a model does not contain a lesson: it has left the version, or later feedback on the result took it back."""


@dataclass(frozen=True, slots=True)
class FeedbackSummary:
    """One feedback in the history of a class, without its documents; `without_effect` names classes that exist."""

    id: str
    result_id: str
    found_class: str | None
    verified_class: str | None
    zones: int
    wrong_zones: int
    versions: Mapping[str, tuple[int | None, int]]
    without_effect: Mapping[str, NoEffect]
    sample_id: str | None
    created_at: datetime


@dataclass(frozen=True, slots=True)
class ModelHealth:
    """Error rates of recognition for a class, from the last `recent` feedbacks and from the earlier ones.

    Rates are shares, 0-1: zones with a wrong label among all zones, feedbacks with a wrong class among all feedbacks,
    and wrong letters among those of texts that were given. None: there is no feedback.
    """

    feedbacks: int
    recent: int
    recent_zone_error: float | None
    recent_class_error: float | None
    earlier_zone_error: float | None
    last_feedback_at: datetime | None
    recent_text_error: float | None = None

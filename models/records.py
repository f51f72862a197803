"""What the store answers with: plain values, with times that are aware and in UTC."""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from enum import Enum
from typing import Any, Final, Literal

from models.documents import Document
from services.contract.layout_learning import DEFAULT_LEARNER, Learner

Origin = Literal["initialize", "import", "feedback", "train", "rollback"]
"""What made a version of a model."""
SampleOrigin = Literal["posted", "feedback"]
"""Whether somebody sent a sample as such, or it is the verified page of a feedback."""


class AnyVersion(Enum):
    """The type of `ANY`."""

    ANY = "any"


ANY: Final = AnyVersion.ANY
"""The writer does not mind which version the model has."""
ExpectedVersion = int | None | AnyVersion
"""None: the class has no version yet."""


@dataclass(frozen=True, slots=True)
class ModelSettings:
    """What is set for a class beside its versions: it stays when they change.

    `genre` names the genre that the class belongs to (None: it is found by likeness). `continues` names the class
    whose later pages this one describes (None: it describes whole documents, or first pages).
    """

    learner: Learner = DEFAULT_LEARNER
    genre: str | None = None
    continues: str | None = None


@dataclass(frozen=True, slots=True)
class ModelSummary:
    """A document class as a list shows it; `version` is None until it was initialized or imported."""

    name: str
    version: int | None
    samples: int
    created_at: datetime
    updated_at: datetime
    settings: ModelSettings = ModelSettings()


@dataclass(frozen=True, slots=True, eq=False)
class StoredModel:
    """A document class with one version of its model; without one, `version`, `document`, `origin` are None.

    `created_at` and `updated_at` (last version or change of samples) are the class's, whichever version was
    asked for. A document never changes under its (name, version).
    """

    name: str
    version: int | None
    document: dict[str, Any] | None
    samples: int
    created_at: datetime
    updated_at: datetime
    origin: Origin | None
    settings: ModelSettings = ModelSettings()


@dataclass(frozen=True, slots=True)
class VersionSummary:
    """One version in a model's history; `note` is what its writer said about it, "" for nothing."""

    version: int
    origin: Origin
    created_at: datetime
    note: str


@dataclass(frozen=True, slots=True, eq=False)
class StoredSample:
    """A labelled page of a class; `created` is False where it was there already (same key or same content).

    `result_id` names the result that it verifies, where it came by feedback.
    """

    id: str
    document: dict[str, Any]
    created_at: datetime
    created: bool
    origin: SampleOrigin = "posted"
    result_id: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class StoredResult:
    """The answer to a recognition, kept until `expires_at`."""

    id: str
    document: dict[str, Any]
    created_at: datetime
    expires_at: datetime


@dataclass(frozen=True, slots=True, eq=False)
class ModelChange:
    """A new document of a class, made from its version `expected_version` (None: it has samples, but no version)."""

    name: str
    document: Document
    expected_version: int | None


@dataclass(frozen=True, slots=True, eq=False)
class FeedbackDraft:
    """What a person said of a result, and what came of it.

    `request` is the body as it was understood: the same one counts once for a result. `report` is told again when
    it comes again; the store does not look into it. `zones` is how many zones the page has, `wrong_zones` of how
    many the label was wrong. `sample`, the verified page, becomes a sample of `verified_class` where both are given.
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


@dataclass(frozen=True, slots=True, eq=False)
class StoredFeedback:
    """A feedback that is kept; `created` is False where it was there already (same key, or same body and result).

    `versions` has for every model that changed the version before (None: none) and after. `sample_id` is None
    where no sample was made, or it is gone. The result itself may have been purged.
    """

    id: str
    result_id: str
    request: dict[str, Any]
    report: dict[str, Any]
    versions: Mapping[str, tuple[int | None, int]]
    sample_id: str | None
    created_at: datetime
    created: bool


@dataclass(frozen=True, slots=True)
class FeedbackSummary:
    """One feedback in the history of a class, without its documents."""

    id: str
    result_id: str
    found_class: str | None
    verified_class: str | None
    zones: int
    wrong_zones: int
    class_wrong: bool
    versions: Mapping[str, tuple[int | None, int]]
    sample_id: str | None
    created_at: datetime


@dataclass(frozen=True, slots=True)
class ModelHealth:
    """What feedback told of a class: how much recognition erred, lately (`recent` feedbacks) and before that.

    Errors are shares, 0-1: of zones with a wrong label among all zones, of feedbacks with a wrong class among all;
    None where there is nothing to look at.
    """

    feedbacks: int
    recent: int
    recent_zone_error: float | None
    recent_class_error: float | None
    earlier_zone_error: float | None
    last_feedback_at: datetime | None


@dataclass(frozen=True, slots=True, eq=False)
class UnknownPage:
    """A page that fitted no class, as its result has it; `result_id` names the result, which may be purged."""

    id: str
    result_id: str
    page: dict[str, Any]
    created_at: datetime

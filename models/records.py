"""The records that the store returns: plain values. Times are aware and in UTC."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from datetime import datetime
from enum import Enum
from typing import Final, Literal, NamedTuple, cast

from models.documents import Document
from services.contract.fields import FieldSetting
from services.contract.html import HtmlElement
from services.contract.kept_pages import KeptPageJson
from services.contract.layout_learning import DEFAULT_LEARNER, Learner
from services.contract.model_json import ModelJson
from services.contract.page_json import PageJson, SampleJson
from services.contract.result_json import RecognizedJson, ResultJson, StoredResultJson

MAX_NAME = 200
"""Characters of a class's name or of an idempotency key."""

MOST_INTEGER = 2**31 - 1
"""Of a column: versions, and counts of zones."""

CLOCKS_DIFFER_S = 60.0
"""Clocks of machines that share a database may differ by so much; docs/operations.md asks for a few seconds."""

Origin = Literal["initialize", "import", "feedback", "train", "rollback", "undo"]
"""The action that made a version of a model."""
SampleOrigin = Literal["posted", "feedback"]
""""posted": a client sent the sample. "feedback": it is the verified page of a feedback."""


class AnyVersion(Enum):
    """The type of `ANY`."""

    ANY = "any"


ANY: Final = AnyVersion.ANY
"""The writer accepts any version of the model."""
ExpectedVersion = int | None | AnyVersion | Callable[[int | None], None]
"""None: the class must have no version. A function gets the version of the class at the time of writing, and raises an
error to prevent the write."""


@dataclass(frozen=True, slots=True)
class ModelSettings:
    """The settings of a class. A new version does not change them.

    `genre` names the genre of the class; None: the service finds it by similarity. `continues` names the class whose
    later pages this class describes; None: it describes whole documents, or first pages. `fields` has the types of
    fields, `elements` the elements of HTML pages, both by label. `items` are the labels of the columns of a table.
    """

    learner: Learner = DEFAULT_LEARNER
    genre: str | None = None
    continues: str | None = None
    fields: Mapping[str, FieldSetting] = field(default_factory=dict)
    elements: Mapping[str, HtmlElement] = field(default_factory=dict)
    items: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class ClassSummary:
    """A document class without its document. `version` is None before initialization or import."""

    name: str
    version: int | None
    samples: int
    created_at: datetime
    updated_at: datetime
    settings: ModelSettings = field(default_factory=ModelSettings)


@dataclass(frozen=True, slots=True, eq=False)
class StoredModel:
    """A document class with one version of its model. Without a version, `version`, `document` and `origin` are None.

    `created_at` and `updated_at` (last new version or change of samples) belong to the class, not to the version. The
    document of a (name, version) never changes.
    """

    name: str
    version: int | None
    document: ModelJson | None
    samples: int
    created_at: datetime
    updated_at: datetime
    origin: Origin | None
    settings: ModelSettings = field(default_factory=ModelSettings)


@dataclass(frozen=True, slots=True)
class VersionSummary:
    """One version in a model's history. `note` is a remark of the writer, "" without one."""

    version: int
    origin: Origin
    created_at: datetime
    note: str


@dataclass(frozen=True, slots=True, eq=False)
class StoredSample:
    """A labelled page of a class. `created` is False when it was stored before (same key or same content).

    `result_id` is the verified result if the sample comes from feedback. `after_version` is the class's last version
    when the sample came, 0 without any.
    """

    id: str
    document: SampleJson
    created_at: datetime
    created: bool
    origin: SampleOrigin = "posted"
    result_id: str | None = None
    after_version: int = 0


@dataclass(frozen=True, slots=True)
class StoredResult:
    """The result of a recognition, kept until `expires_at`. `pages` has the results of a document's pages."""

    id: str
    document: StoredResultJson
    created_at: datetime
    expires_at: datetime
    owner: str | None = None
    pages: "tuple[StoredResult, ...]" = ()


@dataclass(frozen=True, slots=True)
class StoredPage:
    """A page whose photo is kept for some time."""

    id: str
    document: KeptPageJson
    created_at: datetime
    owner: str | None


class UploadPiece(NamedTuple):
    """A piece of an upload: the last part of its blob's key, and its number of bytes."""

    name: str
    size: int


@dataclass(frozen=True, slots=True)
class StoredUpload:
    """An upload of `length` bytes, of which the first `received` have come, in `pieces`."""

    id: str
    owner: str | None
    name: str | None
    length: int
    received: int
    pieces: tuple[UploadPiece, ...]
    created_at: datetime
    expires_at: datetime


@dataclass(frozen=True, slots=True)
class UploadBounds:
    """Most uploads that are kept, of all and of one owner, and most bytes that all of them may come to."""

    most: int
    most_of_owner: int
    most_bytes: int


ResultState = Literal["open", "confirmed", "corrected"]
"""Open: without feedback; confirmed: feedback found nothing wrong; corrected: it found something wrong."""


@dataclass(frozen=True, slots=True, eq=False)
class ListedResult:
    """The result of one page in a list; `result` is its `LayoutResult` without the id.

    `stored_bytes` is the size of all that is stored of it, as JSON. `document` is the id of the document of several
    pages that it belongs to; None: of none, or an older release has stored it.
    """

    id: str
    result: ResultJson
    stored_bytes: int
    created_at: datetime
    expires_at: datetime
    state: ResultState
    document: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class UnknownPageDraft:
    """A page that fits no class, kept for `ttl_s` seconds. The store keeps the `bound` newest ones.

    `owner` is the name of the API key that sent it; None without keys.
    """

    page: Document
    bound: int
    ttl_s: float
    owner: str | None = None


ReviewState = Literal["open", "confirmed", "corrected", "skipped"]
ReviewOrder = Literal["gain", "confidence", "newest"]


RECOGNIZED = "recognized"
"""Key of a result's document with what was recognized, where a person has verified it since."""


def recognized(document: StoredResultJson) -> RecognizedJson:
    """`page` and `result` of a stored page as they were recognized, whatever a person has said since."""
    found = document.get("recognized") or {name: document.get(name) for name in ("page", "result")}
    return cast(RecognizedJson, dict(found))


@dataclass(frozen=True, slots=True)
class ReviewDraft:
    """What the review queue knows of a page: expected number of wrong zones, least confidence, class, decision.

    `model_version` is that of the class's model by which the page was recognized; None: unknown, or no class.
    """

    gain: float
    confidence: float
    class_name: str | None
    zones: int
    decision: str
    has_image: bool = False
    model_version: int | None = None


@dataclass(frozen=True, slots=True)
class Review:
    """The result of a page in the review queue. `claimed_until` is None if nobody works on it."""

    id: str
    state: ReviewState
    gain: float
    confidence: float
    class_name: str | None
    zones: int
    decision: str
    has_image: bool
    created_at: datetime
    claimed_by: str | None
    claimed_until: datetime | None


@dataclass(frozen=True, slots=True)
class StoredAuditEntry:
    """Who changed what, and when; `who` is the name of an API key, None without keys."""

    id: str
    created_at: datetime
    who: str | None
    action: str
    model: str | None
    detail: str


@dataclass(frozen=True, slots=True, eq=False)
class ResultDraft:
    """The result of a recognition. `unknown` is its page, if no class fits; `owner` as in `UnknownPageDraft`.

    `review` is its place in the review queue; None: it is not in the queue.
    """

    document: Document
    unknown: UnknownPageDraft | None = None
    owner: str | None = None
    review: ReviewDraft | None = None


@dataclass(frozen=True, slots=True, eq=False)
class StoredUnknownPage:
    """A page that fitted no class, in the form of its result. The result `result_id` may have expired."""

    id: str
    result_id: str
    page: PageJson
    created_at: datetime
    owner: str | None = None

"""What the store answers with: plain values, with times that are aware and in UTC."""

from dataclasses import dataclass
from datetime import datetime
from enum import Enum
from typing import Any, Final, Literal

Origin = Literal["initialize", "import", "feedback", "train", "rollback"]
"""What made a version of a model."""


class AnyVersion(Enum):
    """The type of `ANY`."""

    ANY = "any"


ANY: Final = AnyVersion.ANY
"""The writer does not mind which version the model has."""
ExpectedVersion = int | None | AnyVersion
"""None: the class has no version yet."""


@dataclass(frozen=True, slots=True)
class ModelSummary:
    """A document class as a list shows it; `version` is None until it was initialized or imported."""

    name: str
    version: int | None
    samples: int
    created_at: datetime
    updated_at: datetime


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


@dataclass(frozen=True, slots=True)
class VersionSummary:
    """One version in a model's history; `note` is what its writer said about it, "" for nothing."""

    version: int
    origin: Origin
    created_at: datetime
    note: str


@dataclass(frozen=True, slots=True, eq=False)
class StoredSample:
    """A labelled page of a class; `created` is False where it was there already (same key or same content)."""

    id: str
    document: dict[str, Any]
    created_at: datetime
    created: bool


@dataclass(frozen=True, slots=True, eq=False)
class StoredResult:
    """The answer to a recognition, kept until `expires_at`."""

    id: str
    document: dict[str, Any]
    created_at: datetime
    expires_at: datetime

"""What can go wrong with what is remembered, one class for each thing that a caller can act on.

Every error has a stable `code` for the HTTP contract and a `detail` in words; `str(error)` is the detail.
"""

from typing import ClassVar


class StoreError(Exception):
    """Base of all errors of the store. Arguments go to `super().__init__` unchanged (pickle needs them)."""

    code: ClassVar[str] = "internal"

    def __init__(self, detail: str) -> None:
        super().__init__(detail)
        self.detail = detail


class NotFound(StoreError):
    """Nothing is stored under this name or id; `what` is the name or id that was asked for."""

    code = "not-found"

    def __init__(self, detail: str, what: str) -> None:
        Exception.__init__(self, detail, what)
        self.detail = detail
        self.what = what

    def __str__(self) -> str:
        return self.detail


class ModelNotFound(NotFound):
    """There is no such document class, or it has no such version."""


class SampleNotFound(NotFound):
    """The document class has no such sample."""


class ResultNotFound(NotFound):
    """There is no such result, or it is no longer kept."""


class UnknownPageNotFound(NotFound):
    """There is no such page that fitted no class, or it is no longer kept."""


class VersionConflict(StoreError):
    """The model has another version than the writer expected; `current` is the version it has, if any."""

    code = "conflict"

    def __init__(self, detail: str, current: int | None) -> None:
        Exception.__init__(self, detail, current)
        self.detail = detail
        self.current = current

    def __str__(self) -> str:
        return self.detail


class KeyReused(StoreError):
    """An idempotency key came again, with another document than the first time."""

    code = "conflict"


class NotStorable(StoreError):
    """A name or a document that cannot be kept: not JSON, too long, characters that no database takes."""

    code = "not-storable"


class StoreFull(StoreError):
    """A bound of the caller's (samples of a class, number of classes) is reached."""

    code = "store-full"


class StoreUnavailable(StoreError):
    """The database cannot be read or written now: locked for too long, no room, no permission, gone."""

    code = "store-unavailable"


class StoreDamaged(StoreUnavailable):
    """The database is there, and what it holds is not what was written."""


class StoreTooNew(StoreUnavailable):
    """The database was written by a newer release than this one."""

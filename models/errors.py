"""Errors of the store, one class for each reaction of a caller.

Every error has a stable `code` for the HTTP contract and a `detail` in words. `str(error)` is the detail.
"""

from typing import ClassVar


class StoreError(Exception):
    """Base of all errors of the store. `super().__init__` gets the arguments unchanged; pickle needs this."""

    code: ClassVar[str] = "internal"

    def __init__(self, detail: str) -> None:
        super().__init__(detail)
        self.detail = detail


class NotFound(StoreError):
    """Nothing is stored under the requested name or id, which is `what`."""

    code = "not-found"

    def __init__(self, detail: str, what: str) -> None:
        Exception.__init__(self, detail, what)
        self.detail = detail
        self.what = what

    def __str__(self) -> str:
        return self.detail


class ModelNotFound(NotFound):
    """The document class, or this version of it, does not exist."""


class SampleNotFound(NotFound):
    """The document class has no sample with this id."""


class ResultNotFound(NotFound):
    """There is no result with this id, or it has expired."""


class KeptPageNotFound(NotFound):
    """No page with this id is kept, or it has expired."""


class UploadNotFound(NotFound):
    """There is no upload with this id, or it has expired."""


class UploadMoved(StoreError):
    """An upload does not end where a piece begins: another piece came, or one is missing."""

    code = "wrong-offset"


class UploadsFull(StoreError):
    """There is no room for another upload."""

    code = "busy"


class FeedbackNotFound(NotFound):
    """There is no feedback on this result."""


class UnknownPageNotFound(NotFound):
    """There is no unknown page with this id, or it has expired."""


class CameraNotFound(NotFound):
    """No camera of this name is remembered."""


class NoSuchJob(NotFound):
    """There is no job with this id, or it has expired."""


class Claimed(StoreError):
    """Another person works on this page of the review queue."""

    code = "conflict"


class VersionConflict(StoreError):
    """The model does not have the version that the writer expected. `current` is its version, None without any."""

    code = "conflict"

    def __init__(self, detail: str, current: int | None) -> None:
        Exception.__init__(self, detail, current)
        self.detail = detail
        self.current = current

    def __str__(self) -> str:
        return self.detail


class KeyReused(StoreError):
    """An idempotency key was used again with another document."""

    code = "conflict"


class JobKeyReused(KeyReused):
    """The Idempotency-Key of a job came with a different request before."""


class QueueFull(StoreError):
    """There are too many unfinished jobs."""

    code = "busy"


class NotStorable(StoreError):
    """A name or a document cannot be stored: it is not JSON, too long, or has characters that databases refuse."""

    code = "not-storable"


class StoreFull(StoreError):
    """A limit that the caller gave is reached: samples of a class, or number of classes."""

    code = "store-full"


class StoreUnavailable(StoreError):
    """The database cannot be read or written now: it is locked for too long, full, forbidden, or missing."""

    code = "store-unavailable"


class StoreDamaged(StoreUnavailable):
    """The database exists, but its content is damaged."""


class StoreTooNew(StoreUnavailable):
    """A newer release has written the database."""

"""Errors that a user can act on, one class each, with the stable codes of the HTTP contract."""

from typing import ClassVar


class DocumentError(Exception):
    """Base of all errors that the product raises on purpose.

    Every subclass passes its arguments to `super().__init__` unchanged, so that it can be sent from a worker process
    (pickle rebuilds an exception from `args`, then restores its attributes). `field` is the part of the request that
    is wrong, if there is one.
    """

    code: ClassVar[str] = "internal"

    def __init__(self, detail: str, field: str | None = None) -> None:
        super().__init__(detail)
        self.detail = detail
        self.field = field


class TooLarge(DocumentError):
    """The image has more bytes, pixels or metadata than a limit allows."""

    code = "too-large"


class UnsupportedMediaType(DocumentError):
    """The bytes are not in an accepted image format."""

    code = "unsupported-media-type"


class UndecodableImage(DocumentError):
    """The image data is truncated or damaged."""

    code = "undecodable-image"


class NotAcceptable(DocumentError):
    """No representation fits what the client accepts."""

    code = "not-acceptable"


class InvalidOption(DocumentError):
    """The option `field` is unknown, malformed or out of its range; the detail names it too."""

    code = "invalid-option"

    def __init__(self, detail: str, field: str) -> None:
        super().__init__(detail, field)
        self.args = (detail, field)

    def __str__(self) -> str:
        return self.detail


class NoText(DocumentError):
    """The image shows neither enough printed text nor sheet edges to find the page's shape."""

    code = "no-text"


class NotOverlapping(DocumentError):
    """No two of the photos show the same part of a page; the detail names them."""

    code = "not-overlapping"


class InvalidModel(DocumentError):
    """The document is not a layout model, is damaged, or has a format that this release does not know."""

    code = "invalid-model"


class NotDoneInTime(DocumentError):
    """The time for all the work ended before this part of it was done."""

    code = "timed-out"

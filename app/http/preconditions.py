"""`If-Match` and `If-None-Match` as conditions on a model's version."""

import re
from dataclasses import dataclass

from services.errors import DocumentError, InvalidOption

_TAG = re.compile(r'(W/)?"([^"]*)"|([^\s",]+)')
_VERSION = re.compile("[1-9][0-9]{0,9}")


class Conflict(DocumentError):
    """The model is not in the state that the writer expects."""

    code = "conflict"


class PreconditionFailed(Conflict):
    """The model does not meet the request's precondition headers; the HTTP status is 412 instead of 409."""


def entity_tag(version: int) -> str:
    """`ETag` of a version of a model."""
    return f'"{version}"'


@dataclass(frozen=True, slots=True)
class Precondition:
    """Condition on a model before a write.

    `versions` are those that `If-Match` names (None: not sent). `exists` is `If-Match: *`, `is_new` is
    `If-None-Match: *`.
    """

    versions: frozenset[int] | None = None
    exists: bool = False
    is_new: bool = False

    def check(self, name: str, current: int | None) -> None:
        """Check the condition against the model's `current` version (None: no version).

        Raises
        ------
        PreconditionFailed
            When the condition is not met.
        """
        now = "no version" if current is None else f"version {current}"
        if self.is_new and current is not None:
            raise PreconditionFailed(f"Model {name} already exists, with {now} (If-None-Match).")
        if self.exists and current is None:
            raise PreconditionFailed(f"Model {name} has no version yet (If-Match).")
        if self.versions is not None and current not in self.versions:
            raise PreconditionFailed(
                f"Model {name} has {now} now; If-Match does not name it. Read the model again, and send its ETag "
                'as If-Match, for example If-Match: "3".'
            )


def parse_precondition(if_match: str | None, if_none_match: str | None) -> Precondition:
    """The condition in these headers (RFC 9110, 13.1); weak or unknown tags match no version.

    A tag may lack its quotes, because shells remove them.

    Raises
    ------
    InvalidOption
        When `If-None-Match` is not `*`.
    """
    if if_none_match is not None and if_none_match.strip() != "*":
        raise InvalidOption("If-None-Match: send * or omit the header.", "If-None-Match")
    is_new = if_none_match is not None
    if if_match is None:
        return Precondition(is_new=is_new)
    if if_match.strip() == "*":
        return Precondition(exists=True, is_new=is_new)
    tags = _TAG.findall(if_match)
    numbers = [quoted or bare for weak, quoted, bare in tags if not weak]
    versions = frozenset(int(number) for number in numbers if _VERSION.fullmatch(number))
    return Precondition(versions, is_new=is_new)

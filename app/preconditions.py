"""`If-Match` and `If-None-Match` -> what a writer expects of a model."""

import re
from dataclasses import dataclass

from services.errors import DocumentError, InvalidOption

_TAG = re.compile(r'(W/)?"([^"]*)"')
_VERSION = re.compile("[1-9][0-9]{0,9}")


class Conflict(DocumentError):
    """The model is not what the writer takes it for."""

    code = "conflict"


class PreconditionFailed(Conflict):
    """The model is not what the headers of the request say; the status is then another."""


def entity_tag(version: int) -> str:
    """`ETag` of a version of a model."""
    return f'"{version}"'


@dataclass(frozen=True, slots=True)
class Precondition:
    """What must be true of a model before it is written.

    `versions` are those that `If-Match` names (None: it was not sent), `exists` is its `*`, and `is_new` that of
    `If-None-Match`.
    """

    versions: frozenset[int] | None = None
    exists: bool = False
    is_new: bool = False

    def check(self, name: str, current: int | None) -> None:
        """Judge the version that the model has, None: it has none.

        Raises
        ------
        PreconditionFailed
            When the precondition is not met.
        """
        now = "no version" if current is None else f"version {current}"
        if self.is_new and current is not None:
            raise PreconditionFailed(f"Model {name} exists already, with {now} (If-None-Match).")
        if self.exists and current is None:
            raise PreconditionFailed(f"Model {name} has no version yet (If-Match).")
        if self.versions is not None and current not in self.versions:
            raise PreconditionFailed(
                f"Model {name} has {now} now, which is none of those in If-Match; read it again."
            )


def parse_precondition(if_match: str | None, if_none_match: str | None) -> Precondition:
    """The precondition in these headers (RFC 9110, 13.1); weak and foreign tags match no version.

    Raises
    ------
    InvalidOption
        When `If-None-Match` is another than `*`.
    """
    if if_none_match is not None and if_none_match.strip() != "*":
        raise InvalidOption("If-None-Match: send * or leave it out.", "If-None-Match")
    is_new = if_none_match is not None
    if if_match is None:
        return Precondition(is_new=is_new)
    if if_match.strip() == "*":
        return Precondition(exists=True, is_new=is_new)
    tags = _TAG.findall(if_match)
    versions = frozenset(int(tag) for weak, tag in tags if not weak and _VERSION.fullmatch(tag))
    return Precondition(versions, is_new=is_new)

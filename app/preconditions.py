"""`If-Match` and `If-None-Match` -> what a writer expects of a model."""

import re
from dataclasses import dataclass

from models.records import ANY, ExpectedVersion
from services.errors import DocumentError, InvalidOption

_TAG = re.compile(r'(W/)?"([^"]*)"')
_VERSION = re.compile("[1-9][0-9]{0,9}")


class Conflict(DocumentError):
    """The model is not what the writer takes it for."""

    code = "conflict"


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

    def check(self, name: str, current: int | None) -> ExpectedVersion:
        """What the store shall expect when it writes; `current` is the model's version now, None: it has none.

        Raises
        ------
        Conflict
            When it is not met already.
        """
        now = "no version" if current is None else f"version {current}"
        if self.is_new and current is not None:
            raise Conflict(f"Model {name} exists already, with {now} (If-None-Match).")
        if self.exists and current is None:
            raise Conflict(f"Model {name} has no version yet (If-Match).")
        if self.versions is not None and current not in self.versions:
            raise Conflict(f"Model {name} has {now} now, which is none of those in If-Match; read it again.")
        return ANY if self == Precondition() else current


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

"""Who sends a request: the name of its API key, and whose data it may see.

What a request stores belongs to the name of its key, so that a key can be replaced by another one of the same name.
"""

from dataclasses import dataclass
from hashlib import sha256

from fastapi import Request

from app.roles import ADMIN
from app.state import AppState
from models.errors import ResultNotFound

_SEPARATOR = "\0"
"""Not in any name of a key."""


@dataclass(frozen=True, slots=True)
class Caller:
    """The name of a request's key (None: the service has no keys), and whether it sees everything."""

    name: str | None
    sees_all: bool

    @property
    def only(self) -> str | None:
        """The owner to whose things a list is limited; None: it has those of all."""
        return None if self.sees_all else self.name

    def sees(self, owner: str | None) -> bool:
        """Whether something that `owner` made is shown to this caller."""
        return self.sees_all or owner == self.name

    def scoped(self, idempotency_key: str | None) -> str | None:
        """An Idempotency-Key as it is stored, so that the same one of another API key is a different one."""
        if idempotency_key is None or self.name is None:
            return idempotency_key
        return sha256(f"{self.name}{_SEPARATOR}{idempotency_key}".encode(errors="replace")).hexdigest()


def caller_of(request: Request) -> Caller:
    """Who sends this request."""
    return Caller(request.state.caller, request.state.role == ADMIN)


async def require_own_result(request: Request, state: AppState, result_id: str) -> Caller:
    """The caller, if the result (or the feedback that is left of it) is its own.

    Raises
    ------
    ResultNotFound
        When there is no such result, or another key made it. Both cases look the same to the caller.
    """
    caller = caller_of(request)
    owner = await state.store.call(lambda store: store.result_owner(result_id))
    if not caller.sees(owner):
        raise ResultNotFound(f"there is no result {result_id!r}, or no longer", result_id)
    return caller

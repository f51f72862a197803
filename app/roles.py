"""Keys of a file with names and roles, and what each role may do.

A line of the file is `NAME ROLE DIGEST`: the digest is SHA-256 of the key in hexadecimal. Keys are made at random
(`python -m app.roles NAME ROLE`), so a fast digest is enough: there is nothing to guess. Empty lines and lines that
begin with # are ignored.
"""

import hashlib
import re
import secrets
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal, cast, get_args

from starlette.routing import compile_path
from starlette.types import ASGIApp, Receive, Scope, Send

from app.http.paths import MOSAIC_PATHS, RECTIFY_PATHS
from services.errors import DocumentError

Role = Literal["reader", "verifier", "admin"]
ROLES: tuple[Role, ...] = get_args(Role)
ADMIN: Final = "admin"
"""The role that may do everything, and sees what all keys have made."""
MOST_FILE_BYTES = 1 << 20
"""Largest file of keys: some ten thousand."""
_LINE = re.compile(r"([A-Za-z][A-Za-z0-9_.-]{0,62})\s+(\w+)\s+([0-9a-f]{64})")
_SAFE = frozenset({"GET", "HEAD", "OPTIONS"})
READERS_WRITE = (
    *(("POST", path) for path in (*RECTIFY_PATHS, *MOSAIC_PATHS)),
    ("POST", "/layout"),
    ("POST", "/tokens"),
    ("POST", "/pages/{id}/render"),
    ("POST", "/pages/bind"),
    ("DELETE", "/pages/{id}"),
    ("DELETE", "/jobs/{id}"),
    ("DELETE", "/cameras/{name}"),
    ("POST", "/uploads"),
    ("PATCH", "/uploads/{id}"),
    ("DELETE", "/uploads/{id}"),
)
"""Requests of every role beside reading: work on photos, which changes nothing that others see."""
VERIFIERS_WRITE = (
    ("POST", "/layout/results/{id}/feedback"),
    ("DELETE", "/layout/results/{id}/feedback"),
    ("POST", "/layout/results/{id}/claim"),
    ("POST", "/layout/results/{id}/release"),
    ("POST", "/layout/results/{id}/skip"),
    ("DELETE", "/layout/results/{id}"),
    ("POST", "/layout/models/{name}/samples"),
    ("POST", "/layout/proposals"),
)
"""Requests of verifiers and admins. Everything else that writes is for admins."""
NOT_FOR_READERS = frozenset({"/audit"})


class InvalidKeys(ValueError):
    """The configured keys cannot be used; the message says why, and what to do."""


class RoleForbids(DocumentError):
    """The role of the request's key does not include this request."""

    code = "forbidden"


@dataclass(frozen=True, slots=True)
class Key:
    """An API key. `role` None: it may send all requests, and sees what keys of its name have made.

    The key itself is not kept; `digest` is its SHA-256 in hexadecimal.
    """

    name: str
    role: Role | None
    digest: str


def read_keys_file(path: Path) -> list[Key]:
    """Keys of the file, at least one.

    Raises
    ------
    InvalidKeys
        When the file cannot be read, has a wrong line, the same key twice, or no key.
    """
    try:
        with path.open("rb") as file:
            text = file.read(MOST_FILE_BYTES + 1).decode("utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InvalidKeys(f"API_KEYS_FILE cannot be read: {error}") from error
    if len(text) > MOST_FILE_BYTES:
        raise InvalidKeys(f"API_KEYS_FILE has more than {MOST_FILE_BYTES} bytes")
    keys: dict[str, Key] = {}
    for number, line in enumerate(text.splitlines(), 1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        match = _LINE.fullmatch(line.strip())
        if match is None or match[2] not in ROLES:
            raise InvalidKeys(
                f"line {number} of API_KEYS_FILE: expected NAME ROLE DIGEST, the role one of {', '.join(ROLES)}, the "
                "digest of 64 hexadecimal digits (python -m app.roles NAME ROLE makes a line)"
            )
        if match[3] in keys:
            raise InvalidKeys(
                f"line {number} of API_KEYS_FILE: this digest is in the file already, as {keys[match[3]].name}; "
                "remove one of the lines"
            )
        keys[match[3]] = Key(match[1], cast(Role, match[2]), match[3])
    if not keys:
        raise InvalidKeys(
            "API_KEYS_FILE holds no key, and without keys everybody could use the service: add a line (python -m "
            "app.roles NAME ROLE makes one), or unset API_KEYS_FILE"
        )
    return list(keys.values())


def digest_of_key(key: bytes) -> str:
    """The digest by which the file knows a key."""
    return hashlib.sha256(key).hexdigest()


class RoleRules:
    """Middleware behind the check of keys: refuses what the role of the request's key does not include.

    Keys of API_KEYS have no role, or are admins: they may send all requests.
    """

    def __init__(self, app: ASGIApp) -> None:
        self.app = app
        self._allowed: Mapping[Role, list[tuple[str, re.Pattern[str]]]] = {
            "reader": _patterns(READERS_WRITE),
            "verifier": _patterns((*READERS_WRITE, *VERIFIERS_WRITE)),
        }

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        role: Role | None = scope.get("state", {}).get("role") if scope["type"] == "http" else None
        if role is not None and role in self._allowed and not self._may(role, scope["method"], scope["path"]):
            needed = "verifier" if self._may("verifier", scope["method"], scope["path"]) else "admin"
            raise RoleForbids(
                f"This key has the role {role}. This request needs a key with the role {needed}."
            )
        await self.app(scope, receive, send)

    def _may(self, role: Role, method: str, path: str) -> bool:
        if method in _SAFE:
            return role != "reader" or path not in NOT_FOR_READERS
        return any(method == allowed and pattern.fullmatch(path) for allowed, pattern in self._allowed[role])


def _patterns(requests: tuple[tuple[str, str], ...]) -> list[tuple[str, re.Pattern[str]]]:
    return [(method, compile_path(template)[0]) for method, template in requests]


def main(arguments: list[str]) -> int:
    """Print a new key and its line of the file."""
    if (
        len(arguments) != 2
        or not _LINE.fullmatch(f"{arguments[0]} {arguments[1]} {'0' * 64}")
        or arguments[1] not in ROLES
    ):
        print(f"usage: python -m app.roles NAME {{{','.join(ROLES)}}}", file=sys.stderr)
        return 2
    key = secrets.token_urlsafe(32)
    print(f"key, for {arguments[0]} only: {key}")
    print(f"line of API_KEYS_FILE: {arguments[0]} {arguments[1]} {digest_of_key(key.encode())}")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

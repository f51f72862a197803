"""Short-lived tokens that allow to read, for links that cannot have an API key.

A token is signed with a secret of the store, which all processes share. Neither a key nor a line of API_KEYS_FILE is
enough to make one. It is valid as long as the key that it was made with.
"""

import base64
import hmac
import struct
import time
from collections.abc import Callable, Iterable
from contextlib import suppress

from app.roles import Key
from models.records import CLOCKS_DIFFER_S
from services.errors import DocumentError

SECRET = "tokens"
"""Name of the secret in the store."""
_PURPOSE = b"document-rectification token 2"
_MAC_BYTES = 16


class InvalidToken(DocumentError):
    """The token was not made here, has expired, or its key is no longer valid."""

    code = "forbidden"


class Tokens:
    """Makes and judges tokens; both need the secret, which `use` brings when the store is open."""

    def __init__(self, ttl_s: int, clock: Callable[[], float] = time.time) -> None:
        self._ttl_s = ttl_s
        self._clock = clock
        self._secret = b""

    def use(self, secret: bytes) -> None:
        """Sign with this secret from here on."""
        self._secret = secret

    def make(self, key: Key) -> tuple[str, int]:
        """A token that allows to read with `key`, and when it expires (seconds since 1970)."""
        expires_s = int(self._clock()) + self._ttl_s
        body = struct.pack(">Q", expires_s)
        token = base64.urlsafe_b64encode(body + self._signature(key, body)).decode("ascii").rstrip("=")
        return token, expires_s

    def key_of(self, token: str, keys: Iterable[Key]) -> Key:
        """That of the `keys` with which `token` was made.

        Raises
        ------
        InvalidToken
            When it is none of them, the token has expired, or it would be valid for longer than tokens are.
        """
        data = b""
        with suppress(ValueError):
            data = base64.urlsafe_b64decode(token.encode("ascii", "replace") + b"=" * (-len(token) % 4))
        body, signature = data[:8], data[8:]
        signers = [key for key in keys if hmac.compare_digest(self._signature(key, body), signature)]
        now_s = self._clock()
        if (
            not self._secret
            or not signers
            or len(body) != 8
            or _expiry(body) > now_s + self._ttl_s + CLOCKS_DIFFER_S
        ):
            raise InvalidToken("The token is not valid. Get a new one with POST /tokens.")
        if _expiry(body) <= now_s:
            raise InvalidToken("The token has expired. Get a new one with POST /tokens.")
        return signers[0]

    def _signature(self, key: Key, body: bytes) -> bytes:
        return hmac.digest(self._secret, _PURPOSE + key.digest.encode() + body, "sha256")[:_MAC_BYTES]


def _expiry(body: bytes) -> int:
    return int(struct.unpack(">Q", body)[0])

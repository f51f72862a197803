"""Conversion of documents (JSON-compatible dicts, opaque to the store) to bytes and back.

Documents are compact JSON, compressed by zlib, since every version of a model is kept. A layout graph model with 12
labels has 75 kB of JSON. Compression takes 0.6 ms and leaves 17 kB.
"""

import hashlib
import json
import zlib
from collections.abc import Mapping
from typing import TypeVar, cast

from models.errors import NotStorable, StoreDamaged

Document = Mapping[str, object]
T = TypeVar("T")

MAX_DOCUMENT_BYTES = 64 * 2**20
"""Bytes of JSON before compression. The limits for users are much lower."""
_LEVEL = 3
"""Level of zlib. Level 1 gives 12 % more bytes; level 6 takes twice the time for 7 % fewer bytes."""


def encode_document(document: Document) -> bytes:
    """The document as bytes. Raises `NotStorable` when it is too large or not JSON (NaN is not JSON)."""
    return zlib.compress(_to_json(document, sort_keys=False), _LEVEL)


def decode_document(stored: bytes, shape: type[T]) -> T:
    """The document, with the same key order and numbers; that it has this `shape` is known of its column, not checked.

    Raises `StoreDamaged` when the bytes are no document.
    """
    return decode_measured(stored, shape)[0]


def decode_measured(stored: bytes, _: type[T]) -> tuple[T, int]:
    """The same, and its bytes of JSON."""
    try:
        unpacker = zlib.decompressobj()
        text = unpacker.decompress(stored, MAX_DOCUMENT_BYTES)
        document = json.loads(text.decode("utf-8", "surrogatepass"))
    except (zlib.error, ValueError, RecursionError) as error:
        raise StoreDamaged(f"a stored document cannot be read: {error}") from error
    if not unpacker.eof or not isinstance(document, dict):
        raise StoreDamaged("a stored document is cut off")
    return cast(T, document), len(text)


def digest_document(document: Document) -> str:
    """SHA-256 in hexadecimal digits. The order of keys does not change it."""
    return hashlib.sha256(_to_json(document, sort_keys=True)).hexdigest()


def _to_json(document: Document, *, sort_keys: bool) -> bytes:
    try:
        text = json.dumps(
            document, separators=(",", ":"), ensure_ascii=False, allow_nan=False, sort_keys=sort_keys
        )
    except (TypeError, ValueError, RecursionError) as error:
        raise NotStorable(f"the document is not JSON: {error}") from error
    # JSON allows a lone surrogate ("\ud800"); it is restored without change.
    encoded = text.encode("utf-8", "surrogatepass")
    if len(encoded) > MAX_DOCUMENT_BYTES:
        raise NotStorable(
            f"the document has {len(encoded)} bytes of JSON; {MAX_DOCUMENT_BYTES} can be stored"
        )
    return encoded

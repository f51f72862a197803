"""Where bytes lie that are too large for the database: a folder, or a bucket of S3, Google Cloud or Azure.

Keys are paths such as `jobs/01HX.../input`. A blob is there wholly or not at all. The calls block, so that servers make
them in threads.

obstore talks to buckets. It is given bytes and files only: its asynchronous calls abort the interpreter when that exits
soon after, and a call that reads from a Python iterator once waited without end. So the folder needs no library.
"""

import os
import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import IO, Protocol

import obstore
from obstore.exceptions import BaseError
from obstore.store import from_url

from models.errors import NotFound, NotStorable, StoreUnavailable
from models.private_files import make_folder, narrow

PART_BYTES = 5 << 20
"""Bytes that are in memory while a blob is written or read; S3 takes no smaller parts of one upload."""
_RETRIES = {"max_retries": 3, "retry_timeout": timedelta(seconds=15)}
"""Of requests to a bucket; the library's own limit is three minutes."""
_REQUESTS = {"connect_timeout": "5s", "timeout": "20s"}
_ALLOW_HTTP = "AWS_ALLOW_HTTP"
_PROBE = "probe"
_UNFINISHED = ".unfinished"
"""Ending of files that are still being written."""


class BlobNotFound(NotFound):
    """There is no blob under this key."""


class BlobTooLarge(NotStorable):
    """A blob has more bytes than the caller allows."""

    code = "too-large"


class Blobs:
    """Blobs by key. All methods raise `StoreUnavailable` when the folder or the bucket cannot be used."""

    def __init__(self, url: str, folder: Path) -> None:
        """Open the bucket of `url` (s3://bucket/prefix, gs://..., az://...); without one, `folder`.

        The bucket's credentials and address come from the usual variables of the environment (AWS_ACCESS_KEY_ID,
        AWS_ENDPOINT_URL, and so on).

        Raises
        ------
        StoreUnavailable
            When the URL is not one of a known store, or the folder cannot be made.
        """
        with _store_errors():
            self._place: _Place = _Bucket(url) if url else _Folder(folder)

    def put(self, key: str, content: bytes | Iterable[bytes], most_bytes: int) -> int:
        """Write a blob and return its number of bytes. A blob that exists is replaced.

        Of many parts at most `PART_BYTES` are in memory. When the call fails, no blob is left.

        Raises
        ------
        BlobTooLarge
            When the content has more than `most_bytes` bytes.
        """
        parts = _Bounded([content] if isinstance(content, bytes) else content, most_bytes)
        with _store_errors():
            self._place.write(key, iter(parts))
        return parts.size

    def get(self, key: str) -> bytes:
        """The content of a blob. Raises `BlobNotFound`."""
        return b"".join(self.read(key))

    def read(self, key: str) -> Iterator[bytes]:
        """Yield the parts of a blob, each of about `PART_BYTES`. Raises `BlobNotFound`."""
        with _store_errors(key):
            yield from self._place.read(key)

    def delete(self, *keys: str) -> None:
        """Delete blobs; those that do not exist are ignored."""
        for key in keys:
            with suppress(BlobNotFound), _store_errors(key):
                self._place.delete(key)

    def sweep(self, prefix: str, before: datetime, is_wanted: Callable[[str], bool]) -> int:
        """Delete the blobs under `prefix` that were written before an aware time and are not wanted; their number.

        `prefix` is a whole name of a path, as `jobs`. Unfinished blobs of that age are deleted too.
        """
        gone = 0
        with _store_errors():
            for key, written in self._place.list(prefix):
                if written < before and not is_wanted(key):
                    self.delete(key)
                    gone += 1
        return gone

    def check(self) -> None:
        """Return when a blob can be written now."""
        with _store_errors():
            self._place.check()


class _Place(Protocol):
    def write(self, key: str, parts: Iterator[bytes]) -> None: ...
    def read(self, key: str) -> Iterator[bytes]: ...
    def delete(self, key: str) -> None: ...
    def list(self, prefix: str) -> Iterator[tuple[str, datetime]]: ...
    def check(self) -> None: ...


class _Folder:
    """Blobs as files, which are on the disk before `write` returns."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder.absolute()
        make_folder(self._folder)
        narrow(self._folder)

    def write(self, key: str, parts: Iterator[bytes]) -> None:
        path = self._folder / key
        self._require_folder()
        while True:
            path.parent.mkdir(parents=True, exist_ok=True)
            with suppress(FileNotFoundError):  # `delete` removed the folder at this moment
                descriptor, name = tempfile.mkstemp(_UNFINISHED, dir=path.parent)
                break
        try:
            with os.fdopen(descriptor, "wb", buffering=0) as file:
                for part in parts:
                    _write_all(file, part)
                os.fsync(descriptor)
            Path(name).replace(path)
        except BaseException:
            Path(name).unlink(missing_ok=True)
            self._remove_empty(path.parent)
            raise
        _sync_folder(path.parent)

    def read(self, key: str) -> Iterator[bytes]:
        self._require_folder()
        with (self._folder / key).open("rb", buffering=0) as file:
            while part := file.read(PART_BYTES):
                yield part

    def delete(self, key: str) -> None:
        self._require_folder()
        path = self._folder / key
        path.unlink()
        self._remove_empty(path.parent)

    def _require_folder(self) -> None:
        """Without the folder nothing is known of a blob; without its file there is none."""
        if not self._folder.is_dir():
            raise OSError(f"the folder {self._folder} is gone")

    def _remove_empty(self, folder: Path) -> None:
        if folder != self._folder:
            with suppress(OSError):
                folder.rmdir()

    def list(self, prefix: str) -> Iterator[tuple[str, datetime]]:
        for folder, _, names in os.walk(self._folder / prefix):
            for path in (Path(folder) / name for name in names):
                with suppress(FileNotFoundError):
                    written = datetime.fromtimestamp(path.stat().st_mtime, UTC)
                    yield str(path.relative_to(self._folder)), written

    def check(self) -> None:
        if not os.access(self._folder, os.R_OK | os.W_OK | os.X_OK):
            raise OSError(f"the folder {self._folder} cannot be written")


class _Bucket:
    def __init__(self, url: str) -> None:
        # The library takes this option from the environment only where no others are given.
        allow_http = os.environ.get(_ALLOW_HTTP, "").lower() in ("1", "true", "yes", "on")
        options = {**_REQUESTS, "allow_http": allow_http}
        # The library declares one signature for each kind of store.
        self._store = from_url(url, retry_config=_RETRIES, client_options=options)  # type: ignore[call-overload]

    def write(self, key: str, parts: Iterator[bytes]) -> None:
        """A small blob is one request. A larger one is an upload in parts, which the library aborts on failure."""
        with tempfile.NamedTemporaryFile(buffering=0) as file:
            for part in parts:
                _write_all(file, part)
            size = file.tell()
            file.seek(0)
            content = file.read() if size <= PART_BYTES else Path(file.name)
            obstore.put(self._store, key, content, chunk_size=PART_BYTES, max_concurrency=2)

    def read(self, key: str) -> Iterator[bytes]:
        for part in obstore.get(self._store, key).stream(min_chunk_size=PART_BYTES):
            yield bytes(part)

    def delete(self, key: str) -> None:
        obstore.delete(self._store, key)

    def list(self, prefix: str) -> Iterator[tuple[str, datetime]]:
        for page in obstore.list(self._store, prefix):
            for blob in page:
                yield blob["path"], blob["last_modified"]

    def check(self) -> None:
        obstore.put(self._store, _PROBE, b"", use_multipart=False)


class _Bounded:
    """Yields parts, and raises `BlobTooLarge` when they are too many bytes; `size` is what has passed."""

    def __init__(self, parts: Iterable[bytes], most_bytes: int) -> None:
        self._parts = parts
        self._most_bytes = most_bytes
        self.size = 0

    def __iter__(self) -> Iterator[bytes]:
        for part in self._parts:
            self.size += len(part)
            if self.size > self._most_bytes:
                raise BlobTooLarge(f"this may have {self._most_bytes} bytes")
            yield part


@contextmanager
def _store_errors(key: str = "") -> Iterator[None]:
    """Convert errors of the library and the disk; `key` is what is read or deleted."""
    try:
        yield
    except FileNotFoundError as error:
        if not key:
            raise StoreUnavailable(f"the store of blobs cannot be used: {_first_line(error)}") from error
        raise BlobNotFound(f"there is no blob {key!r}", key) from error
    except (BaseError, OSError, ValueError) as error:
        raise StoreUnavailable(f"the store of blobs cannot be used: {_first_line(error)}") from error


def _write_all(file: IO[bytes], part: bytes) -> None:
    view = memoryview(part)
    while view:
        view = view[file.write(view) :]


def _sync_folder(folder: Path) -> None:
    """Return when the names in the folder are on the disk."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _first_line(error: BaseException) -> str:
    """The library appends its internal state to its messages, in further lines."""
    return str(error).partition("\n")[0]

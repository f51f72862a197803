"""Pages of a document in a file, each as soon as it is done.

A worker that works for too long is killed, also where native code does not return. What it has written here is what is
left of its work, so that another worker can answer the pages that were done.
"""

import pickle
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

from services.errors import DocumentError
from services.operations.pages_reply import EncodedPage, PagesTarget

_LENGTH_BYTES = 8


@dataclass(frozen=True, slots=True)
class SourceName:
    """An uploaded page as errors call it, and the part of the request that it came in."""

    label: str
    field: str | None


@dataclass(frozen=True, slots=True, eq=False)
class SourceOutcome:
    """What became of one uploaded page: its flat pages (two of an opened book), or why there are none."""

    pages: tuple[EncodedPage, ...] = ()
    error: DocumentError | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Entry:
    """One uploaded page that is done; `target` and `timings_ms` are those of the answer so far."""

    outcome: SourceOutcome
    target: PagesTarget | None
    timings_ms: dict[str, float]


class PageJournal:
    """The file at `path`, which is empty at first; without a path nothing is written, and nothing is there."""

    def __init__(self, path: str) -> None:
        self._path = path

    def begin(self, names: list[SourceName]) -> None:
        """Write the names of all pages."""
        self._write(names)

    def add(self, entry: Entry) -> None:
        """Write that one more page is done."""
        self._write(entry)

    def read(self) -> tuple[list[SourceName], list[Entry]]:
        """The names of all pages, and those that are done, without what a killed worker has written in part.

        What is written next follows the whole ones.
        """
        if not self._path:
            return [], []
        with Path(self._path).open("r+b") as file:
            names, *entries = [*_whole_records(file)] or [[]]
            file.truncate()
        return names, entries

    def _write(self, record: object) -> None:
        if self._path:
            data = pickle.dumps(record)
            with Path(self._path).open("ab") as file:
                file.write(len(data).to_bytes(_LENGTH_BYTES) + data)


def _whole_records(file: IO[bytes]) -> Iterator[Any]:
    """Yield the records; at the end the position of the file is behind the last whole one."""
    while True:
        begin = file.tell()
        head = file.read(_LENGTH_BYTES)
        length = int.from_bytes(head)
        data = file.read(length)
        if len(head) < _LENGTH_BYTES or len(data) < length:
            file.seek(begin)
            return
        yield pickle.loads(data)

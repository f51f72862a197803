"""Uploaded ZIP archives: their files one at a time, each and all together within a limit of bytes."""

import asyncio
import io
import threading
import zlib
from dataclasses import dataclass
from typing import IO

from app.http.zip_directory import ArchivedFile, begin_of, read_directory
from services.errors import InvalidOption, TooLarge

MOST_FILES = 5000
"""Files of one archive; 1000 samples with their images are 2000."""
OF_ONE_FILE = frozenset(
    {
        "invalid-option",
        "invalid-model",
        "too-large",
        "not-storable",
        "store-full",
        "unsupported-media-type",
        "undecodable-image",
        "out-of-memory",
        "timed-out",
        "worker-died",
        "internal",
    }
)
"""Codes of errors about one file of an archive, which do not stop the others."""
_MOST_NAME = 200
"""Characters of a file's name in a report about thousands of files."""
_MOST_DETAIL = 500
"""Characters of a problem's detail there."""
_PROGRAMS = (".DS_Store", "Thumbs.db", "desktop.ini")
"""Files that file managers add."""
_PIECE_BYTES = 2**16


class UploadedArchive:
    """A ZIP archive that a client has sent. Its calls read files, so that servers make them in threads."""

    def __init__(self, file: IO[bytes], field: str, most_bytes: int, most_files: int = MOST_FILES) -> None:
        """Read the directory of the archive in `file`, which the form's part `field` holds.

        Raises
        ------
        InvalidOption, TooLarge
            As `read_directory` raises them.
        """
        self._file, self._field = file, field
        self._turn = threading.Lock()
        self._files = read_directory(file, field, most_files, most_bytes)

    def files(self) -> list[ArchivedFile]:
        """All files, in the archive's order, without those that file managers add."""
        return [
            file
            for file in self._files.values()
            if "__MACOSX" not in file.place.parts and file.place.name not in _PROGRAMS
        ]

    def __contains__(self, path: str) -> bool:
        """Whether the archive has this file."""
        return path in self._files

    def read(self, path: str, most_bytes: int) -> bytes:
        """The content of a file. The caller says which file an error is about.

        Raises
        ------
        TooLarge
            When it has more than `most_bytes`.
        InvalidOption
            When it is damaged: its bytes do not inflate to the size and the checksum that the directory states.
        """
        entry = self._files[path]
        if entry.size > most_bytes:
            raise TooLarge(f"A file of the archive may have {most_bytes} bytes.", self._field)
        try:
            with self._turn:
                content = _content(self._file, entry)
        except (zlib.error, ValueError, OSError) as error:
            raise InvalidOption("This file of the archive is damaged; pack it again.", self._field) from error
        return content


@dataclass(frozen=True, slots=True)
class SpooledFile:
    """A file of an archive, for a worker: it is inflated when a worker is free (`app.engine.base.Spooled`)."""

    archive: UploadedArchive
    path: str
    most_bytes: int

    async def read(self) -> bytes:
        """The content; raises as `UploadedArchive.read`."""
        return await asyncio.to_thread(self.archive.read, self.path, self.most_bytes)


def shown_name(path: str) -> str:
    """The path of a file as a report has it: at most 200 characters."""
    return _cut(path, _MOST_NAME)


def shown_detail(detail: str) -> str:
    """What is wrong with a file as a report has it: at most 500 characters."""
    return _cut(detail, _MOST_DETAIL)


def _cut(text: str, most: int) -> str:
    return text if len(text) <= most else f"{text[: most - 1]}…"


def _content(file: IO[bytes], entry: ArchivedFile) -> bytes:
    """The inflated bytes. Raises ValueError or zlib.error when they are not what the directory states."""
    file.seek(begin_of(file, entry))
    inflater = zlib.decompressobj(-zlib.MAX_WBITS) if entry.is_deflated else None
    content, left = io.BytesIO(), entry.packed_bytes
    while left > 0 and (piece := file.read(min(_PIECE_BYTES, left))):
        left -= len(piece)
        if inflater is not None:
            piece = inflater.decompress(piece, entry.size - content.tell() + 1)
        content.write(piece)
        if content.tell() > entry.size:
            raise ValueError("the file is larger than stated")
    whole = content.getvalue()
    if len(whole) != entry.size or zlib.crc32(whole) != entry.crc:
        raise ValueError("the file is not the one that was packed")
    return whole

"""Uploaded ZIP archives: their files one at a time, each within a limit of bytes."""

import zipfile
import zlib
from dataclasses import dataclass
from pathlib import PurePosixPath
from typing import IO

from services.errors import InvalidOption, TooLarge

MOST_FILES = 5000
"""Files of one archive; 1000 samples with their images are 2000."""
_PROGRAMS = (".DS_Store", "Thumbs.db", "desktop.ini")
"""Files that file managers add."""


@dataclass(frozen=True, slots=True)
class ArchivedFile:
    """A file of an archive: its path there, and its path without the extension and in small letters the extension."""

    path: str
    stem: str
    suffix: str
    size: int


class UploadedArchive:
    """A ZIP archive that a client has sent. Its calls read files, so that servers make them in threads."""

    def __init__(self, file: IO[bytes], field: str, most_files: int = MOST_FILES) -> None:
        """Open the archive in `file`, which the form's part `field` holds.

        Raises
        ------
        InvalidOption
            When it is no ZIP archive, or is damaged.
        TooLarge
            When it has more than `most_files` files.
        """
        self._field = field
        try:
            self._archive = zipfile.ZipFile(file)
        except (zipfile.BadZipFile, OSError, ValueError, NotImplementedError) as error:
            raise InvalidOption(f"{field}: this is not a ZIP archive; send one.", field) from error
        entries = [entry for entry in self._archive.infolist() if not entry.is_dir()]
        if len(entries) > MOST_FILES:
            raise TooLarge(
                f"{field}: the archive has {len(entries)} files; the limit is {MOST_FILES}.", field
            )
        self._entries = {entry.filename: entry for entry in entries}

    def files(self) -> list[ArchivedFile]:
        """All files, in the archive's order, without those that file managers add."""
        found = []
        for entry in self._entries.values():
            path = PurePosixPath(entry.filename.replace("\\", "/"))
            if "__MACOSX" in path.parts or path.name in _PROGRAMS:
                continue
            suffix = path.suffix.lower()
            stem = path.name[: len(path.name) - len(suffix)]
            found.append(ArchivedFile(entry.filename, stem, suffix, entry.file_size))
        return found

    def read(self, path: str, most_bytes: int) -> bytes:
        """The content of a file.

        Raises
        ------
        TooLarge
            When it inflates to more than `most_bytes`.
        InvalidOption
            When it is damaged, or has a password.
        """
        try:
            with self._archive.open(self._entries[path]) as opened:
                content = opened.read(most_bytes + 1)
        except (
            zipfile.BadZipFile,
            zlib.error,
            RuntimeError,
            NotImplementedError,
            OSError,
            EOFError,
        ) as error:
            raise InvalidOption(
                f"{path}: this file of the archive cannot be read (damaged, or with a password).", self._field
            ) from error
        if len(content) > most_bytes:
            raise TooLarge(f"{path}: a file of the archive may have {most_bytes} bytes.", self._field)
        return content

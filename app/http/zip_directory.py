"""The directory of a ZIP archive, read with bounds: nothing is kept of an archive that has too much in it.

The standard library's reader keeps the whole directory, a million entries in a few megabytes, and knows methods that
inflate a kilobyte to gigabytes at once. Here entries are stored or deflated, and lie one behind another.
"""

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import PurePosixPath
from typing import IO

from services.errors import InvalidOption, TooLarge

STORED, DEFLATED = 0, 8
ENTRY_BYTES = 256
"""Mean size of an entry of the directory: 46 bytes, the path, and extra fields (times, owners)."""
MOST_NAME_BYTES = 1024
"""Of one path; a report or a refusal that names one file stays small."""
_END = struct.Struct("<4s4H2LH")
_END_MARK = b"PK\5\6"
_END_64_PLACE = struct.Struct("<4sLQL")
_END_64 = struct.Struct("<4sQ2H2L4Q")
_ENTRY = struct.Struct("<4s6H3L5H2L")
_LOCAL = struct.Struct("<4s5H3L2H")
_SIZES_64 = 1
"""Number of the extra field that holds sizes and offsets of 64 bits."""
_MOST_COMMENT_BYTES = 0xFFFF
_FULL = 0xFFFFFFFF
"""A field of 32 bits with this value says that its number is in the extra field."""
_HAS_PASSWORD, _IS_UTF8 = 0x1, 0x800


@dataclass(frozen=True, slots=True)
class ArchivedFile:
    """A file of an archive: its path there, its sizes inflated and packed, and where it begins."""

    path: str
    size: int
    packed_bytes: int
    offset: int
    crc: int
    is_deflated: bool

    @property
    def place(self) -> PurePosixPath:
        """The path; Windows separates folders by backslashes."""
        return PurePosixPath(self.path.replace("\\", "/"))

    @property
    def suffix(self) -> str:
        """The extension in small letters."""
        return self.place.suffix.lower()

    @property
    def stem(self) -> str:
        """The name without folders and extension."""
        return self.place.stem


def read_directory(file: IO[bytes], field: str, most_files: int, most_bytes: int) -> dict[str, ArchivedFile]:
    """The files of the archive by their paths, in its order.

    Raises
    ------
    InvalidOption
        When this is no ZIP archive, its directory is damaged, two files have one path or share bytes, or a file has a
        name of more than `MOST_NAME_BYTES`, a password, or is packed by another method than deflate.
    TooLarge
        When there are more than `most_files` files, or they have more than `most_bytes` together when inflated.
    """
    try:
        begin, size = _place_of_directory(file)
        if size > most_files * ENTRY_BYTES:
            raise TooLarge(
                f"{field}: the archive's directory has {size} bytes; the limit is {most_files * ENTRY_BYTES}, for "
                f"{most_files} files.",
                field,
            )
        files: dict[str, ArchivedFile] = {}
        inflated_bytes = 0
        for entry in _entries(file, begin, size):
            if entry.path in files:
                raise InvalidOption(f"{field}: the archive has two files {entry.path[:200]!r}.", field)
            files[entry.path] = entry
            inflated_bytes += entry.size
            if len(files) > most_files:
                raise TooLarge(f"{field}: an archive may have {most_files} files.", field)
            if inflated_bytes > most_bytes:
                raise TooLarge(
                    f"{field}: the files of an archive may have {most_bytes} bytes together when they are inflated "
                    "(MAX_ARCHIVE_BYTES).",
                    field,
                )
        _check_places(files, begin)
    except _Unsupported as error:
        raise InvalidOption(f"{field}: {error}", field) from error
    except (_Damaged, struct.error) as error:
        raise InvalidOption(
            f"{field}: this is not a ZIP archive, or it is damaged; send one.", field
        ) from error
    return files


def begin_of(file: IO[bytes], entry: ArchivedFile) -> int:
    """Where the bytes of an entry begin. Raises ValueError when its own header is not there."""
    file.seek(entry.offset)
    try:
        header = _LOCAL.unpack(file.read(_LOCAL.size))
    except struct.error as error:
        raise ValueError("the archive ends within a header") from error
    if header[0] != b"PK\3\4":
        raise ValueError("there is no header of a file")
    return entry.offset + _LOCAL.size + int(header[9]) + int(header[10])


class _Damaged(Exception):
    """The directory is not that of an archive."""


class _Unsupported(Exception):
    """What an archive may not have."""


def _place_of_directory(file: IO[bytes]) -> tuple[int, int]:
    """Offset and size of the directory, both within the file.

    The mark of its end may also be in the archive's comment. The record whose comment ends with the file is the one;
    of several the first, since a comment may hold a whole record.
    """
    end = file.seek(0, 2)
    tail_begin = max(0, end - _END.size - _MOST_COMMENT_BYTES)
    file.seek(tail_begin)
    tail = file.read()
    place = tail.find(_END_MARK)
    while place >= 0:
        _, _, _, _, entries, size, begin, comment_bytes = _END.unpack_from(tail, place)
        if place + _END.size + comment_bytes == len(tail):
            break
        place = tail.find(_END_MARK, place + 1)
    else:
        raise _Damaged
    end = tail_begin + place
    if entries == 0xFFFF or _FULL in (size, begin):
        end, size, begin = _place_by_64_bits(file, end, size, begin)
    if begin + size > end:
        raise _Damaged
    return begin, size


def _place_by_64_bits(file: IO[bytes], end: int, size: int, begin: int) -> tuple[int, int, int]:
    """Where the directory must end, its size and its offset, of archives that need or use 64 bits."""
    if end < _END_64_PLACE.size:
        raise _Damaged
    file.seek(end - _END_64_PLACE.size)
    mark, _, place, _ = _END_64_PLACE.unpack(file.read(_END_64_PLACE.size))
    if mark != b"PK\6\7":
        return end, size, begin
    if place > end:
        raise _Damaged
    file.seek(place)
    record = _END_64.unpack(file.read(_END_64.size))
    if record[0] != b"PK\6\6":
        raise _Damaged
    return place, record[8], record[9]


def _entries(file: IO[bytes], begin: int, size: int) -> Iterator[ArchivedFile]:
    """The files in the directory, without folders."""
    file.seek(begin)
    left = size
    while left > 0:
        header = _ENTRY.unpack(file.read(_ENTRY.size))
        name_bytes, extra_bytes, comment_bytes = header[10:13]
        left -= _ENTRY.size + name_bytes + extra_bytes + comment_bytes
        if header[0] != b"PK\1\2" or left < 0:
            raise _Damaged
        if name_bytes > MOST_NAME_BYTES:
            raise _Unsupported(f"the name of a file may have {MOST_NAME_BYTES} bytes.")
        rest = file.read(name_bytes + extra_bytes + comment_bytes)
        path = _path_of(rest[:name_bytes], is_utf8=bool(header[3] & _IS_UTF8))
        if path.endswith("/"):
            continue
        if header[3] & _HAS_PASSWORD:
            raise _Unsupported(f"{path[:200]!r} has a password; send an archive without one.")
        if header[4] not in (STORED, DEFLATED):
            raise _Unsupported(
                f"{path[:200]!r} is neither stored nor deflated; pack the archive with deflate."
            )
        sizes = _numbers(header[9], header[8], header[16], rest[name_bytes : name_bytes + extra_bytes])
        yield ArchivedFile(path, *sizes, crc=header[7], is_deflated=header[4] == DEFLATED)


def _path_of(name: bytes, *, is_utf8: bool) -> str:
    try:
        path = name.decode("utf-8" if is_utf8 else "cp437")
    except UnicodeDecodeError as error:
        raise _Unsupported("the name of a file is not UTF-8, as the archive says.") from error
    if not path or "\0" in path:
        raise _Unsupported("a file has no name, or one with a zero byte.")
    return path


def _numbers(size: int, packed_bytes: int, offset: int, extra: bytes) -> tuple[int, int, int]:
    """Size, packed size and offset of a file; those that are full are in the extra field, in this order."""
    numbers = [size, packed_bytes, offset]
    if _FULL not in numbers:
        return size, packed_bytes, offset
    place = 0
    while place + 4 <= len(extra):
        kind, length = struct.unpack_from("<HH", extra, place)
        place += 4
        if kind == _SIZES_64:
            for which in [index for index, number in enumerate(numbers) if number == _FULL]:
                (numbers[which],) = struct.unpack_from("<Q", extra, place)
                place += 8
            return numbers[0], numbers[1], numbers[2]
        place += length
    raise _Damaged


def _check_places(files: dict[str, ArchivedFile], end: int) -> None:
    """Raise when a file reaches into another one, or into the directory at `end`.

    Files that share bytes let a small archive inflate to the product of both.
    """
    free_from = 0
    for entry in sorted(files.values(), key=lambda entry: entry.offset):
        if entry.offset < free_from:
            raise _Damaged
        free_from = entry.offset + _LOCAL.size + entry.packed_bytes
    if free_from > end:
        raise _Damaged

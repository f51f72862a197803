"""ZIP archives that cost, lie or are damaged, and seeded mutations of good ones."""

import io
import random
import struct
import warnings
import zipfile
from collections.abc import Iterable

DIRECTORY = b"PK\1\2"
END = b"PK\5\6"


def packed(files: Iterable[tuple[str, bytes]], method: int = zipfile.ZIP_DEFLATED) -> bytes:
    """An archive of these files; a path may come twice."""
    buffer = io.BytesIO()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # about a path that comes twice
        with zipfile.ZipFile(buffer, "w", method) as archive:
            for path, content in files:
                archive.writestr(path, content)
    return buffer.getvalue()


def streamed(files: Iterable[tuple[str, bytes]]) -> bytes:
    """An archive as a program writes it into a pipe: sizes follow the files, with 64 bits."""

    class Pipe(io.BytesIO):
        def seekable(self) -> bool:
            return False

        def tell(self) -> int:
            raise OSError

        def seek(self, offset: int, whence: int = 0) -> int:
            raise OSError

    buffer = Pipe()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for path, content in files:
            with archive.open(path, "w", force_zip64=True) as opened:
                opened.write(content)
    return buffer.getvalue()


def with_directory(archive: bytes, entries: Iterable[bytes]) -> bytes:
    """The archive with another directory in place of its own."""
    begin = archive.index(DIRECTORY)
    directory = b"".join(entries)
    count = min(0xFFFF, len(directory) // 46)
    return (
        archive[:begin]
        + directory
        + struct.pack("<4s4H2LH", END, 0, 0, count, count, len(directory), begin, 0)
    )


def entry(
    path: bytes, *, flags: int = 0, method: int = 0, sizes: tuple[int, int] = (0, 0), offset: int = 0
) -> bytes:
    """An entry of a directory; `sizes` are packed and inflated."""
    head = struct.pack(
        "<4s6H3L5H2L", DIRECTORY, 20, 20, flags, method, 0, 33, 0, *sizes, len(path), 0, 0, 0, 0, 0, offset
    )
    return head + path


def mutated(archive: bytes, seed: int) -> bytes:
    """The archive with one to four changes; of those that are near a header more than elsewhere."""
    chance = random.Random(seed)
    data = bytearray(archive)
    headers = [place for place in range(len(data) - 1) if data[place : place + 2] == b"PK"]
    for _ in range(chance.randint(1, 4)):
        place = (
            chance.choice(headers) + chance.randrange(60)
            if chance.random() < 0.7
            else chance.randrange(len(data))
        )
        place = min(place, len(data) - 1)
        match chance.randrange(6):
            case 0:
                data[place] ^= 1 << chance.randrange(8)
            case 1:
                number = chance.choice((0, 1, 12, 14, 0x7FFF, 0xFFFF))
                data[place : place + 2] = struct.pack("<H", number)
            case 2:
                number = chance.choice((0, 1, 2**31 - 1, 2**32 - 1, len(data), chance.randrange(2**32)))
                data[place : place + 4] = struct.pack("<L", number)
            case 3:
                del data[place : place + chance.randint(1, 40)]
            case 4:
                data[place:place] = data[max(0, place - 50) : place]
            case _:
                data[place] = chance.randrange(256)
        data = data or bytearray(1)
    return bytes(data)

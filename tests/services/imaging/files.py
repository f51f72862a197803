"""Image files made by hand, byte by byte where Pillow cannot write what a test needs."""

import io
import struct
import zlib

import numpy as np
from numpy.typing import NDArray
from PIL import Image


def make_file(pixels: NDArray[np.generic], plugin: str, **options: object) -> bytes:
    """File of an array, written by the Pillow plugin of that name."""
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, plugin, **options)
    return buffer.getvalue()


def pack_segment(marker: int, payload: bytes) -> bytes:
    """JPEG segment FF `marker`."""
    return struct.pack(">BBH", 0xFF, marker, len(payload) + 2) + payload


def insert_segments(jpeg: bytes, segments: bytes) -> bytes:
    """JPEG file with `segments` right after its start marker."""
    return jpeg[:2] + segments + jpeg[2:]


def pack_chunk(kind: bytes, payload: bytes) -> bytes:
    """PNG chunk with its checksum."""
    return struct.pack(">I", len(payload)) + kind + payload + struct.pack(">I", zlib.crc32(kind + payload))


def make_png(
    width: int,
    height: int,
    rows: bytes,
    *,
    depth: int = 8,
    colour_type: int = 2,
    interlaced: bool = False,
    before: bytes = b"",
) -> bytes:
    """PNG whose IDAT is `rows` (already deflated); `before` are chunks that precede it."""
    header = struct.pack(">IIBBBBB", width, height, depth, colour_type, 0, 0, int(interlaced))
    chunks = pack_chunk(b"IHDR", header) + before + pack_chunk(b"IDAT", rows) + pack_chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + chunks


def pack_directory(entries: list[tuple[int, int, int, int]], order: str = "<") -> bytes:
    """TIFF header and directory of (tag, type, count, value) entries, in the order of their tags."""
    packed = bytearray()
    for tag, kind, count, value in sorted(entries):
        is_short = kind == 3 and count == 1
        packed += struct.pack(
            f"{order}HHI{'HH' if is_short else 'I'}", tag, kind, count, value, *([0] * is_short)
        )
    mark = b"II" if order == "<" else b"MM"
    return mark + struct.pack(f"{order}HIH", 42, 8, len(entries)) + bytes(packed) + bytes(4)


def make_tiff(
    width: int, height: int, strip: bytes, *, bits: int = 8, photometric: int = 1, order: str = "<"
) -> bytes:
    """Uncompressed gray TIFF of one strip."""
    entries = [(256, 4, 1, width), (257, 4, 1, height), (258, 3, 1, bits), (259, 3, 1, 1)]
    entries += [(262, 3, 1, photometric), (273, 4, 1, 0), (277, 3, 1, 1), (278, 4, 1, height)]
    entries += [(279, 4, 1, len(strip))]
    entries[5] = (273, 4, 1, len(pack_directory(entries, order)))
    return pack_directory(entries, order) + strip


def make_exif(orientation: int = 1, camera: dict[int, object] | None = None) -> Image.Exif:
    """EXIF block with an orientation and, in its Exif directory, the tags of `camera`."""
    exif = Image.Exif()
    exif[0x0112] = orientation
    exif.get_ifd(0x8769).update(camera or {})
    return exif

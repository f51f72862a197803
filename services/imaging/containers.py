"""Checks of a file's structure before it is decoded, against headers that are expensive to read.

Pillow reads headers in Python, piece by piece. Millions of tiny segments, EXIF in hundreds of segments (each copies all
earlier ones), directories of millions of entries, or progressive JPEGs of a thousand scans cost minutes for a few
megabytes. Each check here is one linear pass that stops at the first excess. The limits are far above real files.
"""

import re
import struct
import zlib
from dataclasses import dataclass

from services.errors import TooLarge, UndecodableImage

_MOST_SEGMENTS = 4096
"""Largest number of JPEG header segments, or of PNG chunks other than IDAT. Extended XMP and ICC need a few hundred."""
_MOST_SCANS = 32
"""Largest number of scans of a JPEG; the usual progressive script has 10. Every scan is a pass over all pixels."""
_MOST_PIECES = 262_144
"""Of pixel data, IDAT chunks or strips: 64 MP of 16-bit RGBA in chunks of 8 KiB (libpng's default) are 65,536."""
_MOST_DIRECTORY_ENTRIES = 1024
_MOST_VALUES = 1_048_576
"""Largest number of values of a numeric TIFF tag other than strips: a colour map of 16 bits has 196,608."""

_MOST_ENTRIES, _MOST_BYTES = 262_144, 256 * 2**20
"""Limits of all directories of a TIFF file together, because Pillow reads each with its values to reach a later page.
A thousand pages of 1200 strips have 20,000 entries and 10 MB of values."""
_TIFF_BYTES = {3: 2, 4: 4, 5: 8, 8: 2, 9: 4, 10: 8, 11: 4, 12: 8, 16: 8, 17: 8, 18: 8}
"""Bytes of a value by its type, if more than one (TIFF 6.0, section 2; BigTIFF)."""

_MOST_STRAY_BYTES = 65_536
"""Largest number of bytes between a JPEG's header segments; Pillow reads them one at a time (0.3 us each)."""

INFLATED_AT_ONCE = 1_048_576
_ADAM7_PASSES = (
    (0, 0, 8, 8),
    (4, 0, 8, 8),
    (0, 4, 4, 8),
    (2, 0, 4, 4),
    (0, 2, 2, 4),
    (1, 0, 2, 2),
    (0, 1, 1, 2),
)
"""First column and row, and steps right and down, of each pass of an interlaced PNG (8.2)."""
"""First column and row, and column and row steps, of each pass of an interlaced PNG (8.2)."""
_JPEG_MARKER = re.compile(rb"\xff[\x02-\xcf\xd8-\xfe]")
"""Next marker. Byte stuffing (FF 00), fill (FF FF), TEM and the restart markers (D0-D7) have no segment."""


@dataclass(frozen=True, slots=True)
class TiffPage:
    """A page of a TIFF file: the number of its directory, from 0, and its size in pixels."""

    directory: int
    width: int
    height: int


@dataclass(frozen=True, slots=True)
class _TiffLayout:
    """Byte order, and whether offsets have 8 bytes (BigTIFF) or 4."""

    order: str
    is_big: bool

    @property
    def offset(self) -> str:
        return "Q" if self.is_big else "I"

    @property
    def offset_bytes(self) -> int:
        return 8 if self.is_big else 4


def check_jpeg(data: bytes, max_exif_bytes: int) -> None:
    """Check the segments and scans of the first image in a JPEG file.

    Raises
    ------
    TooLarge
        When its EXIF segments together have more than `max_exif_bytes`.
    UndecodableImage
        When it has more segments, scans or stray bytes than real files.
    """
    position, segments, scans, exif_bytes, stray_bytes = 2, 0, 0, 0, 0
    while found := _JPEG_MARKER.search(data, position):
        start, marker = found.start(), data[found.start() + 1]
        if marker == 0xD9:  # EOI: later data (previews, motion photos) is not decoded
            return
        if marker == 0xD8:
            position = start + 2
            continue
        length = int.from_bytes(data[start + 2 : start + 4], "big")
        segments += 1
        stray_bytes += 0 if scans else start - position  # after the first scan these are the pixels
        scans += marker == 0xDA
        if marker == 0xE1 and data[start + 4 : start + 10] == b"Exif\0\0":
            exif_bytes += length
        check_exif_size(exif_bytes, max_exif_bytes)
        if segments > _MOST_SEGMENTS or scans > _MOST_SCANS or stray_bytes > _MOST_STRAY_BYTES:
            raise UndecodableImage(
                f"The JPEG file has more than {_MOST_SEGMENTS} segments, {_MOST_SCANS} scans or "
                f"{_MOST_STRAY_BYTES} stray bytes, which no camera or scanner writes."
            )
        position = start + 2 + max(length, 2)


def check_png(data: bytes, max_exif_bytes: int) -> None:
    """Check the chunks of a PNG file: their number, their checksums, and the presence of the last one.

    Raises
    ------
    TooLarge
        When the eXIf chunk is larger than `max_exif_bytes`.
    UndecodableImage
        When the file is truncated, the CRC of a critical chunk is wrong (Pillow does not check IDAT), or the file has
        more chunks than real files.
    """
    view = memoryview(data)
    position, others, pixel_chunks = 8, 0, 0
    while position + 12 <= len(data):
        (length,) = struct.unpack_from(">I", data, position)
        kind = data[position + 4 : position + 8]
        end = position + 12 + length
        if end > len(data):
            break
        if kind == b"IDAT":
            pixel_chunks += 1
        else:
            others += 1
        if others > _MOST_SEGMENTS or pixel_chunks > _MOST_PIECES:
            raise UndecodableImage("The PNG file has more chunks than any writer makes.")
        if kind == b"eXIf":
            check_exif_size(length, max_exif_bytes)
        is_critical = not kind[0] & 0x20  # PNG 5.4: bit 5 of the first letter
        (checksum,) = struct.unpack_from(">I", data, end - 4)
        if is_critical and zlib.crc32(view[position + 4 : end - 4]) != checksum:
            raise UndecodableImage("The PNG file is damaged: a checksum does not match.")
        if kind == b"IEND":
            return
        position = end
    raise UndecodableImage("The PNG file is truncated.")


def check_png_rows(data: bytes) -> None:
    """Raise `UndecodableImage` when a PNG that `check_png` passed holds fewer rows than its header says.

    It inflates all data (0.1 s for 12 MP), so it is used only if the decoder left the last row empty.
    """
    width, height, depth, colour_type, _, _, is_interlaced = struct.unpack_from(">IIBBBBB", data, 16)
    bits = depth * {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}[colour_type]
    needed = 0
    for left, top, right, down in _ADAM7_PASSES if is_interlaced else ((0, 0, 1, 1),):
        columns, rows = -(-(width - left) // right), -(-(height - top) // down)
        needed += rows * (1 + -(-columns * bits // 8)) if columns > 0 else 0
    inflate, position = zlib.decompressobj(), 8
    while needed > 0 and position < len(data):
        (length,) = struct.unpack_from(">I", data, position)
        packed = (
            data[position + 8 : position + 8 + length]
            if data[position + 4 : position + 8] == b"IDAT"
            else b""
        )
        while packed and needed > 0:
            needed -= len(inflate.decompress(packed, INFLATED_AT_ONCE))
            packed = inflate.unconsumed_tail
        position += 12 + length
    if needed > 0:
        raise UndecodableImage("The PNG file is truncated: rows are missing.")


def check_webp(data: bytes, max_pixels: int) -> None:
    """Check the canvas of a WebP file. Opening the file alone takes memory for two canvases.

    Raises
    ------
    TooLarge
        When the canvas has more than `max_pixels` pixels.
    UndecodableImage
        When the header contains no size.
    """
    kind, width, height = data[12:16], 0, 0
    if kind == b"VP8X" and len(data) >= 30:  # two sizes less one, 24 bits each
        width, height = (int.from_bytes(data[at : at + 3], "little") + 1 for at in (24, 27))
    elif kind == b"VP8L" and len(data) >= 25:  # two sizes less one, 14 bits each
        bits = int.from_bytes(data[21:25], "little")
        width, height = (bits & 0x3FFF) + 1, (bits >> 14 & 0x3FFF) + 1
    elif kind == b"VP8 " and len(data) >= 30:  # 14 bits each
        width, height = (int.from_bytes(data[at : at + 2], "little") & 0x3FFF for at in (26, 28))
    if width * height == 0:
        raise UndecodableImage("The WebP file is truncated or damaged: its header holds no size.")
    check_pixels(width, height, max_pixels)


def check_tiff(data: bytes, max_pixels: int) -> None:
    """Check the first directory of a TIFF or BigTIFF file.

    Raises
    ------
    UndecodableImage
        When the directory lies outside of the file, or has more entries, strips or values than real files.
    TooLarge
        When one tile has more than `max_pixels` pixels: a decoder needs memory for a whole tile even for a smaller
        image.
    """
    try:
        entries, _ = _tiff_directory(data, *_tiff_start(data))
    except struct.error:
        raise UndecodableImage("The TIFF file is truncated: its directory is not in it.") from None
    _check_tiff_entries(entries, max_pixels)


def tiff_pages(data: bytes, max_pixels: int, most: int) -> list[TiffPage]:
    """The pages of a TIFF or BigTIFF file in their order, at most `most`, without masks and reduced views.

    Raises what `check_tiff` raises, of every directory up to the last page, and what `check_pixels` raises.
    """
    pages: list[TiffPage] = []
    seen: set[int] = set()
    entries_together, bytes_together = 0, 0
    try:
        layout, offset = _tiff_start(data)
        while offset and offset not in seen and len(pages) < most:
            entries, following = _tiff_directory(data, layout, offset)
            _check_tiff_entries(entries, max_pixels)
            entries_together += len(entries)
            bytes_together += sum(count * _TIFF_BYTES.get(kind, 1) for _, kind, count, _ in entries)
            if seen and (entries_together > _MOST_ENTRIES or bytes_together > _MOST_BYTES):
                raise UndecodableImage("The TIFF file's directories are larger than any writer makes them.")
            values = {tag: value for tag, _, _, value in entries}
            # NewSubfileType: bit 0 a reduced view of another page, bit 2 a mask of one (TIFF 6.0, section 8).
            if not seen or not values.get(254, 0) & 0b101:
                width, height = values.get(256, 0), values.get(257, 0)
                check_pixels(width, height, max_pixels)
                pages.append(TiffPage(len(seen), width, height))
            seen.add(offset)
            offset = following
    except struct.error:
        raise UndecodableImage(
            f"The TIFF file is truncated: the directory of its page {len(pages) + 1} is not in it."
        ) from None
    return pages


def _check_tiff_entries(entries: list[tuple[int, int, int, int]], max_pixels: int) -> None:
    tile_width, tile_height = 1, 1
    for tag, kind, count, value in entries:
        is_bytes = kind in (1, 2, 6, 7)  # BYTE, ASCII, SBYTE, UNDEFINED: Pillow does not convert them
        if (tag in (273, 279, 324, 325) and count > _MOST_PIECES) or (not is_bytes and count > _MOST_VALUES):
            raise UndecodableImage(
                f"The TIFF file's tag {tag} has {count} values, more than any writer makes."
            )
        if tag == 322:
            tile_width = value
        elif tag == 323:
            tile_height = value
    check_pixels(tile_width, tile_height, max_pixels)


def _tiff_start(data: bytes) -> tuple[_TiffLayout, int]:
    """Byte order and offset size, and the position of the first directory (TIFF 6.0, section 2)."""
    layout = _TiffLayout("<" if data[:2] == b"II" else ">", 43 in data[2:4])
    (offset,) = struct.unpack_from(layout.order + layout.offset, data, 8 if layout.is_big else 4)
    return layout, int(offset)


def _tiff_directory(
    data: bytes, layout: _TiffLayout, offset: int
) -> tuple[list[tuple[int, int, int, int]], int]:
    """(tag, type, count, inline value) of a directory's entries, and the position of the next one (0: none)."""
    order, is_big = layout.order, layout.is_big
    if offset > len(data):
        raise struct.error("directory outside of the file")
    (count,) = struct.unpack_from(order + ("Q" if is_big else "H"), data, offset)
    if count > _MOST_DIRECTORY_ENTRIES:
        raise UndecodableImage(f"The TIFF file's directory has {count} entries, more than any writer makes.")
    offset += 8 if is_big else 2
    entry = struct.Struct(order + ("HHQ8s" if is_big else "HHI4s"))
    entries = []
    for _ in range(count):
        tag, kind, values, field = entry.unpack_from(data, offset)
        letter = {3: "H", 16: "Q"}.get(kind, "I")
        entries.append((tag, kind, values, struct.unpack_from(order + letter, field)[0]))
        offset += entry.size
    following = data[offset : offset + layout.offset_bytes]
    # A file that ends with its only directory has no offset of a next one.
    return entries, int.from_bytes(following, "little" if order == "<" else "big")


def check_pixels(width: int, height: int, max_pixels: int) -> None:
    """Raise `TooLarge` when a (height, width) picture has more than `max_pixels` pixels."""
    if width * height > max_pixels:
        raise TooLarge(
            f"The image has {width} x {height} = {width * height / 1e6:.1f} megapixels; "
            f"the limit is {max_pixels / 1e6:g}."
        )


def check_exif_size(exif_bytes: int, max_exif_bytes: int) -> None:
    """Raise `TooLarge` when `exif_bytes` is over the limit."""
    if exif_bytes > max_exif_bytes:
        raise TooLarge(f"The image's EXIF metadata has more than the limit of {max_exif_bytes} bytes.")

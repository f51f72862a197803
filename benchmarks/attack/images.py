"""Images that cost, lie or are damaged."""

import io
import struct
import zlib

from PIL import Image


def picture(plugin: str = "JPEG", size: tuple[int, int] = (64, 48)) -> bytes:
    """A small gray picture."""
    buffer = io.BytesIO()
    Image.new("RGB", size, "gray").save(buffer, plugin)
    return buffer.getvalue()


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def png(width: int, height: int, pixels: bytes, *extra: bytes) -> bytes:
    """A gray PNG whose header says this size, with these inflated rows."""
    header = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    return b"".join(
        (
            b"\x89PNG\r\n\x1a\n",
            _chunk(b"IHDR", header),
            *extra,
            _chunk(b"IDAT", zlib.compress(pixels, 9)),
            _chunk(b"IEND", b""),
        )
    )


def png_of_900_megapixels() -> bytes:
    """A header of 30,000 x 30,000 pixels in 1 kB."""
    return png(30_000, 30_000, bytes(1_000_000))


def png_of_tiny_chunks() -> bytes:
    """100,000 text chunks of no bytes."""
    return png(8, 8, bytes(72), *[_chunk(b"tEXt", b"a\0")] * 100_000)


def png_with_a_text_bomb() -> bytes:
    """A compressed text of 64 MB in 64 kB."""
    return png(8, 8, bytes(72), _chunk(b"zTXt", b"a\0\0" + zlib.compress(bytes(64_000_000), 9)))


def png_without_rows() -> bytes:
    """The header says 8000 x 8000 and one row is there."""
    return png(8000, 8000, bytes(8001))


def webp_of_a_large_canvas() -> bytes:
    """34 bytes whose canvas has 16,384 x 16,384 pixels; decoders allocate it first."""
    bits = 16_383 | 16_383 << 14
    body = b"WEBP" + b"VP8L" + struct.pack("<I", 5) + b"\x2f" + struct.pack("<I", bits)
    return b"RIFF" + struct.pack("<I", len(body)) + body


def jpeg_of_many_segments() -> bytes:
    """A million empty comments."""
    return b"\xff\xd8" + b"\xff\xfe\x00\x02" * 1_000_000 + picture()[2:]


def jpeg_of_many_scans() -> bytes:
    """A progressive JPEG whose last scan is there 2000 times."""
    buffer = io.BytesIO()
    Image.new("RGB", (640, 480), "gray").save(buffer, "JPEG", progressive=True)
    data = buffer.getvalue()
    last = data.rindex(b"\xff\xda")
    return data[:last] + data[last:-2] * 2000 + data[-2:]


def jpeg_with_large_exif() -> bytes:
    """Eight EXIF segments of 64 kB."""
    segment = b"\xff\xe1\xff\xff" + b"Exif\0\0" + bytes(65_527)
    data = picture()
    return data[:2] + segment * 8 + data[2:]


def tiff_of_endless_directories() -> bytes:
    """A directory whose next one is itself."""
    entries = [(256, 4, 1, 8), (257, 4, 1, 8)]
    packed = b"".join(struct.pack("<HHII", *entry) for entry in entries)
    return b"II*\0" + struct.pack("<I", 8) + struct.pack("<H", len(entries)) + packed + struct.pack("<I", 8)


def tiff_of_many_values() -> bytes:
    """A tag that says it has four billion values."""
    entries = [(256, 4, 1, 8), (257, 4, 1, 8), (40_000, 4, 2**32 - 1, 8)]
    packed = b"".join(struct.pack("<HHII", *entry) for entry in entries)
    return b"II*\0" + struct.pack("<I", 8) + struct.pack("<H", len(entries)) + packed + bytes(4)

"""Files that clients send: pictures, and what only claims to be one."""

import io
import zlib

import numpy as np
from PIL import Image
from pillow_heif import register_heif_opener

register_heif_opener()


def encoded(image: Image.Image, format_: str, **options: object) -> bytes:
    """File of a picture."""
    stream = io.BytesIO()
    image.save(stream, format_, **options)
    return stream.getvalue()


def bomb(width: int = 30_000, height: int = 30_000) -> bytes:
    """A PNG of so many pixels in a few bytes."""

    def chunk(name: bytes, data: bytes) -> bytes:
        return len(data).to_bytes(4, "big") + name + data + zlib.crc32(name + data).to_bytes(4, "big")

    size = width.to_bytes(4, "big") + height.to_bytes(4, "big")
    header = chunk(b"IHDR", size + b"\x08\x02\0\0\0")
    return b"\x89PNG\r\n\x1a\n" + header + chunk(b"IDAT", zlib.compress(b"\0" * 1000)) + chunk(b"IEND", b"")


def noise(mode: str) -> Image.Image:
    """A small picture of nothing."""
    return Image.fromarray(np.random.default_rng(1).integers(0, 255, (60, 80, 3), np.uint8)).convert(mode)

"""Limits of uploaded images, and how an answer that is a page is sent."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

AnswerFormat = Literal["jpeg", "png", "webp", "tiff", "pdf", "json"]
PagesFormat = Literal["jpeg", "png", "webp", "tiff", "pdf", "json", "zip"]
"""The same where an answer may have several pages."""
SeveralFormat = Literal["pdf", "tiff", "zip", "json"]
"""Of these, the ones that hold several pages."""

MEDIA_TYPES: Mapping[PagesFormat, str] = {
    "jpeg": "image/jpeg",
    "png": "image/png",
    "webp": "image/webp",
    "tiff": "image/tiff",
    "pdf": "application/pdf",
    "json": "application/json",
    "zip": "application/zip",
}


@dataclass(frozen=True, slots=True)
class ImageLimits:
    """What an uploaded image may cost; crossing any limit is `TooLarge`, judged before pixels are decoded."""

    max_megapixels: float = 64.0
    """Width times height / 10^6; phones of "50 MP" give 50.1."""
    max_exif_bytes: int = 262_144
    """Cameras write 64 KiB at most (one JPEG segment)."""
    max_bytes: int = 64 * 2**20
    max_side_px: int = 30_000
    """OpenCV's remap addresses 32,767 pixels a side."""

    @property
    def max_pixels(self) -> int:
        """`max_megapixels` in pixels."""
        return int(self.max_megapixels * 1e6)


@dataclass(frozen=True, slots=True)
class Encoding:
    """How the answer is sent.

    `format` None is the upload's own format (JPEG for HEIC); `quality` 1-100 is for lossy formats; `embed` puts the
    image into the JSON, in base64. `pages_format` is the format of an answer of several pages; None: the client
    accepts no format that holds them.
    """

    format: PagesFormat | None = None
    quality: int | None = None
    embed: bool = False
    pages_format: SeveralFormat | None = "pdf"


@dataclass(frozen=True, slots=True)
class PageReply:
    """A flat page as it leaves the worker.

    `body` is the image file (empty when JSON was asked for), of type `media_type`; `document` is the result of the
    HTTP contract, ready for JSON.
    """

    body: bytes
    media_type: str
    document: dict[str, object]

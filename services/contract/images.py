"""Limits of uploaded images, and the encoding of an answer that is a page."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal, get_args

from services.contract.answers.mosaic import MosaicResult
from services.contract.answers.rectify import PagesResult, RectifyResult
from services.contract.kept_pages import KeptPage

TextFormat = Literal["hocr", "alto", "txt", "markdown"]
"""Formats of an answer that is the text of the pages."""
AnswerFormat = Literal["jpeg", "png", "webp", "tiff", "pdf", "json", "txt", "hocr", "alto", "markdown"]
PagesFormat = Literal["jpeg", "png", "webp", "tiff", "pdf", "json", "zip", "hocr", "alto", "txt", "markdown"]
"""Formats of an answer that may have several pages."""
EmbeddedFormat = Literal["jpeg", "png", "webp"]
"""Formats of an image in JSON that every browser shows."""
SeveralFormat = Literal["pdf", "tiff", "zip", "json", "txt", "hocr", "alto", "markdown"]
"""The formats of `PagesFormat` that can hold several pages."""
ArchiveContent = Literal["images", "json", "both"]
"""What an archive has of every page: its image, its description as a JSON file, or both."""
PdfVersion = Literal["1.7", "a-2b"]
"""PDF 1.7 (ISO 32000-1), or PDF/A-2b (ISO 19005-2), which is a part of it for archives."""

MEDIA_TYPES: Mapping[PagesFormat, str] = {
    "jpeg": "image/jpeg",
    "png": "image/png",
    "webp": "image/webp",
    "tiff": "image/tiff",
    "pdf": "application/pdf",
    "json": "application/json",
    "zip": "application/zip",
    "txt": "text/plain",
    "hocr": "text/vnd.hocr+html",
    "alto": "application/alto+xml",
    "markdown": "text/markdown",
}
"""The text formats have types that browsers do not ask for, so that a browser still gets a picture."""


@dataclass(frozen=True, slots=True)
class ImageLimits:
    """Limits of an uploaded image, checked before pixels are decoded. An image beyond a limit raises `TooLarge`."""

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
class DocumentLimits:
    """Limits of a document of several pages: of each file and page, of their number, and of all together.

    `image.max_bytes` is that of one file, which may be a whole document. Pages are decoded one at a time, so
    `max_megapixels` limits time, not memory; 20 pages of A4 at 300 dpi have 174. `of` says what the pages are together.
    """

    image: ImageLimits = field(default_factory=ImageLimits)
    max_pages: int = 20
    max_megapixels: float = 200.0
    of: Literal["document", "stack"] = "document"


@dataclass(frozen=True, slots=True)
class Encoding:
    """The encoding of an answer.

    Parameters
    ----------
    format
        Format of one page; None: the format of the upload (JPEG for HEIC).
    quality
        1-100, for lossy formats.
    embed
        Whether the image is put into the JSON, in base64.
    pages_format
        Format of several pages; None: the client accepts no format that can hold several.
    embed_format
        Format of the image in JSON; None: that of the upload (JPEG for HEIC).
    max_width, max_height
        Largest size of the picture in pixels; None: as large as the page is in the photo.
    pdf_version
        Version of a PDF.
    title
        Title of a document (PDF, hOCR), and file name in ALTO.
    archive
        What an archive has of every page.
    """

    format: PagesFormat | None = None
    quality: int | None = None
    embed: bool = False
    pages_format: SeveralFormat | None = "pdf"
    embed_format: EmbeddedFormat | None = None
    max_width: int | None = None
    max_height: int | None = None
    pdf_version: PdfVersion = "1.7"
    title: str = ""
    archive: ArchiveContent = "images"

    @property
    def needs_text(self) -> bool:
        """Whether the answer is the text of the pages."""
        return self.format in get_args(TextFormat)


@dataclass(frozen=True, slots=True)
class FailedPlace:
    """A page that could not be flattened: its index among all pages of the answer, and the problem."""

    place: int
    code: str
    detail: str
    field: str | None


@dataclass(frozen=True, slots=True)
class PageReply:
    """A flat page, or several, as a worker returns them.

    `body` is the file of type `media_type`, empty when the client wants JSON, which is `answer`. That of several pages
    lacks those that failed: only the app knows the status of a problem. `kept` has what is kept of each page that did
    not fail, None where nothing is.
    """

    body: bytes
    media_type: str
    answer: RectifyResult | PagesResult | MosaicResult
    kept: tuple[KeptPage | None, ...] = ()
    failed: tuple[FailedPlace, ...] = ()

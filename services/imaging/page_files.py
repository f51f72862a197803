"""Several pages -> one file: a PDF or a TIFF of several pages, or an archive with an image or a JSON file a page.

Each page is encoded when it is done; then its pixels are not needed any more, and only the encoded parts stay in
memory until the file is bound.
"""

import io
import json
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import pikepdf
from PIL import Image

from services.arrays import PageImage
from services.contract.images import ArchiveContent
from services.imaging.codec import DEFAULT_DPI, OutputFormat, encode_image

PagesFileFormat = Literal["pdf", "tiff", "zip"]

SUFFIXES: dict[OutputFormat, str] = {
    "jpeg": "jpg",
    "png": "png",
    "webp": "webp",
    "tiff": "tif",
    "pdf": "pdf",
}
"""Of files in an archive."""


@dataclass(frozen=True, slots=True)
class PagePart:
    """One encoded page of a file of several: an image, or a PDF of one page."""

    data: bytes
    dpi: float = DEFAULT_DPI
    icc_profile: bytes | None = None


def encode_part(
    page: PageImage,
    file_format: PagesFileFormat,
    image_format: OutputFormat = "jpeg",
    quality: int | None = None,
    dpi: float | None = None,
    icc_profile: bytes | None = None,
) -> PagePart:
    """The part of a page, as `encode_image` takes it, in a file of several pages.

    `image_format` is that of the images in an archive. The other options are those of `encode_image`.

    Raises
    ------
    InvalidOption
        When `quality` is out of its range, or the page is too large for the format.
    """
    # A part of a TIFF file waits as PNG, which is as lossless and half as large.
    part: OutputFormat = {"pdf": "pdf", "tiff": "png", "zip": image_format}[file_format]  # type: ignore[assignment]
    data = encode_image(page, part, quality, dpi, icc_profile)
    return PagePart(data, dpi or DEFAULT_DPI, icc_profile)


def bind_parts(parts: Sequence[PagePart], file_format: Literal["pdf", "tiff"]) -> bytes:
    """One file of all pages in their order."""
    if file_format == "tiff":
        return _bind_tiff(parts)
    return parts[0].data if len(parts) == 1 else _bind_pdf(parts)


def archive_pages(
    images: Sequence[bytes],
    image_format: OutputFormat,
    numbers: Sequence[int],
    documents: Sequence[object],
    content: ArchiveContent,
) -> bytes:
    """ZIP archive of pages: their images, their descriptions as JSON files, or both, as `content` says.

    Parameters
    ----------
    images
        Encoded images; they are compressed already, so they are only stored.
    image_format
        Format of the images.
    numbers
        Number, from 1, of the page of each image: `page-01.jpg` and so on.
    documents
        Descriptions of all pages, also of those without an image, ready for JSON.
    content
        What the archive has.
    """
    buffer = io.BytesIO()
    # A fixed date: the same pages make the same archive.
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_STORED) as archive:
        if content != "json":
            for number, image in zip(numbers, images, strict=True):
                archive.writestr(zipfile.ZipInfo(f"page-{number:02d}.{SUFFIXES[image_format]}"), image)
        if content != "images":
            for number, document in enumerate(documents, 1):
                text = json.dumps(document, ensure_ascii=False)
                archive.writestr(zipfile.ZipInfo(f"page-{number:02d}.json"), text, zipfile.ZIP_DEFLATED)
    return buffer.getvalue()


def _bind_pdf(parts: Sequence[PagePart]) -> bytes:
    with pikepdf.new() as document:
        for part in parts:
            with pikepdf.open(io.BytesIO(part.data)) as page:
                document.pages.extend(page.pages)
        buffer = io.BytesIO()
        document.save(buffer, deterministic_id=True)
        return buffer.getvalue()


def _bind_tiff(parts: Sequence[PagePart]) -> bytes:
    buffer = io.BytesIO()
    first, *others = parts
    # One page is decoded at a time: Pillow asks the generator for the next one when it has written the last.
    picture = _open_part(first)
    options = _tiff_options(first, picture.mode)
    picture.save(buffer, "TIFF", save_all=True, append_images=map(_open_part, others), **options)
    return buffer.getvalue()


def _open_part(part: PagePart) -> Image.Image:
    picture = Image.open(io.BytesIO(part.data))
    picture.encoderinfo = _tiff_options(part, picture.mode)
    return picture


def _tiff_options(part: PagePart, mode: str) -> dict[str, object]:
    if mode == "1":
        return {"compression": "group4", "dpi": (part.dpi, part.dpi)}
    return {
        "compression": "tiff_lzw",
        "tiffinfo": {317: 2},  # predictor, as of one page
        "dpi": (part.dpi, part.dpi),
        "icc_profile": part.icc_profile,
    }

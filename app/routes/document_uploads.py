"""Uploads that may be documents of several pages: images sent several times, TIFF files, PDFs."""

from collections.abc import Sequence
from dataclasses import replace

from fastapi import UploadFile

from app.engine.base import TimeLimit
from app.http.representations import SNIFFED_BYTES, sniff_format
from app.settings import Settings
from services.contract.images import AnswerFormat, DocumentLimits
from services.errors import TooLarge, UnsupportedMediaType


async def document_time_limit(
    images: Sequence[UploadFile], settings: Settings, *, split: bool = False
) -> TimeLimit | None:
    """Time limit of documents if the images may have several pages; None: the engine's default."""
    if len(images) > 1 or any([await _may_have_pages(image) for image in images]):
        longer = _stack_share(settings) if split else 1.0
        return TimeLimit(settings.document_timeout_s * longer, "DOCUMENT_TIMEOUT_S")
    return None


def document_limits(settings: Settings, *, split: bool = False) -> DocumentLimits:
    """Limits of a document; one file may be a whole document, so it may be as large as the whole body.

    With `split` those of a stack: every page may have as much as a page of the largest document.
    """
    image = replace(settings.image_limits, max_bytes=settings.max_document_upload_bytes)
    if split:
        together = settings.max_document_megapixels * _stack_share(settings)
        return DocumentLimits(image, settings.max_stack_pages, together, "stack")
    return DocumentLimits(image, settings.max_pages, settings.max_document_megapixels)


def _stack_share(settings: Settings) -> float:
    """How many of the largest documents the largest stack is, at least one."""
    return max(1.0, settings.max_stack_pages / settings.max_pages)


async def check_photos(images: Sequence[UploadFile], settings: Settings) -> None:
    """Check the number of uploads and the bytes of each photo, before any is read.

    Raises
    ------
    TooLarge, UnsupportedMediaType
    """
    if len(images) > settings.max_pages:
        raise TooLarge(
            f"image: a document may have {settings.max_pages} pages (MAX_PAGES); {len(images)} images were sent.",
            "image",
        )
    check_not_empty(images)
    for index, image in enumerate(images):
        size = image.size or 0
        if size > settings.max_upload_bytes and not await _may_have_pages(image):
            field = f"image[{index}]" if len(images) > 1 else "image"
            raise TooLarge(
                f"{field}: the photo has {size} bytes; the limit is {settings.max_upload_bytes} (MAX_UPLOAD_BYTES).",
                field,
            )


def check_not_empty(images: Sequence[UploadFile]) -> None:
    """Check that there is something in the uploads, before a job is made of them; of several pages one may be empty.

    Raises
    ------
    UnsupportedMediaType
    """
    if images and not any(image.size for image in images):
        raise UnsupportedMediaType("The uploaded file is empty.", "image")


async def format_of(image: UploadFile) -> AnswerFormat | None:
    """Response format for an upload, by its first bytes; None for no image that is known."""
    head = await image.read(SNIFFED_BYTES)
    await image.seek(0)
    return sniff_format(head)


async def _may_have_pages(image: UploadFile) -> bool:
    """Whether it may hold several pages: TIFF, or no known image (possibly a PDF)."""
    return await format_of(image) in ("tiff", None)

"""Answers that may have several pages: one file with all pages, or a list of their descriptions."""

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import cast, get_args

from services.arrays import PageImage
from services.contract.images import MEDIA_TYPES, Encoding, PageReply, PagesFormat, TextFormat
from services.contract.kept_pages import KeptPage
from services.errors import DocumentError, NotAcceptable
from services.imaging.codec import DEFAULT_DPI, OutputFormat, encode_image
from services.imaging.page_files import PagePart, PagesFileFormat, archive_pages, bind_parts, encode_part
from services.notices import Notice
from services.operations.page_reading import describe_text, write_text
from services.operations.replies import (
    ENCODING_BEGINS,
    SourceFacts,
    add_text_layer,
    describe_image,
    describe_warnings,
    image_format_of,
    timed,
    to_json_ready,
)
from services.text.page_text import PageText


@dataclass(frozen=True, slots=True, eq=False)
class DescribedPage:
    """One page of an answer: its picture, as `encode_image` takes it, its HTTP document without `image`, and its text.

    `dpi` is the resolution of the picture, by the true size of the page or by the resolution of the upload; None if
    neither is known.
    """

    image: PageImage
    document: Mapping[str, object]
    text: PageText | None = None
    dpi: float | None = None
    kept: KeptPage | None = None
    """What is kept of it, where the photo is to be kept."""

    def source(self, upload: SourceFacts) -> SourceFacts:
        """Facts of the upload, with the resolution of this picture."""
        return replace(upload, dpi=self.dpi)


@dataclass(frozen=True, slots=True, eq=False)
class EncodedPage:
    """A page without its pixels: its part of the file (None: the answer needs none), and its HTTP document."""

    part: PagePart | None
    document: Mapping[str, object]
    text: PageText | None
    kept: KeptPage | None = None


@dataclass(frozen=True, slots=True)
class FailedPage:
    """A page that could not be flattened: its index among all pages of the answer, and the error."""

    place: int
    error: DocumentError

    def document(self) -> dict[str, object]:
        """Its part of the HTTP document."""
        error = self.error
        return {"problem": {"code": error.code, "detail": error.detail, "field": error.field}}


@dataclass(frozen=True, slots=True)
class PagesTarget:
    """What an answer of several pages becomes: its format, and that of its images."""

    format: PagesFormat
    image_format: OutputFormat


def choose_target(encoding: Encoding, source: SourceFacts, pages: int) -> PagesTarget:
    """The format of an answer with `pages` pages; a single page may also have a format that holds one page only.

    Raises
    ------
    NotAcceptable
        When there are several pages and the client accepts no format that can hold several.
    """
    asked: PagesFormat | None = encoding.format if pages == 1 else encoding.pages_format
    if pages > 1 and asked is None:
        raise several_pages_refused(pages)
    shown: PagesFormat | None = encoding.embed_format if asked == "json" else asked
    image_format = image_format_of(source, shown if shown != "pdf" else None)
    return PagesTarget(asked or image_format, image_format)


def encode_page(
    page: DescribedPage, target: PagesTarget, source: SourceFacts, encoding: Encoding
) -> EncodedPage:
    """The page in the form in which it waits for the others.

    Raises
    ------
    InvalidOption
        When `encoding` is not possible.
    """
    facts = page.source(source)
    quality, dpi, profile = encoding.quality, facts.dpi, facts.icc_profile
    embedded, part = None, None
    if target.format == "json":
        if encoding.embed:
            file = encode_image(page.image, target.image_format, quality, dpi, profile)
            embedded = base64.b64encode(file).decode("ascii")
    elif target.format in get_args(PagesFileFormat):
        kind = cast(PagesFileFormat, target.format)
        part = encode_part(page.image, kind, target.image_format, quality, dpi, profile)
    elif target.format not in get_args(TextFormat):
        part = PagePart(encode_image(page.image, target.image_format, quality, dpi, profile))
    text = None if page.text is None else describe_text(page.text)
    image = describe_image(embedded, target.image_format)
    return EncodedPage(part, {**page.document, "text": text, **image}, page.text, page.kept)


def bind_pages(
    pages: Sequence[EncodedPage],
    target: PagesTarget,
    encoding: Encoding,
    timings_ms: dict[str, float],
    notices: tuple[Notice, ...] = (),
    failures: Sequence[FailedPage] = (),
) -> PageReply:
    """The reply with all `pages` (one or more). Its document is `{"pages", "warnings", "timings_ms"}`.

    `notices` concern all pages. `failures` are in the document at their places; a file leaves them out. The function
    adds `encode` to `timings_ms`.
    """
    parts = [page.part for page in pages if page.part is not None]
    texts = [page.text for page in pages if page.text is not None]
    documents = [page.document for page in pages]
    for failure in sorted(failures, key=lambda failure: failure.place):
        documents.insert(failure.place, failure.document())
    numbers = [number for number, document in enumerate(documents, 1) if "problem" not in document]
    body = b""
    described = to_json_ready(documents)
    assert isinstance(described, list)
    with timed("encode", timings_ms, ENCODING_BEGINS):
        if target.format in get_args(TextFormat):
            body = write_text(texts, cast(TextFormat, target.format), encoding, DEFAULT_DPI)
        elif target.format == "zip":
            images = [part.data for part in parts]
            body = archive_pages(images, target.image_format, numbers, described, encoding.archive)
        elif target.format == "tiff":
            body = bind_parts(parts, "tiff")
        elif target.format == "pdf":
            body = add_text_layer(
                bind_parts(parts, "pdf"),
                [page.text for page in pages],
                encoding,
                [part.dpi for part in parts],
            )
        elif parts:
            body = parts[0].data
    ready: dict[str, object] = {
        "pages": described,
        "warnings": describe_warnings(notices),
        "timings_ms": {stage: round(value, 1) for stage, value in timings_ms.items()},
    }
    return PageReply(body, MEDIA_TYPES[target.format], ready, tuple(page.kept for page in pages))


def make_pages_reply(
    pages: Sequence[DescribedPage],
    source: SourceFacts,
    encoding: Encoding,
    timings_ms: dict[str, float],
    notices: tuple[Notice, ...] = (),
) -> PageReply:
    """The reply with all `pages` of one upload (one or more) in the requested encoding.

    Raises
    ------
    NotAcceptable
        When there are several pages and the client accepts no format that can hold several.
    InvalidOption
        When `encoding` is not possible.
    """
    target = choose_target(encoding, source, len(pages))
    encoded = [encode_page(page, target, source, encoding) for page in pages]
    return bind_pages(encoded, target, encoding, timings_ms, notices)


def several_pages_refused(count: int) -> NotAcceptable:
    """The error for an answer of `count` pages when the client accepts only formats of one page."""
    return NotAcceptable(
        f"{count} pages were found, and the format that was asked for holds one; ask for pdf, tiff, zip or json "
        "(field `format`, or `Accept`), or send one photo, with pages=main.",
        "format",
    )

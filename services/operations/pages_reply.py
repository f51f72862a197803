"""Replies with one flat page or several: the file with all of them, or their answers."""

import base64
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, cast, get_args

from services.arrays import PageImage
from services.contract.answers.capture import Quality
from services.contract.answers.mosaic import MosaicResult
from services.contract.answers.rectify import PagesResult, RectifyResult
from services.contract.images import MEDIA_TYPES, Encoding, FailedPlace, PageReply, PagesFormat, TextFormat
from services.contract.kept_pages import KeptPage
from services.errors import NotAcceptable
from services.heap import release_if_large
from services.imaging.codec import DEFAULT_DPI, OutputFormat, encode_image
from services.imaging.page_files import PagePart, PagesFileFormat, archive_pages, bind_parts, encode_part
from services.notices import Notice
from services.operations.page_reading import write_text
from services.operations.replies import (
    ENCODING_BEGINS,
    SourceFacts,
    describe_timings,
    describe_warnings,
    finished_pdf,
    image_format_of,
    show_page,
    timed,
)
from services.side_by_side import SideStep
from services.text.page_text import PageText


@dataclass(frozen=True, slots=True, eq=False)
class DescribedPage:
    """One page of an answer: its picture, as `encode_image` takes it, its answer without image and text, and its text.

    `dpi` is the resolution of the picture, by the true size of the page or by the resolution of the upload; None if
    neither is known.
    """

    image: PageImage
    answer: RectifyResult | MosaicResult
    text: PageText | None = None
    dpi: float | None = None
    kept: KeptPage | None = None
    """What is kept of it, where the photo is to be kept."""
    quality: SideStep[Quality | None] | None = None
    """The quality of its photo, where the answer may not have it yet."""

    def source(self, upload: SourceFacts) -> SourceFacts:
        """Facts of the upload, with the resolution of this picture."""
        return replace(upload, dpi=self.dpi)


@dataclass(frozen=True, slots=True, eq=False)
class EncodedPage:
    """A page without its pixels: its part of the file (None: the reply needs none), and its answer."""

    part: PagePart | None
    answer: RectifyResult | MosaicResult
    text: PageText | None
    dpi: float = DEFAULT_DPI
    kept: KeptPage | None = None


@dataclass(frozen=True, slots=True)
class PagesTarget:
    """What an answer becomes: its format, that of its images, and whether it may have several pages."""

    format: PagesFormat
    image_format: OutputFormat
    several: bool


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
    return PagesTarget(asked or image_format, image_format, pages > 1)


def encode_page(
    page: DescribedPage, target: PagesTarget, source: SourceFacts, encoding: Encoding
) -> EncodedPage:
    """The page without its pixels; its answer gets its text, and its picture where JSON has it.

    Raises
    ------
    InvalidOption
        When `encoding` is not possible.
    """
    facts, image_format = page.source(source), target.image_format
    rest = encoding.quality, facts.dpi, facts.icc_profile
    embedded, part = None, None
    if target.format == "json":
        if encoding.embed:
            embedded = base64.b64encode(encode_image(page.image, image_format, *rest)).decode("ascii")
    elif target.several and target.format in get_args(PagesFileFormat):
        part = encode_part(page.image, cast(PagesFileFormat, target.format), image_format, *rest)
    elif target.format not in get_args(TextFormat):
        kind = cast(OutputFormat, target.format) if target.format in get_args(OutputFormat) else image_format
        part = PagePart(encode_image(page.image, kind, *rest))
    if page.quality is not None and isinstance(page.answer, RectifyResult):
        page.answer.quality = page.quality.result()
    show_page(page.answer, embedded, image_format, page.text)
    return EncodedPage(part, page.answer, page.text, facts.dpi or DEFAULT_DPI, page.kept)


def bind_pages(
    pages: Sequence[EncodedPage],
    target: PagesTarget,
    encoding: Encoding,
    timings_ms: dict[str, float],
    notices: tuple[Notice, ...] = (),
    failed: Sequence[FailedPlace] = (),
) -> PageReply:
    """The reply with all `pages` (one or more).

    `notices` concern all pages. An archive has the problems of those that `failed`, other files leave them out, and
    the app puts them into JSON. The
    function adds `encode` to `timings_ms`.
    """
    with timed("encode", timings_ms, ENCODING_BEGINS):
        body = _bind(pages, target, encoding, failed)
    answer = PagesResult(
        pages=[cast(RectifyResult, page.answer) for page in pages],
        warnings=describe_warnings(notices),
        timings_ms=describe_timings(timings_ms),
    )
    kept = tuple(page.kept for page in pages)
    return PageReply(body, MEDIA_TYPES[target.format], answer, kept, tuple(failed))


def _bind(
    pages: Sequence[EncodedPage], target: PagesTarget, encoding: Encoding, failed: Sequence[FailedPlace] = ()
) -> bytes:
    """The file of all `pages`; empty for JSON."""
    parts = [page.part for page in pages if page.part is not None]
    if target.format in get_args(TextFormat):
        texts = [page.text for page in pages if page.text is not None]
        assert texts, "a text format needs the text"
        dpi = DEFAULT_DPI if target.several else pages[0].dpi
        return write_text(texts, cast(TextFormat, target.format), encoding, dpi)
    match target.format:
        case "zip":
            described: list[Any] = [page.answer.model_dump(mode="json") for page in pages]
            for each in sorted(failed, key=lambda each: each.place):
                problem = {"code": each.code, "detail": each.detail, "field": each.field}
                described.insert(each.place, {"problem": problem})
            numbers = [number for number, page in enumerate(described, 1) if "problem" not in page]
            images = [part.data for part in parts]
            return archive_pages(images, target.image_format, numbers, described, encoding.archive)
        case "tiff" if target.several:
            return bind_parts(parts, "tiff")
        case "pdf":
            texts_of_pages, dpis = [page.text for page in pages], [page.dpi for page in pages]
            return finished_pdf(bind_parts(parts, "pdf"), texts_of_pages, encoding, dpis)
    return parts[0].data if parts else b""  # an image, or nothing beside JSON


def make_page_reply(
    page: DescribedPage, source: SourceFacts, encoding: Encoding, timings_ms: dict[str, float]
) -> PageReply:
    """The reply with the only page of a request, in the requested encoding; adds `encode` to `timings_ms`.

    Raises
    ------
    InvalidOption
        When `encoding` is not possible.
    """
    target = choose_target(encoding, source, 1)
    release_if_large(page.image.nbytes)
    if target.format == "json" and not encoding.embed:
        encoded = encode_page(page, target, source, encoding)
    else:
        with timed("encode", timings_ms, ENCODING_BEGINS):
            encoded = encode_page(page, target, source, encoding)
    if page.quality is not None and page.quality.is_beside:  # else it was timed where it was measured
        timings_ms["quality"] = 1000 * page.quality.cpu_s
    page.answer.timings_ms = describe_timings(timings_ms)
    body = _bind([encoded], target, encoding)
    return PageReply(body, MEDIA_TYPES[target.format], page.answer, (page.kept,))


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
        f"{count} pages were found, and the format that was asked for holds one; send one photo, with pages=main, or "
        "ask /rectify for pdf, tiff, zip or json (field `format`, or `Accept`).",
        "format",
    )

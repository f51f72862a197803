"""Answers that may have several pages: one file with all pages, or a list of their descriptions."""

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from services.arrays import RgbImage
from services.contract.images import MEDIA_TYPES, Encoding, PageReply
from services.errors import NotAcceptable
from services.imaging.codec import encode_image
from services.imaging.page_files import encode_pages
from services.operations.replies import (
    ENCODING_BEGINS,
    SourceFacts,
    describe_image,
    describe_warnings,
    image_format_of,
    timed,
    to_json_ready,
)
from services.rectify.results import Notice


@dataclass(frozen=True, slots=True, eq=False)
class DescribedPage:
    """One page of an answer: its picture (H, W, 3) RGB, and its HTTP document without `image`."""

    image: RgbImage
    document: Mapping[str, object]


def make_pages_reply(
    pages: Sequence[DescribedPage],
    source: SourceFacts,
    encoding: Encoding,
    timings_ms: dict[str, float],
    notices: tuple[Notice, ...] = (),
) -> PageReply:
    """The reply with all `pages` (one or more) in the requested encoding.

    A single page may also have a format that holds one page only. The document is `{"pages", "warnings",
    "timings_ms"}` of the HTTP contract. `notices` concern all pages. The function adds `encode` to `timings_ms`.


    Raises
    ------
    NotAcceptable
        When there are several pages and the client accepts no format that can hold several.
    InvalidOption
        When `encoding` is not possible.
    """
    answer_format = encoding.format if len(pages) == 1 else encoding.pages_format
    if len(pages) > 1 and answer_format is None:
        raise several_pages_refused(len(pages))
    asked = encoding.embed_format if answer_format == "json" else answer_format
    image_format = image_format_of(source, asked if asked != "pdf" else None)
    quality, dpi, profile = encoding.quality, source.dpi, source.icc_profile
    body = b""
    embedded: list[str | None] = [None] * len(pages)
    with timed("encode", timings_ms, ENCODING_BEGINS):
        images = [page.image for page in pages]
        if answer_format == "json":
            if encoding.embed:
                embedded = [
                    base64.b64encode(encode_image(image, image_format, quality, dpi, profile)).decode("ascii")
                    for image in images
                ]
        elif answer_format in ("pdf", "tiff", "zip"):
            body = encode_pages(images, answer_format, image_format, quality, dpi, profile)
        else:
            body = encode_image(images[0], image_format, quality, dpi, profile)
    ready = to_json_ready(
        {
            "pages": [
                {**page.document, **describe_image(image, image_format)}
                for page, image in zip(pages, embedded, strict=True)
            ],
            "warnings": describe_warnings(notices),
            "timings_ms": {stage: round(value, 1) for stage, value in timings_ms.items()},
        }
    )
    assert isinstance(ready, dict)
    return PageReply(body, MEDIA_TYPES[answer_format or image_format], ready)


def several_pages_refused(count: int) -> NotAcceptable:
    """The error for an answer of `count` pages when the client accepts only formats of one page."""
    return NotAcceptable(
        f"{count} pages were found, and the format that was asked for holds one; ask for pdf, tiff, zip or json "
        "(field `format`, or `Accept`), or send pages=main.",
        "format",
    )

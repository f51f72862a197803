"""Recognition of a page or a document: options, models, limits in; the result and the measured pages out."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from services.contract.images import ImageLimits

LayoutFormat = Literal["json", "pagexml", "alto", "png"]

LONGEST_LABEL = 60
"""Characters; the longest label of the labelled pages has 16."""

MEDIA_TYPES: Mapping[LayoutFormat, str] = {
    "json": "application/json",
    "pagexml": "application/xml",
    "alto": "application/xml",
    "png": "image/png",
}


@dataclass(frozen=True, slots=True)
class LayoutOptions:
    """How a page is recognized, and how the answer is sent.

    `image_name` is the name of the first upload, which PAGE-XML and ALTO write down; `image_names` those of all
    uploads. `page` is the only page of several that is wanted, counted from 1. `format_named` is False when `format`
    follows from `Accept`.
    """

    rectify: bool = False
    ocr: bool = True
    format: LayoutFormat = "json"
    explain: bool = False
    image_name: str = "page"
    image_names: tuple[str, ...] = ()
    page: int | None = None
    format_named: bool = True


@dataclass(frozen=True, slots=True)
class LayoutSettings:
    """Limits of one page (its image, its zones, a file of zones) and of one document, and how pages are read.

    `content_features` is the operator's settings file of content features; None: the file that comes with the code.
    """

    image: ImageLimits = field(default_factory=ImageLimits)
    max_zones: int = 500
    max_zones_file_bytes: int = 8 * 2**20
    content_features: Path | None = None
    max_pages: int = 20
    max_document_megapixels: float = 200.0


@dataclass(frozen=True, slots=True)
class ModelDocument:
    """A version of a layout model; `document` is its JSON.

    `genre` is the genre that the class was given, None if none; `continues` is the class whose later pages the model
    describes.
    """

    name: str
    version: int
    document: bytes
    genre: str | None = None
    continues: str | None = None


@dataclass(frozen=True, slots=True)
class LayoutReply:
    """A recognized page as it leaves the worker.

    `body` is the file that was asked for (empty for JSON), of type `media_type`; `document` is the `LayoutResult` of
    the HTTP contract without its id; `page` is the page with all measurements, which feedback needs later.
    """

    body: bytes
    media_type: str
    document: dict[str, object]
    page: dict[str, object]


@dataclass(frozen=True, slots=True)
class DocumentPage:
    """One page of a document: its `LayoutResult` without id, and the page with all measurements."""

    document: dict[str, object]
    page: dict[str, object]


@dataclass(frozen=True, slots=True)
class DocumentReply:
    """A recognized document of several pages as it leaves the worker.

    `body` is an archive with one file a page (empty for JSON), of type `media_type`; `document` is the
    `DocumentResult` of the HTTP contract without its id and its pages, which are in `pages`.
    """

    body: bytes
    media_type: str
    document: dict[str, object]
    pages: list[DocumentPage]

"""Input and output of layout recognition: options, models and limits; the result and the measured pages."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from services.contract.answers.layout import DocumentResult, LayoutResult
from services.contract.fields import FieldSetting
from services.contract.html import HtmlElement
from services.contract.images import DocumentLimits
from services.contract.layout_learning import DEFAULT_LEARNER, Learner
from services.contract.page_json import PageJson
from services.contract.result_json import ResultJson

LayoutFormat = Literal["json", "pagexml", "alto", "png", "html"]

MOST_MODEL_BYTES = 80 * 2**20
"""Largest total size of the model documents of one recognition, and of those that a worker caches. Objects take five
times as much memory. 200 models of 15 labels have 40 MB of documents; one model of 60 labels has 2.5 MB."""

LONGEST_LABEL = 60
"""Characters. The longest label in the labelled pages has 16."""

MEDIA_TYPES: Mapping[LayoutFormat, str] = {
    "json": "application/json",
    "pagexml": "application/xml",
    "alto": "application/xml",
    "png": "image/png",
    "html": "text/html",
}


@dataclass(frozen=True, slots=True)
class LayoutOptions:
    """Options of one recognition; with `split` the pages are a stack of documents.

    `image_name` is the name of the first upload; PAGE-XML, ALTO and HTML files contain it. `image_names` are the names
    of all uploads. `words` adds the words of every zone to JSON and XML. `page` selects one page of several, counted
    from 1. `format_named` is False when `format` follows from the header `Accept`. `keep_image_bytes` is the largest
    size of the picture of each page that is returned with its result; 0: none. `language` is what OCR reads
    (`eng+fra`; None: the default).
    """

    rectify: bool = False
    ocr: bool = True
    format: LayoutFormat = "json"
    explain: bool = False
    words: bool = False
    image_name: str = "page"
    image_names: tuple[str, ...] = ()
    page: int | None = None
    format_named: bool = True
    keep_image_bytes: int = 0
    language: str | None = None
    split: bool = False


@dataclass(frozen=True, slots=True)
class LayoutSettings:
    """Limits of the pages of one document (pictures, zones, zones file), and the settings for content features.

    `content_features` is the operator's settings file; None: the file of this package. `language` is what OCR reads in
    images of samples (None: the default).
    """

    document: DocumentLimits = field(default_factory=DocumentLimits)
    max_zones: int = 500
    max_zones_file_bytes: int = 8 * 2**20
    content_features: Path | None = None
    language: str | None = None


@dataclass(frozen=True, slots=True)
class ModelDocument:
    """One version of a layout model; `document` is its JSON.

    The other fields are settings of the class. `genre` is None when nobody has set it. `continues` names the class
    whose later pages the model describes. `learner` names the algorithm by which the model learns. `fields` has
    the types of fields, and `elements` the elements of HTML files, by label.
    """

    name: str
    version: int
    document: bytes
    genre: str | None = None
    continues: str | None = None
    learner: Learner = DEFAULT_LEARNER
    fields: Mapping[str, FieldSetting] = field(default_factory=dict)
    elements: Mapping[str, HtmlElement] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class DrawnPage:
    """Place of a page in the picture with its labels: its point (x, y) is drawn at (x scale_x + left, y scale_y + top).

    Points are in pixels, from the outer edges of the top-left pixels.
    """

    scale_x: float
    scale_y: float
    left: int
    top: int


@dataclass(frozen=True, slots=True)
class KeptResult:
    """A stored result that becomes a file, or a page of one.

    `document` is its `LayoutResult` without the id, `page` the page with all measurements, and `name` that of its image
    in the file. `picture` is a JPEG file of the page; empty: none is kept. `elements` has the elements of labels that
    the settings of the class name.
    """

    document: ResultJson
    page: PageJson
    name: str
    picture: bytes = b""
    elements: Mapping[str, HtmlElement] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class RenderedResults:
    """A file of type `media_type` of stored results; `drawn` as in `LayoutReply`."""

    body: bytes
    media_type: str
    drawn: DrawnPage | None = None


@dataclass(frozen=True, slots=True)
class LayoutReply:
    """A recognized page, as a worker returns it.

    `body` is the requested file of type `media_type`, empty for JSON, which is `answer`; the store gives its id. `page`
    is the page with all measurements; later feedback needs it. `picture` is a JPEG file
    of the page, empty unless it shall be kept. `drawn` belongs to a `body` that shows the page with its labels.
    """

    body: bytes
    media_type: str
    answer: LayoutResult
    page: PageJson
    picture: bytes = b""
    drawn: DrawnPage | None = None


@dataclass(frozen=True, slots=True)
class DocumentPage:
    """One page of a document: its answer without the id, the page with all measurements, and its picture.

    `upload` is the index of the image that it is in.
    """

    answer: LayoutResult
    page: PageJson
    upload: int
    picture: bytes = b""


@dataclass(frozen=True, slots=True)
class DocumentReply:
    """A recognized document of several pages, as a worker returns it.

    `body` is an archive of type `media_type` with one file for each page, or an HTML file; empty for JSON. `answer` has
    no id and no pages yet; `pages` has the pages.
    """

    body: bytes
    media_type: str
    answer: DocumentResult
    pages: list[DocumentPage]


@dataclass(frozen=True, slots=True)
class StackReply:
    """The recognized documents of a stack, in their order, as a worker returns them."""

    documents: list[DocumentReply]

"""Pages in, their class and labels out, by models that are handed over with them."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from app.operations.pages import UploadLimits, image_limits

if TYPE_CHECKING:
    from services.operations import page_zones
    from services.operations.stored_models import StoredModel

LayoutFormat = Literal["json", "pagexml", "alto", "png"]


@dataclass(frozen=True, slots=True)
class LayoutOptions:
    """How a page is recognized, and how the answer is wanted.

    `page` is the only one of several that is wanted, counted from 1; `asked` tells that `format` was asked for by name
    and does not follow from `Accept`.
    """

    rectify: bool
    ocr: bool
    format: LayoutFormat
    explain: bool
    image_name: str
    image_names: tuple[str, ...] = ()
    page: int | None = None
    asked: bool = True


@dataclass(frozen=True, slots=True)
class LayoutSettings:
    """What a page may cost (its image, the number of its zones, a file of them), what a document, and how it is read.

    `content_features` is the operator's settings file of content features (None: those that come along).
    """

    image: UploadLimits
    max_zones: int
    max_zones_file_bytes: int
    content_features: Path | None
    max_pages: int = 20
    max_document_megapixels: float = 200.0


@dataclass(frozen=True, slots=True)
class ModelDocument:
    """A version of a layout model, as JSON.

    `genre` is the one that its class was given, if it was; `continues` the class whose later pages it describes.
    """

    name: str
    version: int
    document: bytes
    genre: str | None = None
    continues: str | None = None


@dataclass(frozen=True, slots=True)
class LayoutReply:
    """A file (empty when JSON was asked for), its type, the contract's result, and the page it is of.

    `page` is what feedback needs later: the zones with all that was measured.
    """

    body: bytes
    media_type: str
    document: dict[str, object]
    page: dict[str, object]


@dataclass(frozen=True, slots=True)
class PageReply:
    """A page's result but for its id, and the page it is of."""

    document: dict[str, object]
    page: dict[str, object]


@dataclass(frozen=True, slots=True)
class DocumentReply:
    """The same of several pages: an archive of files (empty when JSON was asked for), the contract's `DocumentResult`
    but for its pages, and these."""

    body: bytes
    media_type: str
    document: dict[str, object]
    pages: list[PageReply]


def recognize_layout(
    images: list[bytes],
    zones: bytes | None,
    zones_file: bytes | None,
    models: list[ModelDocument],
    options: LayoutOptions,
    settings: LayoutSettings,
) -> LayoutReply | DocumentReply:
    """Class and labels of a page, sent as an image, as `zones` (JSON), as a `zones_file`, or as image and zones; or
    of the pages of a document, sent as `images`, TIFF files and PDFs.

    Raises the `DocumentError`s of `services.operations`.
    """
    from services.operations import layout, layout_documents

    reply = layout_documents.recognize_uploads(
        images,
        zones,
        zones_file,
        stored_models(models),
        layout.LayoutOptions(
            rectify=options.rectify,
            ocr=options.ocr,
            format=options.format,
            explain=options.explain,
            image_name=options.image_name,
            image_names=options.image_names,
            page=options.page,
            asked=options.asked,
        ),
        layout_settings(settings),
    )
    if isinstance(reply, layout.LayoutReply):
        return LayoutReply(reply.body, reply.media_type, reply.document, reply.page)
    pages = [PageReply(page.document, page.page) for page in reply.pages]
    return DocumentReply(reply.body, reply.media_type, reply.document, pages)


def stored_models(models: list[ModelDocument]) -> "list[StoredModel]":
    """`models` as `services.operations` takes them."""
    from services.operations.stored_models import StoredModel

    return [
        StoredModel(model.name, model.version, model.document, genre=model.genre, continues=model.continues)
        for model in models
    ]


def layout_settings(settings: LayoutSettings) -> "page_zones.LayoutSettings":
    """`settings` as `services.operations` takes them."""
    from services.operations import page_zones

    return page_zones.LayoutSettings(
        image_limits(settings.image),
        settings.max_zones,
        settings.max_zones_file_bytes,
        settings.content_features,
        settings.max_pages,
        settings.max_document_megapixels,
    )

"""Recognition of a document of one or more pages (images, TIFF files, PDFs): its class and its pages' labels.

Of a stack of pages it also finds where its documents begin.
"""

import io
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

from services.contract.answers.layout import DocumentResult
from services.contract.answers.tables import tables_of_document
from services.contract.layout import (
    MEDIA_TYPES,
    DocumentPage,
    DocumentReply,
    LayoutOptions,
    LayoutReply,
    LayoutSettings,
    ModelDocument,
    StackReply,
)
from services.errors import InvalidOption, NotAcceptable
from services.imaging.page_images import PageSource, naming_page, open_pages
from services.layout.exchange.page_json import page_to_document
from services.layout.pipeline import complete_recognition, content_features
from services.layout.recognition.documents import (
    DocumentRecognition,
    recognize_document,
)
from services.layout.recognition.page_recognition import RecognitionParameters, VersionedModel
from services.layout.recognition.results import Recognition
from services.layout.recognition.stack import StackParts, part_stack
from services.notices import Notice
from services.operations.kept_picture import encode_kept_picture
from services.operations.layout import (
    MATCHING_BEGINS,
    MeasuredPage,
    describe_page,
    elements_of,
    measure_page,
    recognize_picture,
    recognize_upload,
    write_xml,
)
from services.operations.layout_html import HtmlPage, render_html
from services.operations.layout_result import describe_class, describe_classes
from services.operations.layout_tables import SegmentedPage, gather_tables, recognize_view, with_tables
from services.operations.page_reading import check_installed
from services.operations.reader import ocr_engine
from services.operations.replies import (
    ENCODING_BEGINS,
    describe_timings,
    describe_warnings,
    timed,
    to_json_ready,
)
from services.operations.stored_models import open_models
from services.progress import progress_within, report_progress

ARCHIVE = "application/zip"
MOST_PICTURE_BYTES = 4 * 2**20
"""Of a page's picture that waits for the labels of all pages, from which HTML cuts its figures."""


@dataclass(frozen=True, slots=True)
class _SeenPage:
    """A measured page without its picture, its file, and its timings; for HTML the picture as a JPEG file."""

    source: PageSource
    measured: MeasuredPage
    picture: bytes
    timings_ms: dict[str, float]


def recognize_uploads(
    images: Sequence[bytes],
    zones: bytes | None,
    zones_file: bytes | None,
    models: Sequence[ModelDocument],
    options: LayoutOptions,
    settings: LayoutSettings,
) -> LayoutReply | DocumentReply | StackReply:
    """Class and labels of the pages in `images`, in zones, or in an image with its zones.

    An image may hold several pages (TIFF, PDF). Zones describe one page, the first page of their image.
    `options.split` finds the documents among the pages.

    Raises
    ------
    UnsupportedMediaType, TooLarge, UndecodableImage
        When an image is not accepted, or all pages together are too large. The error names the page.
    NoText
        When a page shall be rectified and shows too little printed text.
    InvalidOption
        When the zones are invalid, or not in pixels of the image; when the page `options.page` does not exist; when the
        format holds one page and there are several; when the language is not installed.
    NotAcceptable
        When the format follows from `Accept`, holds one page, and there are several.
    """
    if zones is not None or zones_file is not None or not images:
        return recognize_upload(images[0] if images else None, zones, zones_file, models, options, settings)
    with open_pages(images, settings.document, options.page) as pages:
        if len(pages) == 1 and not options.split:
            return recognize_picture(pages[0].decode, None, None, models, options, settings)
        _check_format(options, len(pages))
        check_installed(options.language)  # an error must come before the work
        return _recognize_pages(pages, models, options, settings)


def _recognize_pages(
    sources: Sequence[PageSource],
    models: Sequence[ModelDocument],
    options: LayoutOptions,
    settings: LayoutSettings,
) -> DocumentReply | StackReply:
    timings_ms: dict[str, float] = {}
    with timed("models", timings_ms, 0.0):
        versions = open_models(models)
    seen = []
    for index, source in enumerate(sources):
        share = MATCHING_BEGINS / len(sources)
        with progress_within(index * share, (index + 1) * share):
            seen.append(_measure(source, options, settings))
    report_progress("matching", MATCHING_BEGINS)
    features = content_features(settings.content_features)
    with timed("tables", timings_ms):
        gathered = gather_tables(
            [(page.measured.page, page.measured.fine) for page in seen], versions, features
        )
    if not options.split:
        return _recognize_document(seen, gathered, versions, models, options, settings, timings_ms, ())
    with timed("beginnings", timings_ms):
        parts = part_stack(
            [page for page, _ in gathered],
            versions,
            features.names,
            RecognitionParameters(explain=options.explain),
        )
    documents = []
    for begin, end in pairwise((*parts.beginnings, len(seen))):
        matched = parts.matched[begin:end]
        reply = _recognize_document(
            seen[begin:end], gathered[begin:end], versions, models, options, settings, timings_ms, matched
        )
        reply.answer.warnings += describe_warnings(_unsure(parts, begin, end))
        documents.append(reply)
    return StackReply(documents)


def _unsure(parts: StackParts, begin: int, end: int) -> tuple[Notice, ...]:
    """Warnings about pages of one document that perhaps begin it, or another one."""
    notices = []
    for place, chance in parts.unsure(begin, end):
        if place == begin:
            notices.append(f"pages[0] may go on with the document before ({1 - chance:.2f}).")
        else:
            notices.append(f"pages[{place - begin}] may begin another document ({chance:.2f}).")
    return tuple(
        Notice("unsure-beginning", text + " Samples of such pages help to tell.") for text in notices
    )


def _check_format(options: LayoutOptions, pages: int) -> None:
    """Raise an error when there are several pages and the format holds one; called before the pages are read."""
    if options.format in ("json", "html") or (options.format_named and options.format != "png"):
        return
    several = f"this document has {pages} pages"
    if options.format_named:
        raise InvalidOption(
            f"format: png shows one page, and {several}; name one as `page`, or ask for json.", "format"
        )
    raise NotAcceptable(
        f"Several pages are answered as JSON or HTML, or as an archive where format=pagexml or alto is sent, and "
        f"{several}; name one as `page` to have it as {'a picture' if options.format == 'png' else 'a file'}."
    )


def _recognize_document(
    seen: Sequence[_SeenPage],
    gathered: Sequence[SegmentedPage],
    versions: Sequence[VersionedModel],
    models: Sequence[ModelDocument],
    options: LayoutOptions,
    settings: LayoutSettings,
    before_ms: dict[str, float],
    matched: Sequence[Recognition],
) -> DocumentReply:
    """The reply about one document: `gathered`, `before_ms` and `matched` are of what was done for all pages."""
    timings_ms = dict(before_ms)
    features = content_features(settings.content_features)
    parameters = RecognitionParameters(explain=options.explain)
    with timed("matching", timings_ms):
        view, recognition = recognize_view(
            gathered,
            [(page.measured.page, page.measured.fine) for page in seen],
            versions,
            lambda pages: recognize_document(
                [page for page, _ in pages],
                versions,
                features.names,
                parameters,
                matched=matched if pages is gathered else (),
            ),
        )
        completed = [
            replace(
                placed,
                recognition=complete_recognition(fine, placed.recognition, versions, parameters, features),
            )
            for placed, (_, fine) in zip(recognition.pages, view, strict=True)
        ]
        recognition = replace(recognition, pages=tuple(with_tables(completed, versions, models)))
    documents = [
        describe_page(placed, page.measured, options, models)
        for placed, page in zip(recognition.pages, seen, strict=True)
    ]
    body, media_type = b"", MEDIA_TYPES["json"]
    with timed("encode", timings_ms, ENCODING_BEGINS):
        if options.format == "html":
            elements = [elements_of(placed, models) for placed in recognition.pages]
            pictures = [page.picture for page in seen]
            pages_of_file = [HtmlPage(*page) for page in zip(documents, pictures, elements, strict=True)]
            body, media_type = render_html(pages_of_file, options.image_name), MEDIA_TYPES["html"]
        elif options.format != "json":
            body, media_type = _archive(recognition, seen, options), ARCHIVE
    for stage in dict.fromkeys(stage for page in seen for stage in page.timings_ms):
        timings_ms[stage] = sum(page.timings_ms.get(stage, 0.0) for page in seen)
    answer = DocumentResult(
        id="",
        class_=describe_class(recognition.chosen),
        classes=describe_classes(recognition.classes),
        unknown_probability=round(recognition.unknown_probability, 4),
        pages=[],
        tables=tables_of_document([described.tables for described in documents]),
        warnings=describe_warnings(_notices(recognition)),
        timings_ms=describe_timings(timings_ms),
    )
    for described, page in zip(documents, seen, strict=True):
        described.timings_ms = describe_timings(page.timings_ms)
    pages = [
        DocumentPage(
            described,
            to_json_ready(page_to_document(placed.recognition.page)),
            page.source.upload,
            b"" if page.measured.kept is None else page.measured.kept.body,
        )
        for described, placed, page in zip(documents, recognition.pages, seen, strict=True)
    ]
    return DocumentReply(body, media_type, answer, pages)


def _measure(source: PageSource, options: LayoutOptions, settings: LayoutSettings) -> _SeenPage:
    """The measured page without its picture, since the pictures of all pages need much memory; for HTML as a JPEG."""
    timings_ms: dict[str, float] = {}
    engine = ocr_engine(options.language) if options.ocr else None
    with naming_page(source.label, source.field):
        measured = measure_page(source.decode, None, None, engine, options, settings, timings_ms)
    picture = b""
    if options.format == "html" and measured.image is not None:
        picture = encode_kept_picture(measured.image, MOST_PICTURE_BYTES).body
    return _SeenPage(source, replace(measured, image=None), picture, timings_ms)


def _notices(recognition: DocumentRecognition) -> tuple[Notice, ...]:
    """Warnings about pages that do not resemble the pages of the document's class."""
    if recognition.chosen is None:
        return ()
    return tuple(
        Notice(
            "unlike-page",
            f"pages[{index}] does not look like a page of {recognition.chosen.name}: something that was sent along, or "
            "of a layout that no model of its later pages has learned.",
        )
        for index, placed in enumerate(recognition.pages)
        if placed.part == "continuation" and placed.recognition.chosen is None
    )


def _archive(recognition: DocumentRecognition, seen: Sequence[_SeenPage], options: LayoutOptions) -> bytes:
    """A PAGE-XML or ALTO file for each page."""
    files = []
    for placed, page in zip(recognition.pages, seen, strict=True):
        source = page.source
        name = options.image_names[source.upload] if options.image_names else options.image_name
        if source.label.endswith(f"page {source.page + 1}"):
            name += f"#page={source.page + 1}"
        files.append(write_xml(placed.recognition, options, name, page.measured.orientation))
    return zip_files(files)


def zip_files(files: Sequence[bytes]) -> bytes:
    """A ZIP archive with the XML file of each page, the first one named `page-01.xml`."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for number, file in enumerate(files, 1):
            archive.writestr(f"page-{number:02d}.xml", file)
    return buffer.getvalue()

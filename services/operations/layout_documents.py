"""Recognition of a document of one or more pages (images, TIFF files, PDFs): its class and its pages' labels."""

import io
import zipfile
from collections.abc import Sequence
from dataclasses import replace

from services.contract.answers.layout import DocumentResult
from services.contract.layout import (
    MEDIA_TYPES,
    DocumentPage,
    DocumentReply,
    LayoutOptions,
    LayoutReply,
    LayoutSettings,
    ModelDocument,
)
from services.errors import InvalidOption, NotAcceptable
from services.imaging.page_images import PageSource, naming_page, open_pages
from services.layout.exchange.page_json import page_to_document
from services.layout.pipeline import complete_recognition, content_features
from services.layout.recognition.documents import (
    DocumentParameters,
    DocumentRecognition,
    recognize_document,
)
from services.layout.recognition.page_recognition import RecognitionParameters
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
from services.rectify.results import Orientation

ARCHIVE = "application/zip"
MOST_PICTURE_BYTES = 4 * 2**20
"""Of a page's picture that waits for the labels of all pages, from which HTML cuts its figures."""


def recognize_uploads(
    images: Sequence[bytes],
    zones: bytes | None,
    zones_file: bytes | None,
    models: Sequence[ModelDocument],
    options: LayoutOptions,
    settings: LayoutSettings,
) -> LayoutReply | DocumentReply:
    """Class and labels of the pages in `images`, in zones, or in an image with its zones.

    An image may hold several pages (TIFF, PDF). Zones describe one page, the first page of their image.


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
        if len(pages) == 1:
            return recognize_picture(pages[0].decode, None, None, models, options, settings)
        _check_format(options, len(pages))
        check_installed(options.language)  # an error must come before the work
        return _recognize_pages(pages, models, options, settings)


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


def _recognize_pages(
    sources: Sequence[PageSource],
    models: Sequence[ModelDocument],
    options: LayoutOptions,
    settings: LayoutSettings,
) -> DocumentReply:
    timings_ms: dict[str, float] = {}
    features = content_features(settings.content_features)
    parameters = RecognitionParameters(explain=options.explain)
    with timed("models", timings_ms, 0.0):
        versions = open_models(models)
    measured_pages, pictures, page_timings = [], [], []
    for index, source in enumerate(sources):
        timings: dict[str, float] = {}
        share = MATCHING_BEGINS / len(sources)
        with progress_within(index * share, (index + 1) * share):
            measured, picture = _measure(source, options, settings, timings)
        measured_pages.append(measured)
        pictures.append(picture)
        page_timings.append(timings)
    report_progress("matching", MATCHING_BEGINS)
    with timed("matching", timings_ms):
        recognition = recognize_document(
            [measured.page for measured in measured_pages],
            versions,
            features.names,
            DocumentParameters(recognition=parameters),
        )
        recognition = replace(
            recognition,
            pages=tuple(
                replace(
                    placed,
                    recognition=complete_recognition(
                        measured.fine, placed.recognition, versions, parameters, features
                    ),
                )
                for placed, measured in zip(recognition.pages, measured_pages, strict=True)
            ),
        )
    documents = [
        describe_page(placed, measured, options, models)
        for placed, measured in zip(recognition.pages, measured_pages, strict=True)
    ]
    body, media_type = b"", MEDIA_TYPES["json"]
    with timed("encode", timings_ms, ENCODING_BEGINS):
        if options.format == "html":
            elements = [elements_of(placed, models) for placed in recognition.pages]
            pages_of_file = [HtmlPage(*page) for page in zip(documents, pictures, elements, strict=True)]
            body, media_type = render_html(pages_of_file, options.image_name), MEDIA_TYPES["html"]
        elif options.format != "json":
            turns = [measured.orientation for measured in measured_pages]
            body, media_type = _archive(recognition, sources, options, turns), ARCHIVE
    for stage in dict.fromkeys(stage for timings in page_timings for stage in timings):
        timings_ms[stage] = sum(timings.get(stage, 0.0) for timings in page_timings)
    answer = DocumentResult(
        id="",
        class_=describe_class(recognition.chosen),
        classes=describe_classes(recognition.classes),
        unknown_probability=round(recognition.unknown_probability, 4),
        pages=[],
        warnings=describe_warnings(_notices(recognition)),
        timings_ms=describe_timings(timings_ms),
    )
    for described, timings in zip(documents, page_timings, strict=True):
        described.timings_ms = describe_timings(timings)
    pages = [
        DocumentPage(
            described,
            to_json_ready(page_to_document(placed.recognition.page)),
            source.upload,
            b"" if measured.kept is None else measured.kept.body,
        )
        for described, placed, measured, source in zip(
            documents, recognition.pages, measured_pages, sources, strict=True
        )
    ]
    return DocumentReply(body, media_type, answer, pages)


def _measure(
    source: PageSource, options: LayoutOptions, settings: LayoutSettings, timings_ms: dict[str, float]
) -> tuple[MeasuredPage, bytes]:
    """The measured page without its picture, since the pictures of all pages need much memory; for HTML as a JPEG."""
    engine = ocr_engine(options.language) if options.ocr else None
    with naming_page(source.label, source.field):
        measured = measure_page(source.decode, None, None, engine, options, settings, timings_ms)
    picture = b""
    if options.format == "html" and measured.image is not None:
        picture = encode_kept_picture(measured.image, MOST_PICTURE_BYTES).body
    return replace(measured, image=None), picture


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


def _archive(
    recognition: DocumentRecognition,
    sources: Sequence[PageSource],
    options: LayoutOptions,
    turns: Sequence[Orientation | None],
) -> bytes:
    """A PAGE-XML or ALTO file for each page."""
    files = []
    for placed, source, turn in zip(recognition.pages, sources, turns, strict=True):
        name = options.image_names[source.upload] if options.image_names else options.image_name
        if source.label.endswith(f"page {source.page + 1}"):
            name += f"#page={source.page + 1}"
        files.append(write_xml(placed.recognition, options, name, turn))
    return zip_files(files)


def zip_files(files: Sequence[bytes]) -> bytes:
    """A ZIP archive with the XML file of each page, the first one named `page-01.xml`."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for number, file in enumerate(files, 1):
            archive.writestr(f"page-{number:02d}.xml", file)
    return buffer.getvalue()

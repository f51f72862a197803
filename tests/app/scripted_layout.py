"""Scripted operations of /layout: they do what their uploads say, and answer as if the first model fitted."""

import json
from typing import Any

from pydantic import ValidationError

from app.schemas.layout_samples import PageBody
from services import errors
from services.contract.answers.layout import DocumentResult, LayoutResult
from services.contract.answers.page import FlatPage, Warning
from services.contract.images import Encoding
from services.contract.layout import MEDIA_TYPES as LAYOUT_MEDIA_TYPES
from services.contract.layout import (
    DocumentPage,
    DocumentReply,
    DrawnPage,
    KeptResult,
    LayoutFormat,
    LayoutOptions,
    LayoutReply,
    LayoutSettings,
    ModelDocument,
    RenderedResults,
    StackReply,
)
from services.contract.rectify import RectifyParameters
from tests.app.scripted_results import document as rectified_document
from tests.app.scripted_results import layout_document
from tests.app.scripts import JPEG, follow

PAGE: dict[str, Any] = {
    "width": 20,
    "height": 30,
    "zones": [{"id": "z1", "box": [1, 2, 9, 8]}, {"id": "z2", "box": [1, 10, 9, 12]}],
}


def recognize_layout(
    images: list[bytes],
    zones: bytes | None,
    zones_file: bytes | None,
    models: list[ModelDocument],
    options: LayoutOptions,
    settings: LayoutSettings,
) -> LayoutReply | DocumentReply | StackReply:
    """Follow the script in the images, then answer as if the first model fitted, with what was asked.

    Several images are pages of a document; `pages-N` in one of them makes N pages of it. In a stack each image is a
    document, and the second one is not sure to be.
    """
    field = "image[{}]" if len(images) > 1 else "image"
    verbs = [follow(image, field.format(index)) for index, image in enumerate(images)]
    counts = [int(verb.removeprefix(b"pages-")) if verb.startswith(b"pages-") else 1 for verb in verbs]
    uploads = [index for index, count in enumerate(counts) for _ in range(count)]
    page = PAGE if zones is None else sent_page(zones)
    labels = [label for model in models[:1] for label in labels_of(model.document)]
    asked = {
        "options": options,
        "settings": settings,
        "models": [(model.name, model.version) for model in models],
        "continues": {model.name: model.continues for model in models if model.continues},
        "parts": [part is not None for part in (images or None, zones, zones_file)],
    }
    document = layout_document(page, models, labels, asked)
    media_type = LAYOUT_MEDIA_TYPES[options.format]
    body = b"" if options.format == "json" else f"page as {options.format}".encode()
    picture = b""
    if options.keep_image_bytes and images:
        picture = JPEG + b"page"
        document["image"] = {"width": 20, "height": 30, "bytes": len(picture)}
    if options.rectify:
        flat = rectified_document(RectifyParameters(), Encoding(), None)
        document["page"] = {name: flat[name] for name in FlatPage.model_fields}
    if not options.split and (len(uploads) < 2 or options.page is not None):
        drawn = DrawnPage(1.5, 1.25, 0, 60) if options.format == "png" else None
        return LayoutReply(body, media_type, _result(document), page, picture, drawn)
    names = ("class", "classes", "unknown_probability", "warnings", "timings_ms")
    whole = DocumentResult.model_validate({"id": "", "pages": [], **{name: document[name] for name in names}})
    media_type = media_type if options.format in ("json", "html") else "application/zip"
    document |= {"part": "first" if models else None, "document_class": models[0].name if models else None}
    pages = [DocumentPage(_result(document), page, upload, picture) for upload in uploads]
    if options.split:
        return StackReply([_part_of_stack(whole, pages, upload) for upload in range(len(images))])
    return DocumentReply(body, media_type, whole, pages)


def _part_of_stack(whole: DocumentResult, pages: list[DocumentPage], upload: int) -> DocumentReply:
    answer = whole.model_copy(deep=True)
    if upload == 1:
        answer.warnings.append(Warning(code="unsure-beginning", detail="pages[0] may go on (0.30)."))
    return DocumentReply(b"", "application/json", answer, [page for page in pages if page.upload == upload])


def _result(document: dict[str, Any]) -> LayoutResult:
    return LayoutResult.model_validate({"id": "", **document})


def recognize_again(
    page: dict[str, Any],
    models: list[ModelDocument],
    settings: LayoutSettings,
    words: bool,
    in_document: tuple[str, str | None] | None = None,
) -> dict[str, Any]:
    """As if the first model fitted; it is surer by a hundredth for each lesson that it has learned.

    A page of a document, whose class is sent along, has another probability of being unknown.
    """
    labels = [label for model in models[:1] for label in labels_of(model.document)]
    document: dict[str, Any] = layout_document(page, models, labels, {})
    lessons = len(json.loads(models[0].document).get("taught", []))
    zones = [{**zone, "confidence": zone["confidence"] + 0.01 * lessons} for zone in document["zones"]]
    found = {name: document[name] for name in ("class", "classes", "unknown_probability", "match")}
    if in_document is not None:
        found["unknown_probability"] = 0.0625
    return {**found, "zones": zones}


def resize_kept_picture(picture: bytes, width: int) -> bytes:
    """The picture, and what was asked."""
    return picture + f" at most {width} wide".encode()


def render_results(
    pages: list[KeptResult], format: LayoutFormat, settings: LayoutSettings
) -> RenderedResults:
    """Of every page its zones, the bytes of its picture, and the elements that settings name; for XML its name."""
    if format in ("pagexml", "alto"):
        names = " | ".join(page.name for page in pages)
        return RenderedResults(names.encode(), LAYOUT_MEDIA_TYPES[format])
    shown = [
        f"{len(page.document['zones'])} zones, {len(page.picture)} bytes, {dict(page.elements)}"
        for page in pages
    ]
    return RenderedResults(" | ".join(shown).encode(), LAYOUT_MEDIA_TYPES[format])


def sent_page(zones: bytes) -> dict[str, Any]:
    """The page, if it has the documented form; of numbers the strict check tells 1.0 from 1, which JSON does not."""
    try:
        page: dict[str, Any] = json.loads(zones, parse_float=lambda text: _plain(float(text)))
        PageBody.model_validate_json(json.dumps(page), strict=True)
    except ValidationError as error:
        raise errors.InvalidOption(f"zones: {error.errors()[0]['msg']}.", "zones") from error
    except ValueError as error:
        raise errors.InvalidOption("zones: this is not JSON.", "zones") from error
    return page


def _plain(number: float) -> float:
    return int(number) if number.is_integer() else number


def labels_of(document: bytes) -> list[str]:
    return [node["label"] for node in json.loads(document)["nodes"] if node["label"]]

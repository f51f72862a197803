"""A page, or its zones -> document class and labels; labelled pages -> a layout model.

The app keeps models and samples; here they come in as its documents, and leave as such.
"""

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Literal

import numpy as np

from models.layout_graph import MOST_LABELS, InvalidLayout, LayoutModel, Page
from models.model_document import model_from_document, model_to_document
from services.arrays import RgbImage
from services.errors import InvalidModel, InvalidOption, TooLarge
from services.imaging.codec import ImageLimits, decode_image, encode_image
from services.layout.exchange.alto import write_alto
from services.layout.exchange.limits import ExchangeLimits
from services.layout.exchange.page_json import page_from_document, page_to_document
from services.layout.exchange.page_xml import write_page_xml
from services.layout.exchange.zones_file import read_zones_file
from services.layout.font_sizes import measure_font_classes
from services.layout.overlay import draw_overlay
from services.layout.pipeline import (
    complete_page,
    complete_sample,
    content_features,
    initialize_model,
    read_page,
    recognize,
)
from services.layout.recognition import RecognitionParameters
from services.layout.results import ClassMatch, MatchReport, Recognition
from services.ocr.engine import OcrEngine
from services.operations.reader import ocr_engine
from services.operations.replies import describe_warnings, timed, to_json_ready
from services.operations.stored_models import StoredModel, open_models
from services.rectify.parameters import RectifyParameters
from services.rectify.pipeline import rectify
from services.rectify.results import Notice

MEDIA_TYPES = {
    "json": "application/json",
    "pagexml": "application/xml",
    "alto": "application/xml",
    "png": "image/png",
}
EXPLAINED_TERMS = 1000
"""Terms of the cost that are told, largest first; a page of 500 zones has a million."""
FOUND = "found"
"""Key of a sample's second page: the zones that segmentation finds in its image, with the verified labels."""


@dataclass(frozen=True, slots=True)
class LayoutSettings:
    """What a page may cost (its image, the number of its zones, a file of them), and how it is read.

    `content_features` is the operator's settings file of content features (None: those that come along).
    """

    image: ImageLimits = field(default_factory=ImageLimits)
    max_zones: int = 500
    max_zones_file_bytes: int = 8 * 2**20
    content_features: Path | None = None


@dataclass(frozen=True, slots=True)
class LayoutOptions:
    """How a page is recognized, and how the answer is wanted."""

    rectify: bool = False
    ocr: bool = True
    format: Literal["json", "pagexml", "alto", "png"] = "json"
    explain: bool = False
    image_name: str = "page"
    """Of the upload; PAGE-XML and ALTO name the image that they are of."""


@dataclass(frozen=True, slots=True)
class LayoutReply:
    """What leaves the worker.

    `body` is the file that was asked for (empty for JSON), of type `media_type`; `document` the contract's
    result, but for its id; `page` the recognized page, with all that was measured.
    """

    body: bytes
    media_type: str
    document: dict[str, object]
    page: dict[str, object]


@dataclass(frozen=True, slots=True)
class ModelDraft:
    """A layout model that is no version yet, and its labels."""

    document: dict[str, object]
    labels: list[str]


@dataclass(frozen=True, slots=True, eq=False)
class _Sight:
    """A page as it is recognized, the picture of it if there is one, and what to know of it."""

    page: Page
    image: RgbImage | None
    notices: tuple[Notice, ...] = ()


def recognize_upload(
    image: bytes | None,
    zones: bytes | None,
    zones_file: bytes | None,
    models: Sequence[StoredModel],
    options: LayoutOptions,
    settings: LayoutSettings,
) -> LayoutReply:
    """Class and labels of a page: of an `image`, of `zones` (JSON) or a `zones_file`, or of an image and its zones.

    Raises
    ------
    UnsupportedMediaType, TooLarge, UndecodableImage
        When the image is none that is accepted.
    NoText
        When it shall be rectified and shows too little printed text for that.
    InvalidOption
        When the zones are none, or are not in the image's pixels.
    """
    timings_ms: dict[str, float] = {}
    engine = ocr_engine() if options.ocr else None
    with timed("models", timings_ms):
        versions = open_models(models)
    sight = _see(image, zones, zones_file, engine, options, settings, timings_ms)
    recognition = recognize(
        sight.page,
        versions,
        RecognitionParameters(explain=options.explain),
        content_features(settings.content_features),
    )
    timings_ms |= recognition.timings_ms
    with timed("encode", timings_ms):
        body = _encode(recognition, sight.image, options, settings)
    document = describe_recognition(recognition, explain=options.explain)
    document["warnings"] = describe_warnings(sight.notices)
    document["timings_ms"] = {stage: round(value, 1) for stage, value in timings_ms.items()}
    ready = to_json_ready(document)
    page = to_json_ready(page_to_document(recognition.page))
    return LayoutReply(body, MEDIA_TYPES[options.format], ready, page)


def measure_sample(image: bytes | None, zones: bytes, settings: LayoutSettings) -> dict[str, object]:
    """A labelled page with all that can be measured and read of it, as JSON; `FOUND` has it in our own zones.

    Content features of zones that have text are left out: they are computed when the model is made.

    Raises
    ------
    UnsupportedMediaType, TooLarge, UndecodableImage
        When the image is none that is accepted.
    InvalidOption
        When the zones are none, have no label, or are not in the image's pixels.
    """
    page = _read_zones(zones, settings)
    if all(zone.label is None for zone in page.zones):
        raise InvalidOption(
            "zones: give at least one zone its label; a page without any teaches nothing.", "zones"
        )
    picture = None if image is None else decode_image(image, settings.image).pixels
    _check_frame(page, picture)
    engine = None if picture is None else ocr_engine()
    verified, found = complete_sample(page, picture, engine, content_features(settings.content_features))
    document = _sample_document(verified)
    if found is not None:
        document[FOUND] = _sample_document(found)
    return document


def _sample_document(page: Page) -> dict[str, object]:
    kept = tuple(replace(zone, content={}) if zone.text else zone for zone in page.zones)
    document: dict[str, object] = to_json_ready(page_to_document(replace(page, zones=kept)))
    return document


def initialize_from_samples(
    name: str, samples: Sequence[dict[str, Any]], settings: LayoutSettings
) -> ModelDraft:
    """The layout model of these pages, as `measure_sample` has answered them.

    Raises
    ------
    InvalidOption
        When one of them is no page any more, by limits that have become narrower.
    """
    # Each was within its limits when it was stored.
    bounds = replace(_exchange_limits(settings), max_zones=max(settings.max_zones, 10_000))
    pages, found = [], []
    for index, sample in enumerate(samples):
        try:
            pages.append(page_from_document(sample, bounds))
            other = sample.get(FOUND)
            found.append(None if other is None else page_from_document(other, bounds))
        except InvalidLayout as error:
            raise InvalidOption(f"samples[{index}]: {error.detail}", f"samples[{index}]") from error
    labels = {zone.label for page in pages for zone in page.zones if zone.label is not None}
    if len(labels) > MOST_LABELS:
        raise InvalidOption(
            f"samples: they have {len(labels)} different labels; a model may have {MOST_LABELS}.", "samples"
        )
    return _draft(initialize_model(name, pages, content_features(settings.content_features), found))


def import_model(name: str, document: bytes) -> ModelDraft:
    """The layout model in a document, under `name`, as it will be kept.

    Raises
    ------
    InvalidModel
        When it is no layout model, is damaged, has a form that is not known here, or has another name.
    """
    try:
        told = json.loads(document)
        if isinstance(told, dict):
            told.setdefault("name", name)
        model = model_from_document(told)
    except (ValueError, RecursionError) as error:
        if isinstance(error, InvalidLayout):
            raise InvalidModel(error.detail, error.field) from error
        raise InvalidModel("The model is not JSON; send what GET /layout/models/{name} answers.") from error
    if model.name != name:
        raise InvalidModel(
            f"name: the model is called {model.name}, the path says {name}; leave the name out of the document "
            "to give it another one.",
            "name",
        )
    return _draft(model)


def describe_recognition(recognition: Recognition, *, explain: bool) -> dict[str, object]:
    """The contract's `LayoutResult`, but for its id, warnings and timings."""
    font_classes = dict(
        zip((zone.id for zone in recognition.page.zones), measure_font_classes(recognition.page), strict=True)
    )
    zones = []
    for labelled in recognition.zones:
        zone = labelled.zone
        zones.append(
            {
                "id": zone.id,
                "box": [round(value, 2) for value in zone.box],
                "label": labelled.label,
                "confidence": _rounded(labelled.confidence),
                "group": labelled.group,
                "order": labelled.order,
                "kind": zone.kind,
                "lines": zone.lines,
                "font_size": _rounded(zone.font_size),
                "font_class": font_classes[zone.id],
                "line_spacing": _rounded(zone.line_spacing),
                "weight": _rounded(zone.weight),
                "alignment": zone.alignment,
                "text": zone.text,
                "content": {name: round(value, 4) for name, value in zone.content.items() if value >= 5e-5},
            }
        )
    return {
        "width": _plain(recognition.page.width),
        "height": _plain(recognition.page.height),
        "class": None if recognition.chosen is None else _describe_class(recognition.chosen),
        "classes": [_describe_class(match) for match in recognition.classes],
        "unknown_probability": _rounded(recognition.unknown_probability),
        "zones": zones,
        "match": None if recognition.match is None else _describe_match(recognition.match, explain),
    }


def _describe_class(match: ClassMatch) -> dict[str, object]:
    return {
        "name": match.name,
        "model_version": match.model_version,
        "cost": _rounded(match.cost),
        "probability": _rounded(match.probability),
    }


def _describe_match(match: MatchReport, explain: bool) -> dict[str, object]:
    terms = [
        {"zone": term.zone, "other": term.other, "attribute": term.attribute, "cost": _rounded(term.cost)}
        for term in match.explanation[:EXPLAINED_TERMS]
    ]
    return {
        "cost": _rounded(match.cost),
        "node_cost": _rounded(match.node_cost),
        "edge_cost": _rounded(match.edge_cost),
        "count_cost": _rounded(match.count_cost),
        "optimal": match.optimal,
        "gap": _rounded(match.gap),
        "backbone": dict(match.backbone),
        "explanation": terms if explain else None,
    }


def _see(
    image: bytes | None,
    zones: bytes | None,
    zones_file: bytes | None,
    engine: OcrEngine | None,
    options: LayoutOptions,
    settings: LayoutSettings,
    timings_ms: dict[str, float],
) -> _Sight:
    features = content_features(settings.content_features)
    picture: RgbImage | None = None
    notices: tuple[Notice, ...] = ()
    if image is not None:
        with timed("decode", timings_ms):
            photo = decode_image(image, settings.image)
        picture = photo.pixels
        if options.rectify:
            flat = rectify(picture, RectifyParameters(), photo.focal_length_px, ocr_engine())
            picture, notices = flat.image, flat.warnings
            timings_ms |= flat.timings_ms
    if zones is None and zones_file is None:
        assert picture is not None, "the app has seen to that"
        with timed("zones", timings_ms):
            return _Sight(read_page(picture, engine, features), picture, notices)
    with timed("zones", timings_ms):
        page = (
            _read_zones(zones, settings)
            if zones is not None
            else _read_file(zones_file or b"", picture, settings)
        )
        _check_frame(page, picture)
        return _Sight(complete_page(page, picture, engine, features), picture, notices)


def _read_zones(zones: bytes, settings: LayoutSettings) -> Page:
    """The page in the contract's JSON."""
    try:
        return page_from_document(json.loads(zones), _exchange_limits(settings))
    except InvalidLayout as error:
        raise InvalidOption(f"{error.field or 'zones'}: {error.detail}", error.field or "zones") from error
    except (ValueError, RecursionError) as error:
        raise InvalidOption("zones: this is not JSON.", "zones") from error


def _read_file(data: bytes, picture: RgbImage | None, settings: LayoutSettings) -> Page:
    size = None if picture is None else (float(picture.shape[1]), float(picture.shape[0]))
    try:
        return read_zones_file(data, _exchange_limits(settings), size)
    except InvalidLayout as error:
        within = "" if error.field in {None, "zones_file"} else f"{error.field}: "
        raise InvalidOption(f"zones_file: {within}{error.detail}", "zones_file") from error


def _exchange_limits(settings: LayoutSettings) -> ExchangeLimits:
    return ExchangeLimits(max_zones=settings.max_zones, max_bytes=settings.max_zones_file_bytes)


def _check_frame(page: Page, picture: RgbImage | None) -> None:
    """Zones and image must be of one size, for their pixels are the same."""
    if picture is None:
        return
    height, width = picture.shape[:2]
    if abs(page.width - width) > 1 or abs(page.height - height) > 1:
        raise InvalidOption(
            f"zones: they are on a page of {page.width:g} x {page.height:g} pixels, the image has {width} x {height}; "
            "give them in the image's pixels.",
            "zones",
        )


def _encode(
    recognition: Recognition, picture: RgbImage | None, options: LayoutOptions, settings: LayoutSettings
) -> bytes:
    if options.format == "pagexml":
        return write_page_xml(recognition, options.image_name, datetime.now(UTC))
    if options.format == "alto":
        return write_alto(recognition, options.image_name, datetime.now(UTC))
    if options.format == "png":
        paper = _blank_page(recognition.page, settings) if picture is None else picture
        return encode_image(draw_overlay(paper, recognition), "png")
    return b""


def _blank_page(page: Page, settings: LayoutSettings) -> RgbImage:
    """White paper to draw zones on that came without an image."""
    width, height = max(1, math.ceil(page.width)), max(1, math.ceil(page.height))
    if width * height > settings.image.max_pixels or max(width, height) > settings.image.max_side_px:
        raise TooLarge(
            f"format: a page of {width} x {height} pixels is too large to be drawn; "
            f"the limit is {settings.image.max_megapixels:g} megapixels.",
            "format",
        )
    return np.full((height, width, 3), 255, np.uint8)


def _draft(model: LayoutModel) -> ModelDraft:
    labels = [label for label in model.labels if label is not None]
    return ModelDraft(to_json_ready(model_to_document(model)), labels)


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(float(value), 4)


def _plain(side_px: float) -> float:
    """A whole number without its fraction, as clients expect of an image's size."""
    return int(side_px) if float(side_px).is_integer() else float(side_px)

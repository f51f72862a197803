"""A page, or its zones -> document class and labels, by the models that the app hands in."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Literal

import numpy as np

from models.layout_graph import Page
from services.arrays import RgbImage
from services.errors import TooLarge
from services.imaging.codec import decode_image, encode_image
from services.layout.exchange.alto import write_alto
from services.layout.exchange.page_json import page_to_document
from services.layout.exchange.page_xml import write_page_xml
from services.layout.overlay import draw_overlay
from services.layout.pipeline import (
    complete_page,
    content_features,
    read_page,
    recognize,
)
from services.layout.recognition import RecognitionParameters
from services.layout.results import Recognition
from services.ocr.engine import OcrEngine
from services.operations.layout_result import describe_recognition
from services.operations.page_zones import LayoutSettings, check_frame, read_file, read_zones
from services.operations.reader import ocr_engine
from services.operations.replies import ENCODING_BEGINS, describe_warnings, timed, to_json_ready
from services.operations.stored_models import StoredModel, open_models
from services.progress import progress_within, report_progress
from services.rectify.parameters import RectifyParameters
from services.rectify.pipeline import rectify
from services.rectify.results import Notice

MEDIA_TYPES = {
    "json": "application/json",
    "pagexml": "application/xml",
    "alto": "application/xml",
    "png": "image/png",
}
FLATTENED, MATCHING_BEGINS = 0.6, 0.8
"""Shares of the work that are done, as a rule, when a photo is flat and when its zones are read."""


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
    with timed("models", timings_ms, 0.0):
        versions = open_models(models)
    sight = _see(image, zones, zones_file, engine, options, settings, timings_ms)
    report_progress("matching", MATCHING_BEGINS)
    recognition = recognize(
        sight.page,
        versions,
        RecognitionParameters(explain=options.explain),
        content_features(settings.content_features),
    )
    timings_ms |= recognition.timings_ms
    with timed("encode", timings_ms, ENCODING_BEGINS):
        body = _encode(recognition, sight.image, options, settings)
    document = describe_recognition(recognition, explain=options.explain)
    document["warnings"] = describe_warnings(sight.notices)
    document["timings_ms"] = {stage: round(value, 1) for stage, value in timings_ms.items()}
    ready = to_json_ready(document)
    page = to_json_ready(page_to_document(recognition.page))
    return LayoutReply(body, MEDIA_TYPES[options.format], ready, page)


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
    seen = 0.05
    notices: tuple[Notice, ...] = ()
    if image is not None:
        with timed("decode", timings_ms, 0.02):
            photo = decode_image(image, settings.image)
        picture = photo.pixels
        if options.rectify:
            with progress_within(0.05, FLATTENED):
                flat = rectify(picture, RectifyParameters(), photo.focal_length_px, ocr_engine())
            picture, notices = flat.image, flat.warnings
            timings_ms |= flat.timings_ms
            seen = FLATTENED
    if zones is None and zones_file is None:
        assert picture is not None, "the app has seen to that"
        with timed("zones", timings_ms, seen):
            return _Sight(read_page(picture, engine, features), picture, notices)
    with timed("zones", timings_ms, seen):
        page = (
            read_zones(zones, settings)
            if zones is not None
            else read_file(zones_file or b"", picture, settings)
        )
        check_frame(page, picture)
        return _Sight(complete_page(page, picture, engine, features), picture, notices)


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

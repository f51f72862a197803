"""Recognition of one page: from its image or its zones, and the models, to its class and labels."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import partial

import numpy as np

from services.arrays import RgbImage
from services.contract.answers.layout import LayoutResult
from services.contract.answers.page import FlatPage
from services.contract.fields import FieldSetting
from services.contract.html import HtmlElement
from services.contract.layout import (
    MEDIA_TYPES,
    DrawnPage,
    LayoutOptions,
    LayoutReply,
    LayoutSettings,
    ModelDocument,
)
from services.contract.rectify import Origin, RectifyParameters
from services.errors import TooLarge
from services.imaging.codec import decode_image, encode_image
from services.imaging.page_images import PagePicture
from services.layout.exchange.alto import write_alto
from services.layout.exchange.page_json import page_to_document
from services.layout.exchange.page_xml import write_page_xml
from services.layout.page import Page
from services.layout.pipeline import (
    complete_page,
    complete_recognition,
    content_features,
    fine_page,
    recognize,
)
from services.layout.recognition.documents import PageInDocument, place_page
from services.layout.recognition.page_recognition import RecognitionParameters
from services.layout.recognition.results import Recognition
from services.layout.rendering.overlay import draw_overlay, place_of_page
from services.layout.segmentation import FinePage
from services.notices import Notice
from services.ocr.engine import OcrEngine
from services.ocr.printed_words import NOT_KNOWN
from services.ocr.tesseract import default_language
from services.operations.kept_picture import KeptPicture, encode_kept_picture
from services.operations.layout_html import HtmlPage, render_html
from services.operations.layout_result import describe_recognition
from services.operations.layout_tables import gather_tables, recognize_view, with_tables
from services.operations.page_reading import check_installed
from services.operations.page_zones import check_frame, read_file, read_zones
from services.operations.reader import ocr_engine
from services.operations.rectify import describe_flat_page
from services.operations.replies import (
    ENCODING_BEGINS,
    describe_orientation,
    describe_timings,
    describe_warnings,
    timed,
    to_json_ready,
)
from services.operations.stored_models import open_models
from services.operations.upright_reading import read_as_it_lies, read_upright
from services.progress import progress_within, report_progress
from services.rectify.pipeline import rectify
from services.rectify.results import Orientation
from services.text.printed_places import printed_in_view, printed_on_page

FLATTENED, MATCHING_BEGINS = 0.6, 0.8
"""Typical progress after flattening, and before matching."""


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredPage:
    """A page with measured zones, its picture (None without one), and warnings; its lines if we segmented it.

    `flat` describes the flat page if the page was flattened, and `kept` its picture if it shall be kept.
    `orientation` is the turn of the uploaded image to `image`; None where it was not looked for.
    """

    page: Page
    image: RgbImage | None
    notices: tuple[Notice, ...] = ()
    fine: FinePage | None = None
    flat: FlatPage | None = None
    kept: KeptPicture | None = None
    orientation: Orientation | None = None


def recognize_upload(
    image: bytes | None,
    zones: bytes | None,
    zones_file: bytes | None,
    models: Sequence[ModelDocument],
    options: LayoutOptions,
    settings: LayoutSettings,
) -> LayoutReply:
    """Class and labels of a page, given as an `image`, as `zones` (JSON) or a `zones_file`, or as image and zones.

    Raises
    ------
    UnsupportedMediaType, TooLarge, UndecodableImage
        When the image is not accepted.
    NoText
        When the image shall be rectified and shows too little printed text.
    InvalidOption
        When the zones are invalid, or are not in pixels of the image, or when the language is not installed.
    """
    decode = None if image is None else partial(_decode, image, settings)
    return recognize_picture(decode, zones, zones_file, models, options, settings)


def _decode(image: bytes, settings: LayoutSettings) -> PagePicture:
    picture = decode_image(image, settings.document.image)
    return PagePicture(picture.pixels, picture.focal_length_px)


def recognize_picture(
    decode: Callable[[], PagePicture] | None,
    zones: bytes | None,
    zones_file: bytes | None,
    models: Sequence[ModelDocument],
    options: LayoutOptions,
    settings: LayoutSettings,
) -> LayoutReply:
    """Class and labels of a page; `decode` returns its picture. Otherwise like `recognize_upload`."""
    timings_ms: dict[str, float] = {}
    engine = None
    if decode is not None:
        check_installed(options.language)  # an error must come before the work
        engine = ocr_engine(options.language) if options.ocr else None
    with timed("models", timings_ms, 0.0):
        versions = open_models(models)
    measured = measure_page(decode, zones, zones_file, engine, options, settings, timings_ms)
    report_progress("matching", MATCHING_BEGINS)
    features, parameters = (
        content_features(settings.content_features),
        RecognitionParameters(explain=options.explain),
    )
    plain = [(measured.page, measured.fine)]
    [(_, fine)], recognition = recognize_view(
        gather_tables(plain, versions, features),
        plain,
        versions,
        lambda pages: recognize(pages[0][0], versions, parameters, features),
    )
    recognition = complete_recognition(fine, recognition, versions, parameters, features)
    timings_ms |= recognition.timings_ms
    [placed] = with_tables([place_page(recognition, versions)], versions, models)
    recognition = placed.recognition
    answer = describe_page(placed, measured, options, models)
    with timed("encode", timings_ms, ENCODING_BEGINS):
        body = (
            render_html([HtmlPage(answer, measured.image, elements_of(placed, models))], options.image_name)
            if options.format == "html"
            else _encode(recognition, measured, options, settings)
        )
    answer.timings_ms = describe_timings(timings_ms)
    page = to_json_ready(page_to_document(recognition.page))
    picture = b"" if measured.kept is None else measured.kept.body
    drawn = DrawnPage(*place_of_page(recognition)) if options.format == "png" else None
    return LayoutReply(body, MEDIA_TYPES[options.format], answer, page, picture, drawn)


def describe_page(
    placed: PageInDocument,
    measured: MeasuredPage,
    options: LayoutOptions,
    models: Sequence[ModelDocument],
) -> LayoutResult:
    """The answer without its id and timings; `models` are those that competed."""
    was_read = any(each.zone.words for each in placed.recognition.zones)
    answer = describe_recognition(
        placed.recognition, explain=options.explain, words=options.words, fields=_types(placed, models)
    )
    answer.part = placed.part
    answer.document_class = placed.document_class
    answer.language = (options.language or default_language()) if was_read else None
    answer.page = measured.flat
    turned = measured.orientation
    answer.orientation = None if turned is None else describe_orientation(turned, turned.rotation_deg)
    answer.image = None if measured.kept is None else measured.kept.describe()
    answer.warnings = describe_warnings(measured.notices)
    return answer


def _types(placed: PageInDocument, models: Sequence[ModelDocument]) -> dict[str, FieldSetting]:
    """The types of the fields by label."""
    return {label: each for model in _models_of(placed, models) for label, each in model.fields.items()}


def elements_of(placed: PageInDocument, models: Sequence[ModelDocument]) -> dict[str, HtmlElement]:
    """The elements of HTML files by label, as the settings of `models` name them."""
    return {label: each for model in _models_of(placed, models) for label, each in model.elements.items()}


def _models_of(placed: PageInDocument, models: Sequence[ModelDocument]) -> list[ModelDocument]:
    """The model of the document's class, then the one that gave the labels, whose settings override those."""
    classes = placed.recognition.classes
    chosen = placed.recognition.chosen or (classes[0] if classes else None)
    names = (placed.document_class, None if chosen is None else chosen.name)
    return [model for name in names for model in models if model.name == name]


def measure_page(
    decode: Callable[[], PagePicture] | None,
    zones: bytes | None,
    zones_file: bytes | None,
    engine: OcrEngine | None,
    options: LayoutOptions,
    settings: LayoutSettings,
    timings_ms: dict[str, float],
) -> MeasuredPage:
    """The page with measured zones, from a picture (flattened if `options` say so) or from zones.

    The function adds its timings to `timings_ms`.
    """
    features = content_features(settings.content_features)
    picture: RgbImage | None = None
    seen = 0.05
    notices: tuple[Notice, ...] = ()
    described: FlatPage | None = None
    origin: Origin = "photo"
    printed = NOT_KNOWN
    if decode is not None:
        with timed("decode", timings_ms, 0.02):
            photo = decode()
        picture, origin = photo.pixels, photo.origin
        size = picture.shape[1], picture.shape[0]
        if options.rectify:
            with progress_within(0.05, FLATTENED):
                reader = ocr_engine(options.language)
                flat = rectify(picture, RectifyParameters(), photo.focal_length_px, reader, photo.origin)
            described = describe_flat_page(flat, size)
            picture, notices = flat.image, flat.warnings
            printed = printed_in_view(origin, size, flat.mesh, (picture.shape[1], picture.shape[0]))
            timings_ms |= flat.timings_ms
            seen = FLATTENED
    if zones is None and zones_file is None:
        assert picture is not None, "the app has seen to that"
        with timed("zones", timings_ms, seen):
            upright = (
                read_as_it_lies(picture, engine, printed)
                if options.rectify
                else read_upright(picture, engine, origin)
            )
            page, fine = fine_page(upright.image, upright.words, features)
        kept = _keep(upright.image, options, timings_ms)
        notices = (*notices, *upright.notices)
        return MeasuredPage(page, upright.image, notices, fine, described, kept, upright.orientation)
    kept = None if picture is None else _keep(picture, options, timings_ms)
    with timed("zones", timings_ms, seen):
        if zones is not None:
            page = read_zones(zones, settings)
        else:
            page, left_out = read_file(zones_file or b"", picture, settings)
            notices += left_out
        check_frame(page, picture)
        if picture is not None and not options.rectify:
            printed = printed_on_page(origin, (picture.shape[1], picture.shape[0]))
        page = complete_page(page, picture, engine, features, printed)
        return MeasuredPage(page, picture, notices, kept=kept)


def _keep(picture: RgbImage, options: LayoutOptions, timings_ms: dict[str, float]) -> KeptPicture | None:
    if not options.keep_image_bytes:
        return None
    with timed("picture", timings_ms):
        return encode_kept_picture(picture, options.keep_image_bytes)


def write_xml(
    recognition: Recognition, options: LayoutOptions, image_name: str, orientation: Orientation | None = None
) -> bytes:
    """The labelled page as a file of PAGE-XML, or of ALTO; `orientation` is that of the image."""
    if not options.words:
        zones = (replace(each, zone=replace(each.zone, words=())) for each in recognition.zones)
        recognition = replace(recognition, zones=tuple(zones))
    write = write_alto if options.format == "alto" else write_page_xml
    turned_deg = 0 if orientation is None else orientation.rotation_deg
    return write(recognition, image_name, datetime.now(UTC), turned_deg)


def _encode(
    recognition: Recognition, measured: MeasuredPage, options: LayoutOptions, settings: LayoutSettings
) -> bytes:
    if options.format in ("pagexml", "alto"):
        return write_xml(recognition, options, options.image_name, measured.orientation)
    if options.format == "png":
        paper = _blank_page(recognition.page, settings) if measured.image is None else measured.image
        return encode_image(draw_overlay(paper, recognition), "png")
    return b""


def _blank_page(page: Page, settings: LayoutSettings) -> RgbImage:
    """A white image of the page's size, for zones without an image."""
    width, height = max(1, math.ceil(page.width)), max(1, math.ceil(page.height))
    if (
        width * height > settings.document.image.max_pixels
        or max(width, height) > settings.document.image.max_side_px
    ):
        raise TooLarge(
            f"format: a page of {width} x {height} pixels is too large to be drawn; "
            f"the limit is {settings.document.image.max_megapixels:g} megapixels.",
            "format",
        )
    return np.full((height, width, 3), 255, np.uint8)

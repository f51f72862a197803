"""The steps of layout recognition, in their order: image -> zones -> content features -> class and labels."""

import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from services.arrays import GrayImage, RgbImage
from services.imaging.channels import luminance
from services.imaging.dark_bands import with_bands_turned
from services.imaging.illumination import flatten_illumination
from services.imaging.rulings import without_grids
from services.layout.content.content_features import ContentFeatures, content_features
from services.layout.content.zone_texts import fill_texts
from services.layout.grouping.joined_page import join_page, join_recognition
from services.layout.grouping.joining import find_groups
from services.layout.grouping.line_parts import take_out_parts
from services.layout.grouping.merged_zones import with_merged_doubts
from services.layout.grouping.regrouping import regroup_page
from services.layout.grouping.zones_of_label import with_zones_of_labels, without_equal_values
from services.layout.learning.initialization import initialize_model
from services.layout.learning.label_transfer import transfer_labels
from services.layout.model.layout_model import LayoutModel, PieceStatistics
from services.layout.page import Page
from services.layout.recognition.label_calibration import with_believable_labels
from services.layout.recognition.page_recognition import (
    RecognitionParameters,
    VersionedModel,
    recognize_page,
    relabelled,
)
from services.layout.recognition.results import Recognition
from services.layout.segmentation import (
    FinePage,
    compose_page,
    compose_with_lines,
    measure_zones,
    segment_finely,
    segment_page,
)
from services.layout.tables.learning import gathered_samples, learn_table, table_page
from services.ocr.engine import OcrEngine, Word
from services.ocr.lost_print import with_lost_print
from services.ocr.printed_words import NOT_KNOWN, PrintedWords, believed_words
from services.ocr.softer_reading import read_best

__all__ = [
    "VersionedModel",
    "complete_page",
    "complete_recognition",
    "complete_sample",
    "content_features",
    "fine_page",
    "initialize_model",
    "initialize_with_items",
    "read_all",
    "read_page",
    "read_words",
    "readable",
    "recognize",
    "regroup",
    "regroup_pieces",
    "segment_read_page",
    "with_believable_labels",
]

LIGHT_GROUND = 96
"""Median gray level of the darkest photos of white paper; light print on dark ground stays below."""


def read_page(image: RgbImage, engine: OcrEngine | None) -> Page:
    """The page of an image (H, W, 3): its zones with measurements, and with texts if there is an OCR engine."""
    return fine_page(image, read_words(luminance(image), engine))[0]


def fine_page(
    image: RgbImage, words: list[Word] | None, features: ContentFeatures | None = None
) -> tuple[Page, FinePage]:
    """The page of an image with its `words`, and the lines that its zones are made of, to be regrouped (`regroup`)."""
    fine = segment_finely(luminance(image), words)
    return (features or content_features()).measure_page(compose_page(fine)), fine


def segment_read_page(
    image: RgbImage, engine: OcrEngine, limit_s: float = float("inf"), printed: PrintedWords = NOT_KNOWN
) -> tuple[Page, list[Word], bool]:
    """The zones of a flat page (H, W, 3) in reading order, and all its words: see `read_all`."""
    gray = luminance(image)
    words, cut = read_all(gray, engine, limit_s, printed)
    return segment_page(gray, words), words, cut


def complete_page(
    page: Page,
    image: RgbImage | None,
    engine: OcrEngine | None,
    features: ContentFeatures | None = None,
    printed: PrintedWords = NOT_KNOWN,
) -> Page:
    """A page with zones from a client, completed with measurements and texts from the image and with content features.

    Values that the zones already have are kept.
    """
    if image is not None:
        gray = luminance(image)
        # Only text zones without text are a reason to run OCR, since rules and figures usually have none.
        unread = any(zone.kind == "text" and not zone.text for zone in page.zones)
        unread |= not any(zone.text for zone in page.zones)
        words = read_words(gray, engine, printed) if unread else None
        page = fill_texts(measure_zones(gray, page), words or [])
    return (features or content_features()).measure_page(page)


def complete_sample(
    page: Page, image: RgbImage | None, engine: OcrEngine | None, features: ContentFeatures | None = None
) -> tuple[Page, Page | None]:
    """A completed verified page, and the same page in the zones that segmentation finds in its image.

    People draw zones that no segmenter finds (a logo with letters in it, a list as one zone). A model needs both views:
    the verified zones and those of later requests. The second page has the labels of the verified zones that cover its
    zones (`transfer_labels`). It is None without an image, and when both have the same zones.
    """
    if image is None:
        return complete_page(page, None, None, features), None
    gray = luminance(image)
    words = read_words(gray, engine)
    features = features or content_features()
    verified = features.measure_page(fill_texts(measure_zones(gray, page), words or []))
    found = features.measure_page(transfer_labels(page, segment_page(gray, words)))
    same = {zone.box for zone in found.zones} == {zone.box for zone in page.zones}
    taught = any(zone.label is not None for zone in found.zones)
    return verified, found if taught and not same else None


def initialize_with_items(
    name: str,
    samples: Sequence[Page],
    features: ContentFeatures | None,
    found: Sequence[Page | None],
    items: Sequence[str],
) -> LayoutModel:
    """The model of a class (`initialize_model`) with its table, whose columns have the labels `items`."""
    pages = [table_page(page, other, items) for page, other in zip(samples, found, strict=True)]
    table = learn_table(pages, items) if items else None
    if table is None:
        return initialize_model(name, samples, features, found)
    verified, gathered = gathered_samples(samples, found, table)
    return replace(initialize_model(name, verified, features, gathered), table=table)


def recognize(
    page: Page,
    models: Sequence[VersionedModel],
    parameters: RecognitionParameters | None = None,
    features: ContentFeatures | None = None,
) -> Recognition:
    """Class of a completed page and labels of its zones."""
    started = time.perf_counter()
    features = features or content_features()
    page = features.measure_page(page)
    measured_ms = (time.perf_counter() - started) * 1000
    recognition = recognize_page(page, models, features.names, parameters or RecognitionParameters())
    return replace(recognition, timings_ms={"content": measured_ms, **recognition.timings_ms})


def complete_recognition(
    fine: FinePage | None,
    seen: Recognition,
    models: Sequence[VersionedModel],
    parameters: RecognitionParameters | None = None,
    features: ContentFeatures | None = None,
) -> Recognition:
    """A recognition with its zones regrouped, if we segmented the page, and with labels that can be believed."""
    if fine is not None:
        fine, seen = _with_parts(fine, seen, models, parameters, features)
        seen = regroup(fine, seen, models, parameters, features)
    if seen.chosen is not None:
        best = _chosen(seen, models)
        seen = with_zones_of_labels(with_merged_doubts(seen, _pieces_of(best)), best.model)
    return with_believable_labels(seen, models)


def _with_parts(
    fine: FinePage,
    seen: Recognition,
    models: Sequence[VersionedModel],
    parameters: RecognitionParameters | None = None,
    features: ContentFeatures | None = None,
) -> tuple[FinePage, Recognition]:
    """The page with the parts of its lines that the nearest class labels taken out, and its recognition.

    A page that fits no class may fit one with its parts apart: then all classes compete again.
    """
    if not seen.classes:
        return fine, seen
    features = features or content_features()
    parameters = parameters or RecognitionParameters()
    nearest = next(each for each in models if each.model.name == seen.classes[0].name)
    cut = take_out_parts(fine, nearest.model, features)
    if cut is fine:
        return fine, seen
    page = features.measure_page(compose_page(cut))
    if seen.chosen is not None:
        return cut, relabelled(seen, page, nearest, features.names, parameters)
    again = recognize_page(page, models, features.names, parameters)
    return (fine, seen) if again.chosen is None else (cut, again)


def regroup(
    fine: FinePage,
    seen: Recognition,
    models: Sequence[VersionedModel],
    parameters: RecognitionParameters | None = None,
    features: ContentFeatures | None = None,
) -> Recognition:
    """A recognition of the zones of `fine`, regrouped as the model of the page's class explains them best.

    Zones are first cut and joined where that changes labels (`regroup_pieces`). Then pieces with one label are put
    together; they keep it, and all other zones are labelled again. The class stays. So does a page that fits no model.
    """
    if seen.chosen is None:
        return seen
    features = features or content_features()
    parameters = parameters or RecognitionParameters()
    best = _chosen(seen, models)
    seen, lines = regroup_pieces(fine, seen, models, parameters, features)
    joined = _join_pieces(fine, seen, lines, best, features)
    if joined is seen:
        return seen
    again = relabelled(joined, joined.page, best, features.names, parameters)
    # A zone was put together because its pieces have one label, so it keeps that.
    zones = (
        old if new.zone.pieces and new.label != old.label else replace(new, several=old.several)
        for old, new in zip(joined.zones, again.zones, strict=True)
    )
    return replace(again, zones=tuple(zones))


def regroup_pieces(
    fine: FinePage,
    seen: Recognition,
    models: Sequence[VersionedModel],
    parameters: RecognitionParameters,
    features: ContentFeatures,
) -> tuple[Recognition, tuple[tuple[int, ...], ...]]:
    """A recognition of a known class, its zones cut and joined where that changes labels, and the lines of these."""
    best, lines = _chosen(seen, models), compose_with_lines(fine)[1]
    page, lines, several = regroup_page(fine, seen.page, lines, best.model, features)
    if page is not seen.page:
        seen = relabelled(seen, page, best, features.names, parameters)
    zones = (replace(each, several=doubt) for each, doubt in zip(seen.zones, several, strict=True))
    return replace(seen, zones=tuple(zones)), lines


def _chosen(seen: Recognition, models: Sequence[VersionedModel]) -> VersionedModel:
    assert seen.chosen is not None, "a page of no class keeps its zones"
    name = seen.chosen.name
    return next(each for each in models if each.model.name == name)


def _pieces_of(model: VersionedModel) -> dict[str, PieceStatistics]:
    return {node.label: node.pieces for node in model.model.nodes if node.label is not None}


def _join_pieces(
    fine: FinePage,
    seen: Recognition,
    lines: tuple[tuple[int, ...], ...],
    model: VersionedModel,
    features: ContentFeatures,
) -> Recognition:
    """The recognition with pieces of one zone put together; the same where none are."""
    groups = find_groups(seen.zones, seen.page, _pieces_of(model))
    groups = without_equal_values(groups, seen.zones, model.model)
    if len(groups) == len(seen.page.zones):
        return seen
    page, ordered = join_page(fine, seen.page, lines, groups)
    return join_recognition(seen, features.measure_page(page), ordered)


def read_words(
    gray: GrayImage, engine: OcrEngine | None, printed: PrintedWords = NOT_KNOWN
) -> list[Word] | None:
    """Words of a page; None without an engine."""
    return None if engine is None else read_all(gray, engine, printed=printed)[0]


def read_all(
    gray: GrayImage, engine: OcrEngine, limit_s: float = float("inf"), printed: PrintedWords = NOT_KNOWN
) -> tuple[list[Word], bool]:
    """Words of a page (H, W): those `printed` on it, and those that the engine reads beside them in `limit_s`.

    The last is whether words were left unread, because the time was over.
    """
    ends_s = time.process_time() + limit_s
    printed = believed_words(printed, gray, engine)
    if printed.words and printed.is_all:
        return list(printed.words), False
    even = readable(gray)
    words, cut = read_best(even, engine, limit_s)
    words = with_lost_print(even, printed.joined(words), engine, ends_s)
    cut |= time.process_time() >= ends_s
    # A line that was read again may have taken the place of printed words.
    return printed.joined(words), cut


def readable(gray: GrayImage) -> GrayImage:
    """The page (H, W) in even light, with dark print in its dark bands and without the grids of its tables.

    An engine with a global threshold loses half of the words in shadows, and letters in bands. A page with dark ground
    is left as it is.
    """
    if np.median(gray[::8, ::8]) < LIGHT_GROUND:
        return gray
    # Large bands are taken for a shadow when light is evened; what is in a shadow is a band in even light only.
    even = flatten_illumination(with_bands_turned(gray))
    return without_grids(with_bands_turned(even))

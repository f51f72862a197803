"""The steps of layout recognition, in their order: image -> zones -> content features -> class and labels."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np

from services.arrays import GrayImage, RgbImage
from services.contract.layout_learning import Learner
from services.imaging.illumination import flatten_illumination
from services.layout.content.content_features import ContentFeatures
from services.layout.content.zone_texts import fill_texts
from services.layout.learning.feedback import LearnedModel, VerifiedPage
from services.layout.learning.feedback import learn_from_feedback as learn
from services.layout.learning.initialization import initialize_model as initialize_from_samples
from services.layout.learning.label_transfer import transfer_labels
from services.layout.learning.training import TrainedModel, train_on_samples
from services.layout.model.layout_model import LayoutModel
from services.layout.page import Page
from services.layout.recognition.page_recognition import RecognitionParameters, VersionedModel, recognize_page
from services.layout.recognition.results import Recognition
from services.layout.segmentation import measure_zones, segment_page
from services.ocr.engine import OcrEngine, Word

__all__ = [
    "VerifiedPage",
    "VersionedModel",
    "complete_page",
    "complete_sample",
    "content_features",
    "initialize_model",
    "learn_from_feedback",
    "read_page",
    "recognize",
    "train_model",
]

LIGHT_GROUND = 96
"""Median gray level of the darkest photos of white paper; light print on dark ground stays below."""


@lru_cache(maxsize=4)
def content_features(settings: Path | None = None) -> ContentFeatures:
    """The content features of a settings file (None: those that come along), read once.

    Raises
    ------
    ValueError
        When the file is no such settings file; the message names the key.
    """
    return ContentFeatures.load(settings)


def read_page(image: RgbImage, engine: OcrEngine | None, features: ContentFeatures | None = None) -> Page:
    """Zones of a page image (H, W, 3) with all that is measured and, with an engine, read of them."""
    gray = _gray(image)
    words = _read_words(gray, engine)
    return (features or content_features()).measure_page(segment_page(gray, words))


def complete_page(
    page: Page, image: RgbImage | None, engine: OcrEngine | None, features: ContentFeatures | None = None
) -> Page:
    """A page whose zones came from elsewhere, with what they lack: measures and texts of the image, content.

    What the zones already have is kept.
    """
    if image is not None:
        gray = _gray(image)
        # Rules and figures have no text as a rule: those of a page that was read do not call for it to be read again.
        unread = any(zone.kind == "text" and not zone.text for zone in page.zones)
        unread |= not any(zone.text for zone in page.zones)
        words = _read_words(gray, engine) if unread else None
        page = fill_texts(measure_zones(gray, page), words or [])
    return (features or content_features()).measure_page(page)


def complete_sample(
    page: Page, image: RgbImage | None, engine: OcrEngine | None, features: ContentFeatures | None = None
) -> tuple[Page, Page | None]:
    """A verified page with what its zones lack, and the same page in the zones that we find in its image.

    People draw zones that no segmenter finds (a logo with letters in it, a list as one zone). A model that has seen
    both knows the pages of people and the pages that it will be asked about. The second one carries the labels of
    the verified zones that cover its own (`transfer_labels`); it is None without an image, and where the verified
    zones are the found ones.
    """
    if image is None:
        return complete_page(page, None, None, features), None
    gray = _gray(image)
    words = _read_words(gray, engine)
    features = features or content_features()
    verified = features.measure_page(fill_texts(measure_zones(gray, page), words or []))
    found = features.measure_page(transfer_labels(page, segment_page(gray, words)))
    same = {zone.box for zone in found.zones} == {zone.box for zone in page.zones}
    taught = any(zone.label is not None for zone in found.zones)
    return verified, found if taught and not same else None


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


def initialize_model(
    name: str,
    samples: Sequence[Page],
    features: ContentFeatures | None = None,
    found: Sequence[Page | None] | None = None,
) -> LayoutModel:
    """Layout graph model of a class from its verified pages (`initialization.initialize_model`).

    `found` has for each sample its page in the zones that we find in its image (`complete_sample`), or None.

    Raises
    ------
    ValueError
        When there is no sample with a zone.
    """
    features = features or content_features()
    verified = [features.measure_page(page) for page in samples]
    others = [
        None if page is None else features.measure_page(page) for page in found or [None] * len(samples)
    ]
    return initialize_from_samples(name, verified, others, features)


def learn_from_feedback(
    said: VerifiedPage,
    models: Mapping[str, LayoutModel],
    learners: Mapping[str, Learner],
    features: ContentFeatures,
) -> tuple[tuple[str | None, ...], dict[str, LearnedModel]]:
    """Labels of a verified page, and the models that have learned from it (`learning.feedback`)."""
    return learn(said, models, learners, features.names)


def train_model(
    model: LayoutModel,
    samples: Sequence[Page],
    found: Sequence[Page | None],
    rounds: int,
    learner: Learner,
    features: ContentFeatures,
    report: Callable[[float], None] = lambda share: None,
) -> TrainedModel:
    """The model after rounds over its verified pages (`learning.training`)."""
    verified = [features.measure_page(page) for page in samples]
    others = [None if page is None else features.measure_page(page) for page in found]
    return train_on_samples(model, verified, others, rounds, learner, features, report)


def _gray(image: RgbImage) -> GrayImage:
    return np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), np.uint8)


def _read_words(gray: GrayImage, engine: OcrEngine | None) -> list[Word] | None:
    """Words of a page in even light: shadows cost an engine that thresholds a page as a whole half of its words.

    A page whose ground is dark is read as it is; there is no light to even out.
    """
    if engine is None:
        return None
    is_light = np.median(gray[::8, ::8]) >= LIGHT_GROUND
    return engine.read_page(flatten_illumination(gray) if is_light else gray)

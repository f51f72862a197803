"""Initialization of a layout model from labelled pages, and import of models.

The app stores samples and models; the functions here take and return them as JSON documents.
"""

import json
from collections.abc import Sequence
from dataclasses import replace
from typing import Final, cast

from services.arrays import RgbImage
from services.contract.layout import LayoutSettings
from services.contract.layout_models import SEGMENTATION, MeasuredSample, ModelDraft
from services.contract.page_json import SampleJson
from services.errors import DocumentError, InvalidModel, InvalidOption
from services.imaging.codec import decode_image
from services.layout.exchange.page_json import page_from_document, page_to_document
from services.layout.model.layout_model import MOST_LABELS, LayoutModel
from services.layout.model.model_document import model_from_document, model_to_document
from services.layout.page import InvalidLayout, Page
from services.layout.pipeline import complete_sample, content_features, initialize_with_items
from services.layout.tables.learning import table_page
from services.layout.tables.sample_doubts import doubts_of_samples
from services.operations.page_reading import check_installed
from services.operations.page_zones import check_boxes, check_frame, exchange_limits, read_file, read_zones
from services.operations.reader import ocr_engine
from services.operations.replies import describe_warnings, to_json_ready

FOUND: Final = "found"
"""Key of a sample's second view: the zones that segmentation finds in its image, with the verified labels."""
MEASURED_BY: Final = "segmentation"
"""Key of the name of the segmentation that looked at a sample's image."""


def measure_sample(image: bytes | None, zones: bytes, settings: LayoutSettings) -> SampleJson:
    """A labelled page with all measurements and texts, as JSON; the key `FOUND` has the page in segmented zones.

    `zones` are JSON of the HTTP contract. Content features of zones with text are left out: initialization computes
    them from the text.

    Raises
    ------
    UnsupportedMediaType, TooLarge, UndecodableImage
        When the image is not accepted.
    InvalidOption
        When the zones are invalid or thinner than a pixel, have no label, or are not in pixels of the image.
    """
    page = read_zones(zones, settings)
    check_boxes(page)
    return _measured(
        page, None if image is None else decode_image(image, settings.document.image).pixels, settings
    )


def measure_sample_file(image: bytes | None, zones_file: bytes, settings: LayoutSettings) -> MeasuredSample:
    """The same for zones in a file of PAGE-XML, ALTO or JSON. Raises as `measure_sample`."""
    picture = None if image is None else decode_image(image, settings.document.image).pixels
    page, notices = read_file(zones_file, picture, settings)
    return MeasuredSample(_measured(page, picture, settings), describe_warnings(notices))


def _measured(page: Page, picture: RgbImage | None, settings: LayoutSettings) -> SampleJson:
    if all(zone.label is None for zone in page.zones):
        raise InvalidOption(
            "zones: give at least one zone its label; a page without any teaches nothing.", "zones"
        )
    return _complete(page, picture, settings)


def remeasure_sample(image: bytes, sample: SampleJson, settings: LayoutSettings) -> SampleJson:
    """A stored sample as `measure_sample` would make it today: its verified zones, and what is found in its image.

    Raises
    ------
    UnsupportedMediaType, TooLarge, UndecodableImage, InvalidOption
        When this release does not accept the image or the zones any more.
    """
    [page], _ = read_samples([sample], settings)
    return _complete(page, decode_image(image, settings.document.image).pixels, settings)


def _complete(page: Page, picture: RgbImage | None, settings: LayoutSettings) -> SampleJson:
    check_frame(page, picture)
    engine = None
    if picture is not None:
        check_installed(settings.language)
        engine = ocr_engine(settings.language)
    verified, found = complete_sample(page, picture, engine, content_features(settings.content_features))
    document = sample_document(verified)
    if found is not None:
        document[FOUND] = sample_document(found)
    if picture is not None:
        document[MEASURED_BY] = SEGMENTATION
    return document


def sample_document(page: Page) -> SampleJson:
    """The stored form of a labelled page, without the content features of zones with text."""
    kept = tuple(replace(zone, content={}) if zone.text else zone for zone in page.zones)
    document: SampleJson = to_json_ready(page_to_document(replace(page, zones=kept)))
    return document


def import_sample(document: bytes, settings: LayoutSettings) -> SampleJson:
    """A sample that another service has exported, checked and in its stored form.

    Raises
    ------
    InvalidOption
        When it is no valid page under the present limits, or has no label.
    """
    try:
        sample = json.loads(document)
        if not isinstance(sample, dict):
            raise InvalidOption("archive: a sample must be a JSON object.", "archive")
        [page], [found] = read_samples([cast(SampleJson, sample)], settings)
    except (ValueError, RecursionError) as error:
        if isinstance(error, DocumentError):
            raise
        raise InvalidOption("archive: a sample is not JSON.", "archive") from error
    if all(zone.label is None for zone in page.zones):
        raise InvalidOption("archive: a sample has no labels; it teaches nothing.", "archive")
    stored = sample_document(page)
    if found is not None:
        stored[FOUND] = sample_document(found)
    if isinstance(name := sample.get(MEASURED_BY), str):
        stored[MEASURED_BY] = name[:40]
    return stored


def initialize_from_samples(
    name: str, samples: Sequence[SampleJson], settings: LayoutSettings, items: Sequence[str] = ()
) -> ModelDraft:
    """The layout model of `samples`, documents made by `measure_sample`; `items` are the columns of its table.

    Raises
    ------
    InvalidOption
        When a sample is not a valid page under the present limits.
    """
    pages, found = read_samples(samples, settings)
    draft = draft_of(
        initialize_with_items(name, pages, content_features(settings.content_features), found, items)
    )
    cells = (
        [table_page(page, other, items) for page, other in zip(pages, found, strict=True)] if items else []
    )
    return replace(draft, warnings=describe_warnings(doubts_of_samples(cells, items)))


def read_samples(
    samples: Sequence[SampleJson], settings: LayoutSettings
) -> tuple[list[Page], list[Page | None]]:
    """The labelled pages of stored samples, and for each the page in segmented zones (None without one).

    Raises
    ------
    InvalidOption
        When a sample is not a valid page under the present limits, or the samples have too many labels.
    """
    # Limits may have been higher when the sample was stored.
    bounds = replace(exchange_limits(settings), max_zones=max(settings.max_zones, 10_000))
    pages: list[Page] = []
    found: list[Page | None] = []
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
    return pages, found


def import_model(name: str, document: bytes) -> ModelDraft:
    """The layout model in a JSON document, under `name`, in its stored form.

    Raises
    ------
    InvalidModel
        When the document is no layout model, is damaged, has an unknown format version, or has another name.
    """
    try:
        parsed = json.loads(document)
        if isinstance(parsed, dict):
            parsed.setdefault("name", name)
        model = model_from_document(parsed)
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
    return draft_of(model)


def draft_of(model: LayoutModel) -> ModelDraft:
    """The model in the form that the app stores."""
    labels = [label for label in model.labels if label is not None]
    return ModelDraft(to_json_ready(model_to_document(model)), labels)

"""A kept page, recognized again by newer models: its zones stay, class and labels may change."""

from collections.abc import Sequence
from dataclasses import replace
from typing import cast

from services.contract.layout import LayoutOptions, LayoutSettings, ModelDocument
from services.contract.page_json import PageJson
from services.contract.result_json import RecognitionJson
from services.layout.pipeline import content_features, recognize, with_believable_labels
from services.layout.recognition.documents import Part, place_again, place_page
from services.operations.layout import MeasuredPage, describe_page
from services.operations.layout_tables import with_tables
from services.operations.page_zones import read_kept_page
from services.operations.stored_models import open_models


def recognize_again(
    page: PageJson,
    models: Sequence[ModelDocument],
    settings: LayoutSettings,
    words: bool,
    document: tuple[str, Part | None] | None = None,
) -> RecognitionJson:
    """What is found anew, as JSON, of the answer about the page of a stored result; `words` as in `LayoutOptions`.

    `document` is for a page of a document: the class of the document, which stays, and the page's part in it.

    Raises
    ------
    InvalidModel
        When this release cannot read a model.
    InvalidOption
        When this release cannot read the page.
    """
    versions = open_models(models)
    features = content_features(settings.content_features)
    recognition = recognize(read_kept_page(page, settings), versions, None, features)
    placed = (
        place_page(recognition, versions)
        if document is None
        else place_again(recognition, *document, versions, features.names)
    )
    placed = replace(placed, recognition=with_believable_labels(placed.recognition, versions))
    [placed] = with_tables([placed], versions, models)
    measured = MeasuredPage(recognition.page, None)
    described = describe_page(placed, measured, LayoutOptions(words=words), models)
    found = described.model_dump(mode="json")
    return cast(RecognitionJson, {name: found[name] for name in RecognitionJson.__annotations__})

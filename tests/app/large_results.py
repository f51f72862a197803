"""Operations whose answers are as large as they may be, for tests of what the server does with them."""

import base64
import json
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from app.schemas.layout import result_of
from services.contract.answers.layout import DocumentResult
from services.contract.answers.learning import Change
from services.contract.answers.mosaic import MosaicResult
from services.contract.answers.rectify import PagesResult, RectifyResult
from services.contract.images import DocumentLimits, Encoding, PageReply
from services.contract.layout import (
    DocumentPage,
    DocumentReply,
    LayoutOptions,
    LayoutReply,
    LayoutSettings,
    ModelDocument,
)
from services.contract.layout_models import ModelDifference, ModelDraft
from services.contract.mosaic import MosaicLimits, MosaicParameters
from services.contract.operations import Operation
from services.contract.rectify import RectifyParameters
from tests.app.scripted import OPERATIONS
from tests.app.scripted_models import model_document
from tests.app.scripted_results import document as rectified_document
from tests.app.scripted_results import layout_document, mosaic_document

ZONES, PAGES, PHOTOS = 500, 20, 16
"""What the settings allow by default."""
_ROWS, _COLUMNS = 65, 49
_WORDS_OF_ZONE = 4
_IMAGE_BYTES = 20_000_000


def large_page(zones: int = ZONES, letters: int = 100) -> dict[str, Any]:
    """A page of many zones with texts."""
    return {
        "width": 3000,
        "height": 4000,
        "zones": [
            {"id": f"z{number}", "box": [1, 2, 9, 8], "label": f"label-{number}", "text": "a" * letters}
            for number in range(zones)
        ],
    }


def large_model(name: str, labels: int = 40_000) -> dict[str, Any]:
    """A model whose document has some megabytes."""
    document = model_document(name, *(f"label-{number}" for number in range(labels)))
    return {**document, "numbers": [[number / 7] * 20 for number in range(20_000)]}


def _mesh(points: str) -> dict[str, Any]:
    grid = [[(column / 7, row / 7) for column in range(_COLUMNS)] for row in range(_ROWS)]
    return {"rows": _ROWS, "columns": _COLUMNS, points: grid}


def rectify(
    uploads: list[bytes],
    parameters: RectifyParameters,
    encoding: Encoding,
    limits: DocumentLimits,
    journal: str = "",
    too_slow: str = "",
) -> PageReply:
    """As many pages as there are uploads, each with a mesh; a single one with its image."""
    image = base64.b64encode(bytes(_IMAGE_BYTES)).decode() if len(uploads) == 1 else None
    mesh = _mesh("source")
    document = {**rectified_document(parameters, encoding, image), "mesh": mesh}
    pages = [RectifyResult.model_validate(document) for _ in uploads]
    whole = PagesResult(pages=[*pages], warnings=[], timings_ms={})
    return PageReply(b"", "application/json", whole if len(uploads) > 1 else pages[0])


def mosaic(
    uploads: list[bytes], parameters: MosaicParameters, encoding: Encoding, limits: MosaicLimits
) -> PageReply:
    """A mosaic with a mesh of each photo, and its image."""
    document = mosaic_document(len(uploads), {}, base64.b64encode(bytes(_IMAGE_BYTES)).decode())
    placed = {
        "placed": True,
        "mesh": _mesh("target"),
        "scale": 1.25,
        "sharpness": 1.0,
        "covered_fraction": 0.0,
    }
    answer = MosaicResult.model_validate({**document, "patches": [placed] * len(uploads)})
    return PageReply(b"", "application/json", answer)


def recognize_layout(
    images: list[bytes],
    zones: bytes | None,
    zones_file: bytes | None,
    models: list[ModelDocument],
    options: LayoutOptions,
    settings: LayoutSettings,
) -> LayoutReply | DocumentReply:
    """A page, or as many as there are images, of many zones with their words."""
    if len(images) < 2:
        page = _recognized(models)
        return LayoutReply(b"", "application/json", page.answer, page.page, b"", None)
    pages = [_recognized(models) for _ in images]
    first = pages[0].answer
    names = ("class_", "classes", "unknown_probability", "warnings", "timings_ms")
    answer = DocumentResult(id="", pages=[], **{name: getattr(first, name) for name in names})
    return DocumentReply(b"", "application/json", answer, pages)


def _recognized(models: list[ModelDocument]) -> DocumentPage:
    page = large_page()
    document = layout_document(page, models, [], {})
    words = [
        {"text": "word", "box": [1.5, 2.5, 3.5, 4.5], "confidence": 0.5, "line": 0}
        for _ in range(_WORDS_OF_ZONE)
    ]
    fields = [
        {"label": f"label-{number}", "text": "a" * 100, "confidence": 0.5, "zones": [f"z{number}"]}
        for number in range(ZONES)
    ]
    shown = document["zones"]
    assert isinstance(shown, list)
    document |= {"zones": [{**zone, "words": words} for zone in shown], "fields": fields}
    answer = result_of(json.loads(json.dumps(document)), "")  # pickle would send what is equal once
    return DocumentPage(answer, page, 0)


def import_model(name: str, document: bytes) -> ModelDraft:
    """A large model."""
    model = large_model(name)
    return ModelDraft(model, [node["label"] for node in model["nodes"] if node["label"]])


def initialize_model(
    name: str, samples: list[dict[str, Any]], settings: LayoutSettings, items: Sequence[str] = ()
) -> ModelDraft:
    """The same."""
    return import_model(name, b"")


def compare_models(old: ModelDocument, new: ModelDocument, most: int) -> ModelDifference:
    """As many changes as are wanted."""
    change = Change(part="model", labels=["a" * 100] * 2, attribute="a", old=None, new=0.5)
    return ModelDifference(10 * most, [change] * most)


LARGE = replace(
    OPERATIONS,
    **{
        name: Operation(f"{__name__}:{name}")
        for name in (
            "rectify",
            "mosaic",
            "recognize_layout",
            "import_model",
            "initialize_model",
            "compare_models",
        )
    },
)

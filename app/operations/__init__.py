"""What the app asks of `services`, as functions that workers run: a module a flow, as in `services.operations`.

The imports are inside of the functions on purpose: they happen in the worker, so that the server process
loads no numpy and no OpenCV, and what crosses the border between them is plain data.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from app.operations.layout import (
    DocumentReply,
    LayoutFormat,
    LayoutOptions,
    LayoutReply,
    LayoutSettings,
    ModelDocument,
    PageReply,
    recognize_layout,
)
from app.operations.layout_discovery import StoredPage, propose_classes
from app.operations.layout_learning import Adaptation, FeedbackTask, Training, adapt_models, train_model
from app.operations.layout_models import (
    ModelDifference,
    ModelDraft,
    compare_models,
    import_model,
    initialize_model,
    measure_sample,
)
from app.operations.pages import (
    Encoding,
    Format,
    MosaicLimits,
    PagesFormat,
    Reply,
    SeveralFormat,
    UploadLimits,
    mosaic,
    rectify,
)
from services.mosaic.parameters import MosaicParameters
from services.rectify.parameters import RectifyParameters

__all__ = [
    "Adaptation",
    "DocumentReply",
    "Encoding",
    "FeedbackTask",
    "Format",
    "LayoutFormat",
    "LayoutOptions",
    "LayoutReply",
    "LayoutSettings",
    "ModelDifference",
    "ModelDocument",
    "ModelDraft",
    "MosaicLimits",
    "Operations",
    "PageReply",
    "PagesFormat",
    "Reply",
    "SeveralFormat",
    "StoredPage",
    "Training",
    "UploadLimits",
    "propose_classes",
]

PRELOADED = (
    "services.operations",
    "services.operations.layout_documents",
    "services.operations.layout_models",
    "services.operations.layout_learning",
    "services.operations.layout_diff",
    "services.operations.layout_discovery",
)
"""Loaded once, before the first worker exists; every worker starts with it."""

LayoutOperation = Callable[
    [list[bytes], bytes | None, bytes | None, list[ModelDocument], LayoutOptions, LayoutSettings],
    LayoutReply | DocumentReply,
]
SampleOperation = Callable[[bytes | None, bytes, LayoutSettings], dict[str, object]]
InitializeOperation = Callable[[str, list[dict[str, Any]], LayoutSettings], ModelDraft]
ProposeOperation = Callable[
    [list[StoredPage], dict[str, list[StoredPage]], LayoutSettings], dict[str, object]
]
ImportOperation = Callable[[str, bytes], ModelDraft]
AdaptOperation = Callable[[FeedbackTask, list[ModelDocument], LayoutSettings], Adaptation]
TrainOperation = Callable[[ModelDocument, list[dict[str, Any]], int, str, LayoutSettings], Training]
CompareOperation = Callable[[ModelDocument, ModelDocument, int], ModelDifference]
RectifyOperation = Callable[[bytes, RectifyParameters, Encoding, UploadLimits], Reply]
MosaicOperation = Callable[[list[bytes], MosaicParameters, Encoding, MosaicLimits], Reply]
WarmUp = Callable[[Path | None], dict[str, object]]


def warm_up(content_features: Path | None) -> dict[str, object]:
    """Load in this worker what a first request would wait for; what is at hand (`ocr`: its name, or None).

    `content_features` is the operator's settings file, if there is one; a bad one is an error here already.
    """
    from services.operations import warm_up as warm_up_services

    return warm_up_services(content_features)


@dataclass(frozen=True, slots=True)
class Operations:
    """The operations of one app; a test puts others in their place."""

    rectify: RectifyOperation = rectify
    mosaic: MosaicOperation = mosaic
    recognize_layout: LayoutOperation = recognize_layout
    measure_sample: SampleOperation = measure_sample
    initialize_model: InitializeOperation = initialize_model
    import_model: ImportOperation = import_model
    adapt_models: AdaptOperation = adapt_models
    train_model: TrainOperation = train_model
    compare_models: CompareOperation = compare_models
    propose_classes: ProposeOperation = propose_classes
    warm_up: WarmUp = warm_up
    preloaded: tuple[str, ...] = PRELOADED

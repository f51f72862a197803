"""What the app asks of `services`, as functions that workers run.

The imports are inside of the functions on purpose: they happen in the worker, so that the server process
loads no numpy and no OpenCV, and what crosses the border between them is plain data.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from services.mosaic.parameters import MosaicParameters
from services.rectify.parameters import RectifyParameters

if TYPE_CHECKING:
    from services.imaging.codec import ImageLimits
    from services.operations import EncodingOptions, page_zones, stored_models

Format = Literal["jpeg", "png", "webp", "tiff", "pdf", "json"]
LayoutFormat = Literal["json", "pagexml", "alto", "png"]

PRELOADED = (
    "services.operations",
    "services.operations.layout_documents",
    "services.operations.layout_models",
    "services.operations.layout_learning",
    "services.operations.layout_diff",
)
"""Loaded once, before the first worker exists; every worker starts with it."""


@dataclass(frozen=True, slots=True)
class UploadLimits:
    """What an upload may cost, judged from its header in the worker, before decoding."""

    max_bytes: int
    max_megapixels: float
    max_exif_bytes: int


@dataclass(frozen=True, slots=True)
class MosaicLimits:
    """What each photo of a mosaic may cost, and all of them together."""

    photo: UploadLimits
    max_megapixels: float


@dataclass(frozen=True, slots=True)
class Encoding:
    """How the answer is wanted; `format` None is the upload's own."""

    format: Format | None
    quality: int | None
    embed: bool


@dataclass(frozen=True, slots=True)
class Reply:
    """An image file (empty when JSON was asked for), its type, and the contract's result, ready for JSON."""

    body: bytes
    media_type: str
    document: dict[str, object]


@dataclass(frozen=True, slots=True)
class LayoutOptions:
    """How a page is recognized, and how the answer is wanted.

    `page` is the only one of several that is wanted, counted from 1; `asked` tells that `format` was asked for by name
    and does not follow from `Accept`.
    """

    rectify: bool
    ocr: bool
    format: LayoutFormat
    explain: bool
    image_name: str
    image_names: tuple[str, ...] = ()
    page: int | None = None
    asked: bool = True


@dataclass(frozen=True, slots=True)
class LayoutSettings:
    """What a page may cost (its image, the number of its zones, a file of them), what a document, and how it is read.

    `content_features` is the operator's settings file of content features (None: those that come along).
    """

    image: UploadLimits
    max_zones: int
    max_zones_file_bytes: int
    content_features: Path | None
    max_pages: int = 20
    max_document_megapixels: float = 200.0


@dataclass(frozen=True, slots=True)
class ModelDocument:
    """A version of a layout model, as JSON.

    `genre` is the one that its class was given, if it was; `continues` the class whose later pages it describes.
    """

    name: str
    version: int
    document: bytes
    genre: str | None = None
    continues: str | None = None


@dataclass(frozen=True, slots=True)
class LayoutReply:
    """A file (empty when JSON was asked for), its type, the contract's result, and the page it is of.

    `page` is what feedback needs later: the zones with all that was measured.
    """

    body: bytes
    media_type: str
    document: dict[str, object]
    page: dict[str, object]


@dataclass(frozen=True, slots=True)
class StoredPage:
    """A page as it is kept, unknown or a sample: its id, and its document."""

    id: str
    document: dict[str, Any]


@dataclass(frozen=True, slots=True)
class PageReply:
    """A page's result but for its id, and the page it is of."""

    document: dict[str, object]
    page: dict[str, object]


@dataclass(frozen=True, slots=True)
class DocumentReply:
    """The same of several pages: an archive of files (empty when JSON was asked for), the contract's `DocumentResult`
    but for its pages, and these."""

    body: bytes
    media_type: str
    document: dict[str, object]
    pages: list[PageReply]


@dataclass(frozen=True, slots=True)
class ModelDraft:
    """A layout model that is no version yet, and its labels."""

    document: dict[str, object]
    labels: list[str]


@dataclass(frozen=True, slots=True)
class FeedbackTask:
    """What a person said of a recognized page, beside what was found.

    `page` is the page of the kept result, `found_labels` the label of each of its zones there (of the class
    `found_class`; of the nearest one when that is None). `verified_class` None: the page is of no class. `labels` are
    those that were sent, maybe not of all zones: the others keep their label where the class was right, and take else
    the one that the verified class's model finds beside the named ones. `learners` tells how each model learns.
    """

    page: dict[str, Any]
    found_class: str | None
    found_labels: dict[str, str | None]
    verified_class: str | None
    labels: dict[str, str | None]
    learners: dict[str, str]


@dataclass(frozen=True, slots=True)
class Adaptation:
    """What a feedback makes of the models that it concerns.

    `documents` holds the new model of each of them by name; `verified_labels` the label of every zone, and `wrong`
    those that were found otherwise, each `{"zone", "found", "verified"}`. `costs` are those of both labellings under
    each model, `{"model", "found": {"before", "after"}, "verified": {"before", "after"}}`. `sample` is the verified
    page as `measure_sample` would answer it, of `zones` zones.
    """

    documents: dict[str, dict[str, Any]]
    verified_labels: dict[str, str | None]
    wrong: list[dict[str, Any]]
    costs: list[dict[str, Any]]
    sample: dict[str, Any]
    zones: int


@dataclass(frozen=True, slots=True)
class Training:
    """What rounds of training made of a model.

    `rounds` has one `{"round", "error", "held_out_error"}` for each, from round 0 on, which is initialization from
    the samples (or, when the model has seen more pages than there are samples, the model as it was); errors are
    shares of zones, the second None where no page is held out. `document` is the model after round `kept_round`.
    `stopped` says why there were no more: as many as were asked for, the error on held-out pages rose, or there was
    none left to learn from.
    """

    document: dict[str, Any]
    labels: list[str]
    rounds: list[dict[str, Any]]
    kept_round: int
    stopped: Literal["rounds", "held-out", "no-errors"]


@dataclass(frozen=True, slots=True)
class ModelDifference:
    """What changed from one version of a model to another: `total` entries, of which `changes` are the largest.

    Each is `{"part", "labels", "attribute", "old", "new"}`; `services.operations.layout_diff` tells what they mean.
    """

    total: int
    changes: list[dict[str, Any]]


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


def rectify(upload: bytes, parameters: RectifyParameters, encoding: Encoding, limits: UploadLimits) -> Reply:
    """Frontal flat view of an uploaded photo; raises the `DocumentError`s of `services.operations`."""
    from services.operations import rectify_upload

    reply = rectify_upload(upload, parameters, _encoding_options(encoding), _image_limits(limits))
    return Reply(reply.body, reply.media_type, reply.document)


def mosaic(
    uploads: list[bytes], parameters: MosaicParameters, encoding: Encoding, limits: MosaicLimits
) -> Reply:
    """The one page of several uploaded photos; raises the `DocumentError`s of `services.operations`."""
    from services.operations import MosaicImageLimits, mosaic_uploads

    reply = mosaic_uploads(
        uploads,
        parameters,
        _encoding_options(encoding),
        MosaicImageLimits(_image_limits(limits.photo), limits.max_megapixels),
    )
    return Reply(reply.body, reply.media_type, reply.document)


def recognize_layout(
    images: list[bytes],
    zones: bytes | None,
    zones_file: bytes | None,
    models: list[ModelDocument],
    options: LayoutOptions,
    settings: LayoutSettings,
) -> LayoutReply | DocumentReply:
    """Class and labels of a page, sent as an image, as `zones` (JSON), as a `zones_file`, or as image and zones; or
    of the pages of a document, sent as `images`, TIFF files and PDFs.

    Raises the `DocumentError`s of `services.operations`.
    """
    from services.operations import layout, layout_documents

    reply = layout_documents.recognize_uploads(
        images,
        zones,
        zones_file,
        _stored_models(models),
        layout.LayoutOptions(
            rectify=options.rectify,
            ocr=options.ocr,
            format=options.format,
            explain=options.explain,
            image_name=options.image_name,
            image_names=options.image_names,
            page=options.page,
            asked=options.asked,
        ),
        _layout_settings(settings),
    )
    if isinstance(reply, layout.LayoutReply):
        return LayoutReply(reply.body, reply.media_type, reply.document, reply.page)
    pages = [PageReply(page.document, page.page) for page in reply.pages]
    return DocumentReply(reply.body, reply.media_type, reply.document, pages)


def measure_sample(image: bytes | None, zones: bytes, settings: LayoutSettings) -> dict[str, object]:
    """A labelled page, made complete by its image; raises the `DocumentError`s of `services.operations`."""
    from services.operations import layout_models

    return layout_models.measure_sample(image, zones, _layout_settings(settings))


def initialize_model(name: str, samples: list[dict[str, Any]], settings: LayoutSettings) -> ModelDraft:
    """The layout model of `samples`; raises the `DocumentError`s of `services.operations`."""
    from services.operations import layout_models

    draft = layout_models.initialize_from_samples(name, samples, _layout_settings(settings))
    return ModelDraft(draft.document, draft.labels)


def import_model(name: str, document: bytes) -> ModelDraft:
    """The layout model in `document`, as it will be kept; raises the `DocumentError`s of `services.operations`."""
    from services.operations import layout_models

    draft = layout_models.import_model(name, document)
    return ModelDraft(draft.document, draft.labels)


def adapt_models(task: FeedbackTask, models: list[ModelDocument], settings: LayoutSettings) -> Adaptation:
    """What a person's correction of a page makes of `models`, the newest versions of the found and the verified class.

    Of a class without a version, or without a class, there is none among them; the answer has then no document of it.
    Raises the `DocumentError`s of `services.operations`.
    """
    from services.operations import layout_learning

    adaptation = layout_learning.adapt_models(
        layout_learning.FeedbackTask(
            task.page,
            task.found_class,
            task.found_labels,
            task.verified_class,
            task.labels,
            task.learners,
        ),
        _stored_models(models),
        _layout_settings(settings),
    )
    return Adaptation(
        adaptation.documents,
        adaptation.verified_labels,
        adaptation.wrong,
        adaptation.costs,
        adaptation.sample,
        adaptation.zones,
    )


def train_model(
    model: ModelDocument, samples: list[dict[str, Any]], rounds: int, learner: str, settings: LayoutSettings
) -> Training:
    """`model` after at most `rounds` rounds over `samples`; raises the `DocumentError`s of `services.operations`."""
    from services.operations import layout_learning

    (stored,) = _stored_models([model])
    training = layout_learning.train_model(stored, samples, rounds, learner, _layout_settings(settings))
    return Training(
        training.document, training.labels, training.rounds, training.kept_round, training.stopped
    )


def compare_models(old: ModelDocument, new: ModelDocument, most: int) -> ModelDifference:
    """The `most` largest changes from `old` to `new`, versions of one model, and how many there are.

    Raises the `DocumentError`s of `services.operations`.
    """
    from services.operations import layout_diff

    before, after = _stored_models([old, new])
    difference = layout_diff.compare_models(before, after, most)
    return ModelDifference(difference.total, difference.changes)


def _stored_models(models: list[ModelDocument]) -> "list[stored_models.StoredModel]":
    from services.operations import stored_models

    return [
        stored_models.StoredModel(
            model.name, model.version, model.document, genre=model.genre, continues=model.continues
        )
        for model in models
    ]


def propose_classes(
    unknown: list[StoredPage], classes: dict[str, list[StoredPage]], settings: LayoutSettings
) -> dict[str, object]:
    """New classes among unknown pages, and classes to merge or to split, by their samples."""
    from services.operations import layout_discovery

    def pages(kept: list[StoredPage]) -> list[layout_discovery.StoredPage]:
        return [layout_discovery.StoredPage(page.id, page.document) for page in kept]

    samples = {name: pages(kept) for name, kept in classes.items()}
    return layout_discovery.propose_classes(pages(unknown), samples, _layout_settings(settings))


def _layout_settings(settings: LayoutSettings) -> "page_zones.LayoutSettings":
    from services.operations import page_zones

    return page_zones.LayoutSettings(
        _image_limits(settings.image),
        settings.max_zones,
        settings.max_zones_file_bytes,
        settings.content_features,
        settings.max_pages,
        settings.max_document_megapixels,
    )


def _encoding_options(encoding: Encoding) -> "EncodingOptions":
    from services.operations import EncodingOptions

    return EncodingOptions(format=encoding.format, quality=encoding.quality, embed=encoding.embed)


def _image_limits(limits: UploadLimits) -> "ImageLimits":
    from services.imaging.codec import ImageLimits

    return ImageLimits(
        max_bytes=limits.max_bytes,
        max_megapixels=limits.max_megapixels,
        max_exif_bytes=limits.max_exif_bytes,
    )


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

"""Operations that do what the upload says, so that a test can have any fate befall a worker."""

import base64
import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import fields, replace
from pathlib import Path
from typing import Any, cast
from unittest.mock import patch

from pydantic import ValidationError

from app.schemas.layout_samples import PageBody
from services import errors
from services.contract.answers.layout import DocumentResult, LayoutResult
from services.contract.answers.learning import Change, CostChange, LabellingCosts, Round, WrongLabel
from services.contract.answers.mosaic import MosaicResult
from services.contract.answers.page import FlatPage, Warning
from services.contract.answers.proposals import Proposals
from services.contract.answers.rectify import PagesResult, RectifyResult
from services.contract.images import MEDIA_TYPES, DocumentLimits, Encoding, FailedPlace, PageReply
from services.contract.kept_pages import KeptPage as KeptPhoto
from services.contract.kept_pages import PageReading, PageWish, RenderedPage
from services.contract.layout import MEDIA_TYPES as LAYOUT_MEDIA_TYPES
from services.contract.layout import (
    DocumentPage,
    DocumentReply,
    DrawnPage,
    KeptResult,
    LayoutFormat,
    LayoutOptions,
    LayoutReply,
    LayoutSettings,
    ModelDocument,
    RenderedResults,
    StackReply,
)
from services.contract.layout_learning import (
    Adaptation,
    Correction,
    RevisedPage,
    TrainingReport,
    VerifiedPage,
)
from services.contract.layout_models import MeasuredSample, ModelDifference, ModelDraft, PageDocument
from services.contract.mosaic import MosaicLimits, MosaicParameters
from services.contract.operations import Operation, Operations
from services.contract.page_json import PageJson, SampleJson
from services.contract.rectify import RectifyParameters
from services.contract.worker_facts import WorkerFacts
from tests.app.scripted_results import CREASED_SHEET, layout_document, mosaic_document
from tests.app.scripted_results import document as rectified_document
from tests.app.scripts import JPEG, follow, upload


def rectify(
    uploads: list[bytes],
    parameters: RectifyParameters,
    encoding: Encoding,
    limits: DocumentLimits,
    journal: str = "",
    too_slow: str = "",
) -> PageReply:
    """Follow the scripts in the uploads, then answer with a document that tells what was asked.

    Of both pages there is one, unless the script says `pages-N`; `creased` answers a mesh. Several uploads are pages;
    those whose script is an error are failed pages.
    """
    if len(uploads) > 1:
        return _reply_of_uploads(uploads, parameters, encoding, Path(journal), too_slow)
    verb = follow(uploads[0], "image")
    if verb == b"unpicklable":
        return PageReply(lambda: None, "image/jpeg", None)  # type: ignore[arg-type]
    if parameters.pages == "both":
        return _reply_of_pages(verb, parameters, encoding)
    creased = {"kind": "curved", "surface": CREASED_SHEET} if verb == b"creased" else {}
    reply = _reply(encoding, lambda image: _rectified(parameters, encoding, image, creased))
    return replace(reply, kept=(kept_photo(parameters),)) if parameters.keep_photo else reply


def _reply_of_uploads(
    uploads: list[bytes], parameters: RectifyParameters, encoding: Encoding, journal: Path, too_slow: str
) -> PageReply:
    pages = _done(journal)
    if journal.stat().st_size:
        pages.append(_failed(errors.NotDoneInTime(too_slow, f"image[{len(pages)}]")))
    _write_done(journal, pages, len(uploads))
    for index, file in enumerate(uploads[len(pages) :], len(pages)):
        try:
            follow(file, f"image[{index}]")
            pages.append(rectified_document(parameters, encoding, None))
        except errors.DocumentError as error:
            pages.append(_failed(error))
        _write_done(journal, pages, len(uploads))
    return _reply_of_all(pages, encoding)


def bind_done_pages(journal: str, encoding: Encoding, reason: str) -> PageReply:
    """The pages that the call of `rectify` has written down before it was stopped."""
    pages = _done(Path(journal))
    if not pages:
        raise errors.NotDoneInTime(reason)
    count = json.loads(Path(journal).read_text(encoding="utf-8").splitlines()[0])
    missing = [_failed(errors.NotDoneInTime(reason, f"image[{index}]")) for index in range(len(pages), count)]
    return _reply_of_all([*pages, *missing], encoding)


def _done(journal: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in journal.read_text(encoding="utf-8").splitlines()[1:]]


def _write_done(journal: Path, pages: list[dict[str, Any]], count: int) -> None:
    journal.write_text("\n".join(map(json.dumps, [count, *pages])), encoding="utf-8")


def _failed(error: errors.DocumentError) -> dict[str, object]:
    return {"problem": {"code": error.code, "detail": error.detail, "field": error.field}}


def _reply_of_all(pages: list[dict[str, Any]], encoding: Encoding) -> PageReply:
    flat = [RectifyResult.model_validate(page) for page in pages if "problem" not in page]
    failed = tuple(
        FailedPlace(place, **page["problem"]) for place, page in enumerate(pages) if "problem" in page
    )
    whole = PagesResult(pages=flat, warnings=[], timings_ms={"decode": 1.25})
    if encoding.pages_format is None:
        raise errors.NotAcceptable(f"{len(pages)} pages, and the format holds one.", "format")
    body = b"" if encoding.pages_format == "json" else f"{len(pages)} as {encoding.pages_format}".encode()
    return PageReply(body, MEDIA_TYPES[encoding.pages_format], whole, failed=failed)


def _reply_of_pages(verb: bytes, parameters: RectifyParameters, encoding: Encoding) -> PageReply:
    count = int(verb.removeprefix(b"pages-")) if verb.startswith(b"pages-") else 1
    chosen = encoding.format if count == 1 else encoding.pages_format
    if count > 1 and chosen is None:
        raise errors.NotAcceptable(f"{count} pages, and the format holds one.", "format")
    embedded = base64.b64encode(b"flat").decode() if encoding.embed and chosen == "json" else None
    page = RectifyResult.model_validate(rectified_document(parameters, encoding, embedded))
    whole = PagesResult(
        pages=[page] * count,
        warnings=[Warning(code="whole", detail="of all pages")],
        timings_ms={"decode": 1.25},
    )
    body = b"" if chosen == "json" else f"{count} as {chosen}".encode()
    return PageReply(body, MEDIA_TYPES[chosen or "jpeg"], whole)


def mosaic(
    uploads: list[bytes], parameters: MosaicParameters, encoding: Encoding, limits: MosaicLimits
) -> PageReply:
    """Follow the script in every upload, then answer with a document that tells what was asked."""
    for index, file in enumerate(uploads):
        follow(file, f"images[{index}]")
    asked = {"options": parameters, "encoding": encoding, "limits": limits, "bytes": list(map(len, uploads))}
    return _reply(
        encoding, lambda image: MosaicResult.model_validate(mosaic_document(len(uploads), asked, image))
    )


def _rectified(
    parameters: RectifyParameters, encoding: Encoding, image: str | None, other: dict[str, object]
) -> RectifyResult:
    return RectifyResult.model_validate(rectified_document(parameters, encoding, image) | other)


def _reply(encoding: Encoding, describe: Callable[[str | None], RectifyResult | MosaicResult]) -> PageReply:
    embedded = base64.b64encode(b"flat").decode() if encoding.embed and encoding.format == "json" else None
    body = b"" if encoding.format == "json" else f"flat as {encoding.format}".encode()
    return PageReply(body, MEDIA_TYPES[encoding.format or "jpeg"], describe(embedded))


def kept_photo(parameters: RectifyParameters) -> KeptPhoto:
    """A real page of 80 x 60 pixels that is kept: red at its top, blue at its foot."""
    import numpy as np

    from services.imaging.codec import encode_image
    from services.imaging.page_images import PagePicture
    from services.operations.rectify import describe_page
    from services.rectify.kept_photo import keep_photo

    pixels = np.zeros((60, 80, 3), np.uint8)
    pixels[:30, :, 0] = pixels[30:, :, 2] = 200
    photo = PagePicture(pixels, None, "png", original=encode_image(pixels, "png"))
    result = keep_photo(pixels, errors.NoText("nothing is seen."))
    kept = describe_page(result, parameters, Encoding("json", max_width=40), photo).kept
    assert kept is not None
    return kept


MARKUP_READ = "<script>document.title='ran'</script><img/src=x/onerror=document.title='ran'>"
"""The only word of each kept page."""


@contextmanager
def _reading_markup() -> Iterator[None]:
    from services.ocr.engine import Word
    from services.operations import kept_text
    from services.text.page_text import PageText, ReadLine, TextBlock

    def read(view: Any, engine: object, language: str, mesh: Any) -> PageText:
        line = ReadLine((Word(MARKUP_READ, (10.0, 20.0, 70.0, 26.0), 0.9),))
        places = (((10.0, 20.0), (70.0, 20.0), (70.0, 26.0), (10.0, 26.0)),)
        return PageText(view.shape[1], view.shape[0], language, (TextBlock((line,)),), places)

    with patch.object(kept_text, "read_flat_page", read):
        yield


def render_kept_page(
    kept: KeptPhoto, wish: PageWish, encoding: Encoding, reading: PageReading | None = None
) -> tuple[PageReply, RenderedPage]:
    """The real operation, of a small page, on which `MARKUP_READ` is read."""
    from services.operations import kept_pages

    with _reading_markup():
        return kept_pages.render_kept_page(kept, wish, encoding, reading)


def bind_kept_pages(
    pages: list[KeptPhoto], encoding: Encoding, reading: PageReading | None = None
) -> PageReply:
    """The real operation, of small pages."""
    from services.operations import kept_pages

    with _reading_markup():
        return kept_pages.bind_kept_pages(pages, encoding, reading)


def show_kept_photo(bundle: bytes, width: int | None) -> bytes:
    """The real operation, of a small photo."""
    from services.operations import kept_pages

    return kept_pages.show_kept_photo(bundle, width)


PAGE: dict[str, Any] = {
    "width": 20,
    "height": 30,
    "zones": [{"id": "z1", "box": [1, 2, 9, 8]}, {"id": "z2", "box": [1, 10, 9, 12]}],
}


def recognize_layout(
    images: list[bytes],
    zones: bytes | None,
    zones_file: bytes | None,
    models: list[ModelDocument],
    options: LayoutOptions,
    settings: LayoutSettings,
) -> LayoutReply | DocumentReply | StackReply:
    """Follow the script in the images, then answer as if the first model fitted, with what was asked.

    Several images are pages of a document; `pages-N` in one of them makes N pages of it. In a stack each image is a
    document, and the second one is not sure to be.
    """
    field = "image[{}]" if len(images) > 1 else "image"
    verbs = [follow(image, field.format(index)) for index, image in enumerate(images)]
    counts = [int(verb.removeprefix(b"pages-")) if verb.startswith(b"pages-") else 1 for verb in verbs]
    uploads = [index for index, count in enumerate(counts) for _ in range(count)]
    page = PAGE if zones is None else _page(zones)
    labels = [label for model in models[:1] for label in _labels(model.document)]
    asked = {
        "options": options,
        "settings": settings,
        "models": [(model.name, model.version) for model in models],
        "continues": {model.name: model.continues for model in models if model.continues},
        "parts": [part is not None for part in (images or None, zones, zones_file)],
    }
    document = layout_document(page, models, labels, asked)
    media_type = LAYOUT_MEDIA_TYPES[options.format]
    body = b"" if options.format == "json" else f"page as {options.format}".encode()
    picture = b""
    if options.keep_image_bytes and images:
        picture = JPEG + b"page"
        document["image"] = {"width": 20, "height": 30, "bytes": len(picture)}
    if options.rectify:
        flat = rectified_document(RectifyParameters(), Encoding(), None)
        document["page"] = {name: flat[name] for name in FlatPage.model_fields}
    if not options.split and (len(uploads) < 2 or options.page is not None):
        drawn = DrawnPage(1.5, 1.25, 0, 60) if options.format == "png" else None
        return LayoutReply(body, media_type, _result(document), page, picture, drawn)
    names = ("class", "classes", "unknown_probability", "warnings", "timings_ms")
    whole = DocumentResult.model_validate({"id": "", "pages": [], **{name: document[name] for name in names}})
    media_type = media_type if options.format in ("json", "html") else "application/zip"
    document |= {"part": "first" if models else None, "document_class": models[0].name if models else None}
    pages = [DocumentPage(_result(document), page, upload, picture) for upload in uploads]
    if options.split:
        return StackReply([_part_of_stack(whole, pages, upload) for upload in range(len(images))])
    return DocumentReply(body, media_type, whole, pages)


def _part_of_stack(whole: DocumentResult, pages: list[DocumentPage], upload: int) -> DocumentReply:
    answer = whole.model_copy(deep=True)
    if upload == 1:
        answer.warnings.append(Warning(code="unsure-beginning", detail="pages[0] may go on (0.30)."))
    return DocumentReply(b"", "application/json", answer, [page for page in pages if page.upload == upload])


def _result(document: dict[str, Any]) -> LayoutResult:
    return LayoutResult.model_validate({"id": "", **document})


def recognize_again(
    page: dict[str, Any],
    models: list[ModelDocument],
    settings: LayoutSettings,
    words: bool,
    in_document: tuple[str, str | None] | None = None,
) -> dict[str, Any]:
    """As if the first model fitted; it is surer by a hundredth for each lesson that it has learned.

    A page of a document, whose class is sent along, has another probability of being unknown.
    """
    labels = [label for model in models[:1] for label in _labels(model.document)]
    document: dict[str, Any] = layout_document(page, models, labels, {})
    lessons = len(json.loads(models[0].document).get("taught", []))
    zones = [{**zone, "confidence": zone["confidence"] + 0.01 * lessons} for zone in document["zones"]]
    found = {name: document[name] for name in ("class", "classes", "unknown_probability", "match")}
    if in_document is not None:
        found["unknown_probability"] = 0.0625
    return {**found, "zones": zones}


def resize_kept_picture(picture: bytes, width: int) -> bytes:
    """The picture, and what was asked."""
    return picture + f" at most {width} wide".encode()


def render_results(
    pages: list[KeptResult], format: LayoutFormat, settings: LayoutSettings
) -> RenderedResults:
    """Of every page its zones, the bytes of its picture, and the elements that settings name; for XML its name."""
    if format in ("pagexml", "alto"):
        names = " | ".join(page.name for page in pages)
        return RenderedResults(names.encode(), LAYOUT_MEDIA_TYPES[format])
    shown = [
        f"{len(page.document['zones'])} zones, {len(page.picture)} bytes, {dict(page.elements)}"
        for page in pages
    ]
    return RenderedResults(" | ".join(shown).encode(), LAYOUT_MEDIA_TYPES[format])


def measure_sample(image: bytes | None, zones: bytes, settings: LayoutSettings) -> dict[str, object]:
    """Follow the script in the image, then the page as it was sent; in the image the same zones are found."""
    follow(image or b"", "image")
    page = _page(zones)
    return page if image is None else {**page, "found": page}


def measure_sample_file(image: bytes | None, zones: bytes, settings: LayoutSettings) -> MeasuredSample:
    """The same with a warning."""
    return MeasuredSample(measure_sample(image, zones, settings), [Warning(code="file", detail="of zones")])


def remeasure_sample(image: bytes, sample: dict[str, Any], settings: LayoutSettings) -> dict[str, object]:
    """Follow the script in the image, then the sample with the number of bytes of its image."""
    follow(image, "image")
    return {**sample, "segmentation": f"of {len(image)} bytes"}


def import_sample(document: bytes, settings: LayoutSettings) -> dict[str, object]:
    """The sample as it was exported."""
    return _page(document)


def _page(zones: bytes) -> dict[str, Any]:
    """The page, if it has the documented form; of numbers the strict check tells 1.0 from 1, which JSON does not."""
    try:
        page: dict[str, Any] = json.loads(zones, parse_float=lambda text: _plain(float(text)))
        PageBody.model_validate_json(json.dumps(page), strict=True)
    except ValidationError as error:
        raise errors.InvalidOption(f"zones: {error.errors()[0]['msg']}.", "zones") from error
    except ValueError as error:
        raise errors.InvalidOption("zones: this is not JSON.", "zones") from error
    return page


def _plain(number: float) -> float:
    return int(number) if number.is_integer() else number


def initialize_model(
    name: str, samples: list[dict[str, Any]], settings: LayoutSettings, items: Sequence[str] = ()
) -> ModelDraft:
    """A model that has the labels of the samples, and one for each column of the table."""
    zones = [zone for page in samples for zone in page["zones"]]
    labels = dict.fromkeys(zone["label"] for zone in zones if zone.get("label"))
    labels |= dict.fromkeys(f"column {label}" for label in items)
    script = str(zones[0].get("text") or "")
    follow(upload(script.removeprefix("do:")) if script.startswith("do:") else b"", "samples")
    return ModelDraft(model_document(name, *labels), list(labels))


def model_document(name: str, *labels: str) -> dict[str, object]:
    """What the scripted service takes for a model."""
    nodes = [{"label": None}, *({"label": label} for label in labels)]
    return {"format": "layout-graph-model", "format_version": 1, "name": name, "nodes": nodes}


def import_model(name: str, document: bytes) -> ModelDraft:
    """The document as it was sent, if it has the marks of a model."""
    try:
        model = json.loads(document)
    except ValueError as error:
        raise errors.InvalidModel("This is not JSON.") from error
    if not isinstance(model, dict) or not isinstance(model.get("format"), str):
        raise errors.InvalidModel("format: this is not a layout model.", "format")
    if type(model.get("format_version")) is not int:
        raise errors.InvalidModel("format_version: this is not one.", "format_version")
    follow(str(model.get("script", "")).encode(), "model")
    nodes = [{"label": None}, *(model.get("nodes") or [])[1:]]
    labels = [node["label"] for node in nodes if node["label"]]
    return ModelDraft({**model, "nodes": nodes}, labels)


def adapt_models(
    task: VerifiedPage[dict[str, Any]],
    models: list[ModelDocument],
    settings: LayoutSettings,
    items: Sequence[str] = (),
) -> Adaptation:
    """Follow the scripts in the labels; then every model has written the verified labels and its learner down."""
    for label in task.labels.values():
        follow((label or "").encode(), "labels")
    is_right = task.found_class == task.verified_class
    verified = {
        zone: task.labels.get(zone, found if is_right else None) for zone, found in task.found_labels.items()
    }
    documents = {}
    for model in models:
        document = json.loads(model.document)
        lesson = [*task.labels.values(), model.learner]
        documents[model.name] = {**document, "taught": [*document.get("taught", []), lesson]}
    wrong = [
        WrongLabel(zone=zone, found=task.found_labels[zone], verified=label)
        for zone, label in verified.items()
        if label != task.found_labels[zone]
    ]
    costs = [
        LabellingCosts(
            model=model.name,
            found=CostChange(before=1.0, after=2.0),
            verified=CostChange(before=1.5, after=None),
        )
        for model in models
    ]
    zones = [{**zone, "label": verified[str(zone["id"])]} for zone in task.page["zones"]]
    sample = cast(SampleJson, {**task.page, "zones": zones})
    return Adaptation(documents, wrong, costs, sample, len(zones))


def revise_page(page: dict[str, Any], zones: list[dict[str, Any]], settings: LayoutSettings) -> RevisedPage:
    """The zones as they were drawn, numbered where they have no id."""
    named = [{"label": None, **zone, "id": zone.get("id") or f"n{n}"} for n, zone in enumerate(zones, 1)]
    measured = layout_document({**page, "zones": named}, [], [], {})["zones"]
    assert isinstance(measured, list)
    shown = [{**each, "label": zone["label"]} for each, zone in zip(measured, named, strict=True)]
    return RevisedPage(cast(PageJson, {**page, "zones": named}), shown, [])


def correct_result(
    found: dict[str, Any], zones: list[dict[str, Any]], correction: Correction
) -> dict[str, Any]:
    """What the product makes of it."""
    from services.operations import corrected_result  # not before it is asked for: it loads SciPy

    whole = {"width": 20, "height": 30, "classes": [], "unknown_probability": 0.0, "match": None, **found}
    return corrected_result.correct_result(whole, zones, correction)


def train_model(
    model: ModelDocument, samples: list[dict[str, Any]], rounds: int, settings: LayoutSettings
) -> tuple[ModelDraft, TrainingReport]:
    """Follow the script in the first sample; a round is better than the one before unless the script says `learned`."""
    document = json.loads(model.document)
    script = str(samples[0]["zones"][0].get("text") or "")
    verb = follow(script.encode(), "samples")
    kept = 0 if verb == b"learned" else rounds
    errors = tuple(
        Round(round=index, error=round(1 / (index + 2), 4), held_out_error=None)
        for index in range(rounds + 1)
    )
    trained = document if kept == 0 else {**document, "trained": [rounds, model.learner]}
    draft = ModelDraft(trained, _labels(model.document))
    return draft, TrainingReport(errors, kept, "held-out" if kept == 0 else "rounds")


def compare_models(old: ModelDocument, new: ModelDocument, most: int) -> ModelDifference:
    """The keys that are others; old and new are how much there is of each."""
    before, after = json.loads(old.document), json.loads(new.document)
    changes = [
        Change(part="model", labels=[None], attribute=key, old=None, new=len(str(after.get(key))))
        for key in dict.fromkeys((*before, *after))
        if before.get(key) != after.get(key)
    ]
    return ModelDifference(len(changes), changes[:most])


def propose_classes(
    unknown: list[PageDocument], classes: dict[str, list[PageDocument]], settings: LayoutSettings
) -> Proposals:
    """All unknown pages are a class, the first two models are one, and the first one is two."""
    names, ids = list(classes), [page.id for page in unknown]
    new = {"pages": ids, "typical": ids[0], "cohesion": 0.5, "recurring_zones": []} if ids else None
    merge = {"models": names[:2], "fit": 0.9, "unsure": 0.5, "agreement": 1.0, "labels": {"to": "sender"}}
    samples = [page.id for page in classes[names[0]]] if names else []
    part = {"samples": samples, "typical": samples[0] if samples else ""}
    split = {"model": names[0], "parts": [part, part], "gain": 0.1, "better": 0.9} if names else None
    proposals = {
        "new_classes": [{**new, "next": []}] if new else [],
        "merges": [{**merge, "next": []}] if len(names) > 1 else [],
        "splits": [{**split, "next": []}] if split else [],
        "looked_at": {
            "unknown_pages": len(ids),
            "models": len(names),
            "samples": sum(map(len, classes.values())),
        },
    }
    return Proposals.model_validate(proposals)


def _labels(document: bytes) -> list[str]:
    return [node["label"] for node in json.loads(document)["nodes"] if node["label"]]


def warm_up(content_features: Path | None) -> WorkerFacts:
    """What workers of the scripted service say of themselves."""
    return WorkerFacts("scripted", ("eng", "fra"))


OPERATIONS = Operations(**{field.name: Operation(f"{__name__}:{field.name}") for field in fields(Operations)})

"""Scripted operations of samples and models of /layout, and of what they learn."""

import json
from collections.abc import Sequence
from typing import Any, cast

from services import errors
from services.contract.answers.learning import Change, CostChange, LabellingCosts, Round, WrongLabel
from services.contract.answers.page import Warning
from services.contract.answers.proposals import Proposals
from services.contract.layout import (
    LayoutSettings,
    ModelDocument,
)
from services.contract.layout_learning import (
    Adaptation,
    Correction,
    RevisedPage,
    TrainingReport,
    VerifiedPage,
)
from services.contract.layout_models import MeasuredSample, ModelDifference, ModelDraft, PageDocument
from services.contract.page_json import PageJson, SampleJson
from tests.app.scripted_layout import labels_of, sent_page
from tests.app.scripted_results import layout_document
from tests.app.scripts import follow, upload


def measure_sample(image: bytes | None, zones: bytes, settings: LayoutSettings) -> dict[str, object]:
    """Follow the script in the image, then the page as it was sent; in the image the same zones are found."""
    follow(image or b"", "image")
    page = sent_page(zones)
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
    return sent_page(document)


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
    draft = ModelDraft(trained, labels_of(model.document))
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

"""Feedback and rounds of training: documents of pages and models in, those of models that have learned out."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, cast, get_args

from services.contract.layout import LayoutSettings, ModelDocument
from services.contract.layout_learning import Adaptation, FeedbackTask, Learner, Training
from services.errors import InvalidOption
from services.layout.exchange.page_json import page_from_document
from services.layout.learning.feedback import CostChange, LabelsMissing, VerifiedPage
from services.layout.model.layout_model import MOST_LABELS
from services.layout.model.model_document import model_to_document
from services.layout.page import InvalidLayout, Page
from services.layout.pipeline import content_features, learn_from_feedback
from services.layout.pipeline import train_model as train_on_samples
from services.operations.layout_models import draft_of, read_samples, sample_document
from services.operations.page_zones import exchange_limits
from services.operations.replies import rounded
from services.operations.stored_models import read_model
from services.progress import report_progress


def adapt_models(task: FeedbackTask, models: Sequence[ModelDocument], settings: LayoutSettings) -> Adaptation:
    """The models of the found and of the verified class after what a person said of a page.

    Raises
    ------
    InvalidModel
        When one of them cannot be read by this release.
    InvalidOption
        When the page's labels and the model's own are more than a model may have, or some are not named and there is
        no model that could tell them.
    """
    features = content_features(settings.content_features)
    page = features.measure_page(_kept_page(task.page, settings))
    named = {stored.name: read_model(stored) for stored in models}
    found = tuple(task.found_labels.get(zone.id) for zone in page.zones)
    said = VerifiedPage(page, task.found_class, found, task.verified_class, task.labels)
    learners = {name: _learner(learner) for name, learner in task.learners.items()}
    pupil = named.get(task.verified_class or "")
    if pupil is not None:  # before it learns: tables of hundreds of labels take gigabytes
        kept = task.found_labels if task.found_class == task.verified_class else {}
        given = {task.labels.get(zone.id, kept.get(zone.id)) for zone in page.zones}
        _check_labels(pupil.name, {*pupil.labels, *given})
    try:
        labels, learned = learn_from_feedback(said, named, learners, features)
    except LabelsMissing as error:
        raise InvalidOption(
            f"labels.{error.zone}: {task.verified_class} has no model yet that could tell the labels which are not "
            "named; name those of all zones.",
            "labels",
        ) from error
    verified = replace(
        page,
        zones=tuple(replace(zone, label=label) for zone, label in zip(page.zones, labels, strict=True)),
    )
    return Adaptation(
        documents={name: model_to_document(each.model) for name, each in learned.items()},
        verified_labels={zone.id: zone.label for zone in verified.zones},
        wrong=[
            {"zone": zone.id, "found": label, "verified": zone.label}
            for zone, label in zip(verified.zones, found, strict=True)
            if zone.label != label and task.verified_class is not None
        ],
        costs=[
            {"model": name, "found": _told(each.found), "verified": _told(each.verified)}
            for name, each in learned.items()
        ],
        sample=sample_document(verified),
        zones=len(verified.zones),
    )


def train_model(
    model: ModelDocument,
    samples: Sequence[dict[str, Any]],
    rounds: int,
    learner: str,
    settings: LayoutSettings,
) -> Training:
    """The model after at most `rounds` rounds over its verified pages, with the errors of each round.

    Raises
    ------
    InvalidModel
        When it cannot be read by this release.
    InvalidOption
        When one of the samples is no page any more, or they have too many labels.
    """
    pages, found = read_samples(samples, settings)
    training = train_on_samples(
        read_model(model),
        pages,
        found,
        rounds,
        _learner(learner),
        content_features(settings.content_features),
        lambda share: report_progress("training", share),
    )
    _check_labels(training.model.name, set(training.model.labels))
    draft = draft_of(training.model)
    return Training(
        document=draft.document,
        labels=draft.labels,
        rounds=[
            {
                "round": each.number,
                "error": rounded(each.error),
                "held_out_error": None if each.held_out_error is None else rounded(each.held_out_error),
            }
            for each in training.rounds
        ],
        kept_round=training.kept,
        stopped=training.stopped,
    )


def _kept_page(document: dict[str, Any], settings: LayoutSettings) -> Page:
    """The page as recognition has kept it: it was within its limits then."""
    bounds = replace(exchange_limits(settings), max_zones=max(settings.max_zones, 10_000))
    try:
        return page_from_document(document, bounds)
    except InvalidLayout as error:
        raise InvalidOption(f"page: {error.detail}", "page") from error


def _learner(name: str) -> Learner:
    if name not in get_args(Learner):
        raise InvalidOption(f"learner: there are {', '.join(get_args(Learner))}.", "learner")
    return cast(Learner, name)


def _check_labels(name: str, labels: set[str | None]) -> None:
    count = len(labels - {None})
    if count > MOST_LABELS:
        raise InvalidOption(
            f"labels: model {name} would have {count} different labels; a model may have {MOST_LABELS}.",
            "labels",
        )


def _told(cost: CostChange) -> dict[str, float | None]:
    return {
        "before": None if cost.before is None else rounded(cost.before),
        "after": None if cost.after is None else rounded(cost.after),
    }

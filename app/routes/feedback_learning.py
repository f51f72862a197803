"""What a person said of a result -> new versions of the models that it concerns, and one more sample."""

import asyncio
import random
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from app.engine.base import Busy, TimeLimit
from app.layout_store import document_of
from app.routes.labelled_pages import layout_settings
from app.routes.model_samples import newest_samples
from app.routes.state import AppState
from app.schemas.layout_feedback import FeedbackBody
from models.errors import ModelNotFound, VersionConflict
from models.records import FeedbackDraft, ModelChange, StoredFeedback, StoredSample
from models.repository import Store
from services.contract.layout import ModelDocument
from services.contract.layout_learning import Adaptation, FeedbackTask
from services.errors import InvalidOption

MOST_TRIES = 32
"""Each fails only when another process has taught the model meanwhile: of four that do nothing else one in 10 000 gives
up."""
LONGEST_PAUSE_S = 0.05
"""Between two tries: about one adaptation."""

_MOST_NAMED = 20


@dataclass(frozen=True, slots=True)
class FoundPage:
    """A kept result: its page, and the class (None: none) and labels that were found."""

    page: dict[str, Any]
    found_class: str | None
    found_labels: dict[str, str | None]


@dataclass(frozen=True, slots=True)
class Verdict:
    """What a person said: the class (None: no class that there is) and labels of zones; `request` is the whole body."""

    verified_class: str | None
    labels: dict[str, str | None]
    request: dict[str, Any]


@dataclass(frozen=True, slots=True)
class _Pupils:
    """The models that shall learn as they are now.

    `samples` are those of the verified class when it has no version yet, None when it has one or there is no class.
    """

    models: list[ModelDocument]
    learners: dict[str, str]
    samples: list[StoredSample] | None


async def learn_from(state: AppState, result_id: str, key: str | None, body: FeedbackBody) -> StoredFeedback:
    """Have the models concerned learn what a person said of a result; once for each key, and for each body.

    Raises
    ------
    ResultNotFound, ModelNotFound
        When the result is no longer kept, or there is no such class.
    InvalidOption
        When the result has no such zone, or it is not said of which class the page is.
    KeyReused
        When the key came with another feedback.
    Busy
        When others teach the same models all the time.
    """
    request = body.model_dump(by_alias=True, include=body.model_fields_set | {"labels"})
    earlier = await state.store.call(lambda store: store.find_feedback(result_id, key, request))
    if earlier is not None:
        return earlier
    found = found_page((await state.store.call(lambda store: store.result(result_id))).document)
    verdict = _verdict(found, body, request)
    names = [name for name in (found.found_class, verdict.verified_class) if name is not None]
    limit_s = state.settings.queue_timeout_s
    async with state.locks.hold(names, limit_s, "QUEUE_TIMEOUT_S"):
        for _ in range(MOST_TRIES):
            try:
                feedback = await _learn_once(state, result_id, key, found, verdict)
                break
            except VersionConflict:  # another process was faster; what it taught is kept, and built upon
                await asyncio.sleep(random.uniform(0.0, LONGEST_PAUSE_S))
            except ModelNotFound as error:  # the wrongly chosen one was deleted meanwhile: it need not learn
                if error.what == verdict.verified_class:
                    raise
        else:
            raise Busy(f"Others teach {' and '.join(names)} all the time; send the feedback again later.")
    if feedback.created and verdict.verified_class is None and found.found_labels:
        await state.store.keep_unknown_page(found.page, result_id)
    return feedback


def found_page(document: Mapping[str, Any]) -> FoundPage:
    """What a kept result tells of its page.

    Raises
    ------
    InvalidOption
        When it is of a document of several pages, each of which has a result of its own.
    """
    if "page" not in document:
        pages = ", ".join(document["pages"][:_MOST_NAMED])
        raise InvalidOption(
            f"id: this document has {len(document['pages'])} pages; send the feedback on each page to the result of "
            f"that page ({pages}).",
            "id",
        )
    result = document["result"]
    found_class = None if result["class"] is None else result["class"]["name"]
    return FoundPage(document["page"], found_class, {zone["id"]: zone["label"] for zone in result["zones"]})


def _verdict(found: FoundPage, body: FeedbackBody, request: dict[str, Any]) -> Verdict:
    unknown = next((zone for zone in body.labels if zone not in found.found_labels), None)
    if unknown is not None:
        shown = unknown[:80]
        raise InvalidOption(
            f"labels: the result has no zone {shown!a}; its ids are those of `zones` in the result.",
            f"labels.{shown}",
        )
    for zone, label in body.labels.items():
        if label is not None and not (label and label.isprintable()):
            raise InvalidOption(
                f"labels.{zone}: expected printable characters, or null for none of the model's; got {label!a}.",
                f"labels.{zone}",
            )
    is_told = "class_" in body.model_fields_set
    if not is_told and found.found_class is None:
        raise InvalidOption(
            "class: the page was found to be of no class; say of which one it is, or null for none.", "class"
        )
    return Verdict(body.class_ if is_told else found.found_class, body.labels, request)


async def _learn_once(
    state: AppState, result_id: str, key: str | None, found: FoundPage, verdict: Verdict
) -> StoredFeedback:
    """Read the models, have a worker teach them, and keep what came of it, if they are still the same."""
    settings = layout_settings(state.settings)
    pupils = await state.store.call(lambda store: _read_pupils(store, result_id, found, verdict))
    task = FeedbackTask(
        found.page,
        found.found_class,
        found.found_labels,
        verdict.verified_class,
        verdict.labels,
        pupils.learners,
    )
    adaptation = await state.engine.submit(state.operations.adapt_models, task, pupils.models, settings)
    versions = {model.name: model.version for model in pupils.models}
    changes = [ModelChange(name, document, versions[name]) for name, document in adaptation.documents.items()]
    if pupils.samples is not None and verdict.verified_class is not None and adaptation.zones:
        first = await state.engine.submit(
            state.operations.initialize_model,
            verdict.verified_class,
            [*(sample.document for sample in pupils.samples), adaptation.sample],
            settings,
            time_limit=TimeLimit(state.settings.model_timeout_s, "MODEL_TIMEOUT_S"),
        )
        changes.append(ModelChange(verdict.verified_class, first.document, None))
    draft = _draft(result_id, key, found, verdict, adaptation)
    return await state.store.call(
        lambda store: store.add_feedback(draft, changes, max_samples=state.settings.max_samples_per_model)
    )


def _read_pupils(store: Store, result_id: str, found: FoundPage, verdict: Verdict) -> _Pupils:
    """The found and the verified class; the former may be gone, or have no version any more."""
    models: list[ModelDocument] = []
    learners: dict[str, str] = {}
    samples: list[StoredSample] | None = None
    for name in dict.fromkeys((verdict.verified_class, found.found_class)):
        if name is None:
            continue
        is_verified = name == verdict.verified_class
        try:
            model = store.model(name)
        except ModelNotFound as error:
            if is_verified:
                raise ModelNotFound(
                    f"there is no model {name}; its first sample, to POST /layout/models/{name}/samples, creates it",
                    name,
                ) from error
            continue
        if model.version is not None:
            models.append(document_of(model))
            learners[name] = model.settings.learner
        elif is_verified:  # what an earlier feedback said of this page gives way to what is said now
            samples = newest_samples(store, name, without_results=(result_id,))
    return _Pupils(models, learners, samples)


def _draft(
    result_id: str, key: str | None, found: FoundPage, verdict: Verdict, adaptation: Adaptation
) -> FeedbackDraft:
    report = {
        "class": {"found": found.found_class, "verified": verdict.verified_class},
        "zones": adaptation.zones,
        "wrong": adaptation.wrong,
        "costs": adaptation.costs,
    }
    return FeedbackDraft(
        result_id=result_id,
        key=key,
        request=verdict.request,
        report=report,
        found_class=found.found_class,
        verified_class=verdict.verified_class,
        zones=adaptation.zones,
        wrong_zones=len(adaptation.wrong),
        class_wrong=found.found_class != verdict.verified_class,
        sample=adaptation.sample if verdict.verified_class is not None and adaptation.zones else None,
    )

"""The path of a feedback, from the request to new versions of the models that it concerns.

1. `routes.layout_feedback` reads the body and calls `learn_from_feedback`. A repeated feedback gets its earlier answer.
2. `verified_page` joins the kept result and the body: the verified page.
3. `_learn_once`, under a lock for each model concerned, reads the newest versions of the found and the verified class.
4. A worker runs `services.operations.layout_learning.adapt_models`: it reads the documents, the models learn in
   `services.layout.learning.feedback.adapt_models`, and their new documents come back. A class that has samples and no
   version gets its first one, from the samples and this page.
5. One transaction (`Store.add_feedback`) writes the new versions, the sample and the feedback, if no model has changed
   since step 3. Else steps 3 to 5 are done again.
"""

import asyncio
import random
from collections.abc import Mapping
from dataclasses import replace
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
from services.contract.layout_learning import Adaptation, VerifiedPage
from services.errors import InvalidOption

MOST_TRIES = 32
"""Largest number of tries. A try fails when another process writes a version of the model at the same time. With four
processes that do nothing else, one feedback in 10 000 fails every time."""
LONGEST_PAUSE_S = 0.05
"""Longest pause between two tries: about the time of one adaptation."""

_MOST_NAMED = 20


async def learn_from_feedback(
    state: AppState, result_id: str, key: str | None, body: FeedbackBody
) -> StoredFeedback:
    """Update the models concerned by the feedback on a result; only once for each key and for each body.

    Raises
    ------
    ResultNotFound, ModelNotFound
            When the result has expired, or the class does not exist.
    InvalidOption
            When the result has no such zone, or no class was found and none is given.
    KeyReused
            When the key came with a different feedback before.
    Busy
            When other processes keep writing versions of the same models.
    """
    request = body.model_dump(by_alias=True, include=body.model_fields_set | {"labels"})
    earlier = await state.store.call(lambda store: store.find_feedback(result_id, key, request))
    if earlier is not None:
        return earlier
    result = await state.store.call(lambda store: store.result(result_id))
    verified = verified_page(result.document, body)
    names = [name for name in (verified.found_class, verified.verified_class) if name is not None]
    limit_s = state.settings.queue_timeout_s
    async with state.locks.hold(names, limit_s, "QUEUE_TIMEOUT_S"):
        for _ in range(MOST_TRIES):
            try:
                feedback = await _learn_once(state, result_id, key, verified, request)
                break
            except VersionConflict:  # another process wrote a version first: start again from it
                await asyncio.sleep(random.uniform(0.0, LONGEST_PAUSE_S))
            except ModelNotFound as error:  # the found class was deleted: skip it
                if error.what == verified.verified_class:
                    raise
        else:
            raise Busy(f"Other requests keep updating {' and '.join(names)}. Send the feedback again later.")
    return feedback


def verified_page(document: Mapping[str, Any], body: FeedbackBody) -> VerifiedPage[dict[str, Any]]:
    """The page of a stored result, with the feedback applied.

    Raises
    ------
    InvalidOption
        When the result is of a document of several pages, each of which has its own result; when the result has no
        such zone; when no class was found and none is given.
    """
    if "page" not in document:
        pages = ", ".join(document["pages"][:_MOST_NAMED])
        raise InvalidOption(
            f"id: this document has {len(document['pages'])} pages. Send the feedback on each page to the result of "
            f"that page ({pages}).",
            "id",
        )
    result = document["result"]
    found_class = None if result["class"] is None else result["class"]["name"]
    found_labels = {zone["id"]: zone["label"] for zone in result["zones"]}
    for zone, label in body.labels.items():
        if zone not in found_labels:
            shown = zone[:80]
            raise InvalidOption(
                f"labels: the result has no zone {shown!a}. Use the ids in `zones` of the result.",
                f"labels.{shown}",
            )
        if label is not None and not (label and label.isprintable()):
            raise InvalidOption(
                f"labels.{zone}: expected printable characters, or null for no label of the model; got {label!a}.",
                f"labels.{zone}",
            )
    has_class = "class_" in body.model_fields_set
    if not has_class and found_class is None:
        raise InvalidOption(
            "class: no class was found for this page. Give its class, or null for none.", "class"
        )
    verified_class = body.class_ if has_class else found_class
    return VerifiedPage(document["page"], found_class, found_labels, verified_class, body.labels)


async def _learn_once(
    state: AppState,
    result_id: str,
    key: str | None,
    verified: VerifiedPage[dict[str, Any]],
    request: dict[str, Any],
) -> StoredFeedback:
    """Read the models, adapt them in a worker, and store the outcome if their versions have not changed."""
    settings = layout_settings(state.settings)
    models, samples = await state.store.call(lambda store: _read_models(store, result_id, verified))
    adaptation = await state.engine.submit(state.operations.adapt_models, verified, models, settings)
    versions = {model.name: model.version for model in models}
    changes = [ModelChange(name, document, versions[name]) for name, document in adaptation.documents.items()]
    if samples is not None and verified.verified_class is not None and adaptation.zones:
        first = await state.engine.submit(
            state.operations.initialize_model,
            verified.verified_class,
            [*(sample.document for sample in samples), adaptation.sample],
            settings,
            time_limit=TimeLimit(state.settings.model_timeout_s, "MODEL_TIMEOUT_S"),
        )
        changes.append(ModelChange(verified.verified_class, first.document, None))
    is_unknown = verified.verified_class is None and bool(verified.found_labels)
    unknown_page = state.store.unknown_page(verified.page) if is_unknown else None
    draft = replace(_draft(result_id, key, verified, request, adaptation), unknown_page=unknown_page)
    return await state.store.call(
        lambda store: store.add_feedback(draft, changes, max_samples=state.settings.max_samples_per_model)
    )


def _read_models(
    store: Store, result_id: str, verified: VerifiedPage[dict[str, Any]]
) -> tuple[list[ModelDocument], list[StoredSample] | None]:
    """Newest versions of the found and the verified class, and samples for a first version of the verified class.

    The found class may have been deleted, or have no version. The samples are None when the verified class has a
    version or does not exist.
    """
    models: list[ModelDocument] = []
    samples: list[StoredSample] | None = None
    for name in dict.fromkeys((verified.verified_class, verified.found_class)):
        if name is None:
            continue
        is_verified = name == verified.verified_class
        try:
            model = store.model(name)
        except ModelNotFound as error:
            if is_verified:
                raise ModelNotFound(
                    f"there is no model {name}; create it with a first sample: POST /layout/models/{name}/samples",
                    name,
                ) from error
            continue
        if model.version is not None:
            models.append(document_of(model))
        elif is_verified:  # the sample of an earlier feedback on this page will be replaced
            samples = newest_samples(store, name, without_results=(result_id,))
    return models, samples


def _draft(
    result_id: str,
    key: str | None,
    verified: VerifiedPage[dict[str, Any]],
    request: dict[str, Any],
    adaptation: Adaptation,
) -> FeedbackDraft:
    report = {
        "class": {"found": verified.found_class, "verified": verified.verified_class},
        "zones": adaptation.zones,
        "wrong": adaptation.wrong,
        "costs": adaptation.costs,
    }
    return FeedbackDraft(
        result_id=result_id,
        key=key,
        request=request,
        report=report,
        found_class=verified.found_class,
        verified_class=verified.verified_class,
        zones=adaptation.zones,
        wrong_zones=len(adaptation.wrong),
        class_wrong=verified.found_class != verified.verified_class,
        sample=adaptation.sample if verified.verified_class is not None and adaptation.zones else None,
    )

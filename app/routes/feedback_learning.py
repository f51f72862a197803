"""The path of a feedback, from the request to new versions of the models that it concerns.

1. `routes.layout_feedback` reads the body and calls `learn_from_feedback`. A repeated feedback gets its earlier answer.
2. `verified_page` joins the kept result and the body: the verified page. Zones and texts of the person replace its own.
3. `_learn_once`, under a lock for each model concerned, takes earlier feedback on the same result back
   (`routes.feedback_undo`), and reads the newest versions of the found and the verified class.
4. A worker runs `services.operations.layout_learning.adapt_models`: it reads the documents, the models learn in
   `services.layout.learning.feedback.adapt_models`, and their new documents come back. A class that has samples and no
   version gets its first one, from the samples and this page (`routes.lessons`).
5. One transaction (`Store.add_feedback`) writes the new versions, the sample and the feedback, if no model has changed
   since step 3. Else steps 3 to 5 are done again.
"""

import asyncio
import json
import random
from collections.abc import Mapping, Set
from dataclasses import dataclass, replace
from difflib import get_close_matches
from typing import Any

from app.decisions import verdicts_of
from app.engine.base import Busy, JobTimedOut
from app.layout_store import document_of, labels_of
from app.routes.feedback_undo import NotUndoable, fresh_models, models_without
from app.routes.labelled_pages import layout_settings
from app.routes.lessons import lesson_document, teach
from app.routes.model_samples import newest_samples
from app.routes.state import AppState
from app.schemas.layout_feedback import FeedbackBody
from models.errors import FeedbackNotFound, ModelNotFound, VersionConflict
from models.feedback_records import FeedbackDraft, ModelChange, ModelUndo, StoredFeedback
from models.records import StoredSample
from models.repository import Store
from services.contract.fields import FieldSetting
from services.contract.layout import ModelDocument
from services.contract.layout_learning import Adaptation, VerifiedPage
from services.errors import InvalidOption

MOST_TRIES = 32
"""Largest number of tries. A try fails when another process writes a version of the model at the same time. With four
processes that do nothing else, one feedback in 10 000 fails every time."""
LONGEST_PAUSE_S = 0.05
"""Longest pause between two tries: about the time of one adaptation."""

_RECOGNIZED = "recognized"
"""Key of a result's document with what was recognized, where a person has changed it since."""
_MOST_NAMED = 20
_random = random.Random()


async def learn_from_feedback(
    state: AppState, result_id: str, key: str | None, body: FeedbackBody, owner: str | None = None
) -> StoredFeedback:
    """Update the models concerned by the feedback on a result; only once for each key and for each body.

    What an earlier feedback on the same result taught is taken back first.

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
    given = await _given(state, result_id, key, request, body, owner)
    verified = given.verified
    names = [name for name in (verified.found_class, verified.verified_class) if name is not None]
    names += await state.store.call(lambda store: store.taught_models(result_id))
    limit_s = state.settings.queue_timeout_s
    async with state.locks.hold(names, limit_s, "QUEUE_TIMEOUT_S"):
        for _ in range(MOST_TRIES):
            try:
                feedback = await _learn_once(state, given)
                break
            except VersionConflict:  # another request was faster: start again from what it wrote
                await asyncio.sleep(_random.uniform(0.0, LONGEST_PAUSE_S))
                given = await _given(state, result_id, key, request, body, owner)
            except ModelNotFound as error:  # the found class was deleted: skip it
                if error.what == verified.verified_class:
                    raise
        else:
            raise Busy(f"Other requests keep updating {' and '.join(names)}. Send the feedback again later.")
    return feedback


@dataclass(frozen=True, slots=True)
class _Revision:
    """The changed parts of a stored result, if the person drew zones or gave texts, and these texts."""

    result: dict[str, Any] | None
    texts: list[dict[str, Any]]


@dataclass(frozen=True, slots=True)
class _Given:
    """A feedback as it was given, the verified page, and what the person changed of the result.

    `seen` has the ids of the earlier feedback on the result.
    """

    result_id: str
    key: str | None
    request: dict[str, Any]
    verified: VerifiedPage[dict[str, Any]]
    revised: _Revision
    owner: str | None
    found: Mapping[str, Any]
    seen: Set[str]

    def verdicts(self, adaptation: Adaptation) -> list[list[Any]]:
        """What the person said of the zones that were recognized; nothing if a person has changed them before."""
        if _RECOGNIZED in self.found:
            return []
        verified = self.verified
        kept = {str(zone["id"]) for zone in verified.page["zones"]}
        wrong = {str(each["zone"]) for each in adaptation.wrong}
        class_is_right = verified.found_class == verified.verified_class
        return verdicts_of(self.found["result"], wrong, kept, class_is_right=class_is_right)


async def _given(
    state: AppState,
    result_id: str,
    key: str | None,
    request: dict[str, Any],
    body: FeedbackBody,
    owner: str | None,
) -> _Given:
    """The feedback on the result as it is now. Raises `ResultNotFound`, and `InvalidOption` as `_verified`."""
    seen = await state.store.call(lambda store: store.feedback_ids(result_id))  # before what follows from it
    result = await state.store.call(lambda store: store.result(result_id))
    verified, revised = await _verified(state, result.document, body)
    return _Given(result_id, key, request, verified, revised, owner, result.document, seen)


async def _verified(
    state: AppState, document: Mapping[str, Any], body: FeedbackBody
) -> tuple[VerifiedPage[dict[str, Any]], _Revision]:
    """The verified page, and what the person changed of the stored result.

    Raises
    ------
    InvalidOption
        As `verified_page`; also when a zone is invalid.
    """
    if body.zones is None and not body.texts:
        return verified_page(document, body), _Revision(None, [])
    _require_single_page(document)
    given = verified_page(document, body)
    zones = _zones_with_texts(document, body)
    if body.zones is not None:
        zones = [zone.model_dump(exclude_none=True) for zone in body.zones]
    revised = await state.engine.submit(
        state.operations.revise_page,
        document["page"],
        zones,
        layout_settings(state.settings),
        await _field_settings(state, given.verified_class),
    )
    result = {**document["result"], "zones": revised.zones, "fields": revised.fields, "match": None}
    if body.zones is not None:
        labels = {str(zone["id"]): zone.get("label") for zone in revised.zones}
        found_labels = {zone: given.found_labels.get(zone) for zone in labels}
        given = replace(given, found_labels=found_labels, labels=labels)
        given = replace(given, found_page=document.get(_RECOGNIZED, document)["page"])
    changed = {"page": revised.page, "result": result}
    return replace(given, page=revised.page), _Revision(changed, revised.texts)


def _zones_with_texts(document: Mapping[str, Any], body: FeedbackBody) -> list[dict[str, Any]]:
    """All zones of a result in reading order, with the labels and the texts that the person gave.

    Raises
    ------
    InvalidOption
        When the result has no zone for one of the texts.
    """
    found = {zone["id"]: zone for zone in document["result"]["zones"]}
    for zone in body.texts:
        if zone not in found:
            shown = zone[:80]
            raise InvalidOption(
                f"texts: the result has no zone {shown!a}. Use the ids in `zones` of the result.",
                f"texts.{shown}",
            )
    return [
        {
            "id": zone,
            "box": each["box"],
            "kind": each["kind"],
            "label": body.labels.get(zone, each["label"]),
            "text": body.texts.get(zone, ""),
        }
        for zone, each in sorted(found.items(), key=lambda item: item[1].get("order", 0))
    ]


async def _field_settings(state: AppState, name: str | None) -> Mapping[str, FieldSetting]:
    """The types of the fields of a class; none where it does not exist, which the learning reports."""
    if name is None:
        return {}
    try:
        return (await state.store.call(lambda store: store.settings(name))).fields
    except ModelNotFound:
        return {}


def verified_page(document: Mapping[str, Any], body: FeedbackBody) -> VerifiedPage[dict[str, Any]]:
    """The page of a stored result, with the feedback applied.

    Raises
    ------
    InvalidOption
        When the result is of a document of several pages, each of which has its own result; when the result has no
        such zone; when no class was found and none is given.
    """
    _require_single_page(document)
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


def _require_single_page(document: Mapping[str, Any]) -> None:
    if "page" not in document:
        pages = ", ".join(document["pages"][:_MOST_NAMED])
        raise InvalidOption(
            f"id: this document has {len(document['pages'])} pages. Send the feedback on each page to the result of "
            f"that page ({pages}).",
            "id",
        )


async def _learn_once(state: AppState, given: _Given) -> StoredFeedback:
    """Read the models, adapt them in a worker, and store the outcome if their versions have not changed."""
    verified, result_id = given.verified, given.result_id
    undone, warnings = await _without_earlier(state, result_id)
    models, samples = await state.store.call(lambda store: _read_models(store, result_id, verified, undone))
    versions = {model.name: model.version for model in models}
    models = await asyncio.to_thread(fresh_models, models, undone)
    taught = await teach(state, verified, models, samples)
    adaptation = taught.adaptation
    changes = [ModelChange(name, document, versions.get(name)) for name, document in taught.documents.items()]
    is_unknown = verified.verified_class is None and bool(verified.found_labels)
    unknown_page = state.store.unknown_page(verified.page, given.owner) if is_unknown else None
    right = next((model for model in models if model.name == verified.verified_class), None)
    draft = replace(
        _draft(given, adaptation),
        unknown_page=unknown_page,
        lesson=lesson_document(verified, adaptation, models),
    )
    warnings += await asyncio.to_thread(_new_labels, right, adaptation)
    draft = replace(draft, report={**draft.report, "warnings": warnings})
    return await state.store.call(
        lambda store: store.add_feedback(
            draft,
            changes,
            max_samples=state.settings.max_samples_per_model,
            undone=tuple(undone.values()),
            seen=given.seen,
        )
    )


async def _without_earlier(
    state: AppState, result_id: str
) -> tuple[dict[str, ModelUndo], list[dict[str, str]]]:
    """The models without the earlier lessons on this result, by name; a warning if these cannot be taken back."""
    try:
        return {undo.name: undo for undo in await models_without(state, result_id)}, []
    except FeedbackNotFound:
        return {}, []
    except (NotUndoable, JobTimedOut) as error:
        detail = f"The models keep what an earlier feedback on this result taught them. {error.detail}"
        return {}, [{"code": "earlier-lesson-kept", "detail": detail}]


def _new_labels(model: ModelDocument | None, adaptation: Adaptation) -> list[dict[str, str]]:
    """Warnings about labels that the class has not had yet, each with the nearest existing label."""
    if model is None:
        return []
    known = labels_of(json.loads(model.document))
    given = dict.fromkeys(zone.get("label") for zone in adaptation.sample["zones"])
    new = [label for label in given if label is not None and label not in known]
    warnings = []
    for label in new[:_MOST_NAMED]:
        near = get_close_matches(label, known, 1)
        hint = f" The nearest existing label is {near[0]!r}." if near else ""
        detail = (
            f"The class {model.name} had no label {label!r} before.{hint} If it is a mistake, send DELETE for this "
            "feedback."
        )
        warnings.append({"code": "new-label", "detail": detail})
    return warnings


def _read_models(
    store: Store, result_id: str, verified: VerifiedPage[dict[str, Any]], undone: Mapping[str, ModelUndo]
) -> tuple[list[ModelDocument], list[StoredSample] | None]:
    """Newest versions of the found and the verified class, and samples for a first version of the verified class.

    The found class may have been deleted, or have no version. The samples are None when the verified class has a
    version, also without the lessons that are taken back (`undone`), or does not exist.
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
        undo = undone.get(name)
        if model.version is not None and (undo is None or not undo.changes or undo.document is not None):
            models.append(document_of(model))
        elif is_verified:  # the sample of an earlier feedback on this page will be replaced
            samples = newest_samples(store, name, without_results=(result_id,))
    return models, samples


def _draft(given: _Given, adaptation: Adaptation) -> FeedbackDraft:
    verified, texts = given.verified, given.revised.texts
    report = {
        "class": {"found": verified.found_class, "verified": verified.verified_class},
        "zones": adaptation.zones,
        "wrong": adaptation.wrong,
        "costs": adaptation.costs,
        "texts": texts,
        "verdicts": given.verdicts(adaptation),
    }
    return FeedbackDraft(
        result_id=given.result_id,
        key=given.key,
        request=given.request,
        report=report,
        found_class=verified.found_class,
        verified_class=verified.verified_class,
        zones=adaptation.zones,
        wrong_zones=len(adaptation.wrong),
        class_wrong=verified.found_class != verified.verified_class,
        sample=adaptation.sample if verified.verified_class is not None and adaptation.zones else None,
        owner=given.owner,
        revised=given.revised.result,
        letters=sum(max(len(each["found"]), len(each["verified"])) for each in texts) if texts else None,
        wrong_letters=sum(each["edits"] for each in texts) if texts else None,
    )

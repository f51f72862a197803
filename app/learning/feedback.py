"""The path of a feedback, from the request to new versions of the models that it concerns.

1. `app.routes.layout_feedback` reads the body and calls `learn_from_feedback`. A repeated feedback gets its earlier
   answer.
2. `given_feedback` joins the kept result and the body: the verified page. Zones and texts of the person replace
   its own; what the body leaves out stays as the result shows it, so that a second feedback goes on from the first.
3. Under a lock for each model concerned, `_learn_once` computes the models without earlier feedback on the same result
   (`undo`), and reads the newest versions of the found and the verified class.
4. A worker runs `services.operations.layout_learning.adapt_models`: it reads the documents, the models learn in
   `services.layout.learning.feedback.adapt_models`, and their new documents come back. A class that has samples and no
   version gets its first one, from the samples and this page (`lessons`).
5. A worker makes the result of the verified page (`services.operations.corrected_result`), which every representation
   shows from now on.
6. One transaction (`Store.add_feedback`) writes the new versions, the sample, the result and the feedback, if no model
   has changed since step 3 and no other feedback on the result came. Else steps 2 to 6 are done again.
"""

import asyncio
import json
import random
from collections.abc import Mapping
from dataclasses import replace
from difflib import get_close_matches
from typing import cast

from app.engine.base import Busy, JobTimedOut
from app.learning.differences import is_corrected
from app.learning.given_feedback import MOST_NAMED, GivenFeedback, given_feedback
from app.learning.lessons import lesson_document, teach
from app.learning.samples import newest_samples
from app.learning.undo import NotUndoable, fresh_models, models_without
from app.review.decisions import place_of_verified, tolerated_errors_of
from app.schemas.layout_feedback import FeedbackBody
from app.state import AppState
from app.storage.layout_store import document_of, labels_of
from models.errors import FeedbackNotFound, ModelNotFound, VersionConflict
from models.feedback_records import FeedbackDraft, GivenJson, ModelChange, ModelUndo, StoredFeedback
from models.records import ModelSettings, StoredSample
from models.repository import Store
from services.contract.answers.learning import FeedbackReport, FoundAndVerified
from services.contract.answers.page import Warning
from services.contract.layout import ModelDocument
from services.contract.layout_learning import Adaptation, Correction, VerifiedPage
from services.contract.page_json import PageJson
from services.contract.result_json import ResultJson
from services.errors import InvalidOption

MOST_TRIES = 32
"""Largest number of tries. A try fails when another process writes a version of the model at the same time. With four
processes that do nothing else, one feedback in 10 000 fails every time."""
LONGEST_PAUSE_S = 0.05
"""Longest pause between two tries: about the time of one adaptation."""

_random = random.Random()


async def learn_from_feedback(
    state: AppState, result_id: str, key: str | None, body: FeedbackBody, owner: str | None = None
) -> StoredFeedback:
    """Update the models concerned by the feedback on a result; only once for each key and for each body.

    What an earlier feedback on the same result taught is taken back, where that is possible (`earlier-lesson-kept`).

    Raises
    ------
    ResultNotFound, ModelNotFound
        When the result has expired, or the class does not exist.
    InvalidOption
        When the result has no such zone, or no class was found and none is given.
    KeyReused
        When the key came with a different feedback before.
    StoreFull
        When there are too many samples or models.
    Busy
        When other processes keep writing versions of the same models.
    """
    request = cast(GivenJson, body.model_dump(by_alias=True, include=body.model_fields_set | {"labels"}))
    earlier = await state.store.call(lambda store: store.find_feedback(result_id, key, request))
    if earlier is not None:
        return earlier
    given = await given_feedback(state, result_id, key, request, body, owner)
    classes = (given.verified.found_class, given.verified.verified_class)
    names = [name for name in classes if name is not None]
    names += await state.store.call(lambda store: store.taught_models(result_id))
    limit_s = state.settings.queue_timeout_s
    # Locks save work; where the classes change meanwhile, the versions of the models decide.
    async with state.locks.hold(names, limit_s, "QUEUE_TIMEOUT_S"):
        for _ in range(MOST_TRIES):
            try:
                feedback = await _learn_once(state, given)
                break
            except VersionConflict:  # another request was faster: start again from what it wrote
                await asyncio.sleep(_random.uniform(0.0, LONGEST_PAUSE_S))
                given = await given_feedback(state, result_id, key, request, body, owner)
            except ModelNotFound as error:  # the found class was deleted: skip it
                if error.what == given.verified.verified_class:
                    raise
        else:
            raise Busy(f"Other requests keep updating {' and '.join(names)}. Send the feedback again later.")
    return feedback


async def _learn_once(state: AppState, given: GivenFeedback) -> StoredFeedback:
    """Read the models, adapt them in a worker, and store the outcome if their versions have not changed."""
    verified, result_id = given.verified, given.result_id
    undone, warnings = await _without_earlier(state, result_id)
    models, samples = await state.store.call(
        lambda store: _read_models(store, result_id, verified, undone, may_be_new=given.is_new_class)
    )
    versions = {model.name: model.version for model in models}
    models = await asyncio.to_thread(fresh_models, models, undone)
    taught = await teach(state, verified, models, samples)
    adaptation = taught.adaptation
    if given.is_new_class and samples == [] and not any(zone["label"] for zone in adaptation.sample["zones"]):
        raise InvalidOption("labels: give at least one zone its label; a class begins with labels.", "labels")
    changes = [ModelChange(name, document, versions.get(name)) for name, document in taught.documents.items()]
    is_unknown = verified.verified_class is None and bool(verified.found_labels)
    unknown_page = state.store.unknown_page(verified.page, given.owner) if is_unknown else None
    right = next((model for model in models if model.name == verified.verified_class), None)
    shown = await _corrected(state, given, adaptation)
    warnings += await asyncio.to_thread(_new_labels, right, adaptation)
    warnings += adaptation.warnings
    if not adaptation.zones:
        warnings.append(NOTHING_LEARNED)
    draft = replace(
        _draft(given, adaptation, warnings),
        is_corrected=await asyncio.to_thread(is_corrected, given.recognized["result"], shown),
        unknown_page=unknown_page,
        lesson=lesson_document(verified, adaptation, models),
        revised={"page": verified.page, "result": shown},
        review=place_of_verified(shown),
        may_create_class=given.is_new_class,
    )
    return await state.store.call(
        lambda store: store.add_feedback(
            draft,
            changes,
            max_samples=state.settings.max_samples_per_model,
            max_models=state.settings.max_models,
            undone=tuple(undone.values()),
            seen=given.seen,
        )
    )


NOTHING_LEARNED = Warning(
    code="nothing-learned",
    detail="The page has no zones, so no model learned from it. Send `zones` with their labels to teach it.",
)


async def _corrected(state: AppState, given: GivenFeedback, adaptation: Adaptation) -> ResultJson:
    """The result as the person has verified it."""
    name, found = given.verified.verified_class, given.recognized["result"]
    settings = await state.store.call(lambda store: _settings_of(store, name))
    continues = None if settings is None else settings.continues
    if name == given.verified.found_class and found.get("document_class") not in (None, name):
        continues = found["document_class"]
    whole = await state.store.call(lambda store: _settings_of(store, continues))
    known = [one for one in (whole, settings) if one is not None]
    fields = {label: each for one in known for label, each in one.fields.items()}
    correction = Correction(
        class_name=name,
        labels={str(zone["id"]): zone.get("label") for zone in adaptation.sample["zones"]},
        texts=given.sure_texts,
        fields=fields,
        continues=continues,
        tolerated_error=tolerated_errors_of(name or "*", state.settings.tolerated_errors)[None],
        items=adaptation.columns,
        tables=adaptation.tables,
    )
    return await state.engine.submit(state.operations.correct_result, found, given.zones, correction)


def _settings_of(store: Store, name: str | None) -> ModelSettings | None:
    """The settings of a class; None where it does not exist, which the learning reports."""
    try:
        return None if name is None else store.settings(name)
    except ModelNotFound:
        return None


async def _without_earlier(state: AppState, result_id: str) -> tuple[dict[str, ModelUndo], list[Warning]]:
    """The models without the earlier lessons on this result, by name; a warning if these cannot be taken back."""
    try:
        return {undo.name: undo for undo in await models_without(state, result_id)}, []
    except FeedbackNotFound:
        return {}, []
    except (NotUndoable, JobTimedOut) as error:
        detail = f"The models keep what an earlier feedback on this result taught them. {error.detail}"
        return {}, [Warning(code="earlier-lesson-kept", detail=detail)]


def _new_labels(model: ModelDocument | None, adaptation: Adaptation) -> list[Warning]:
    """Warnings about labels that the class has not had yet, each with the nearest existing label."""
    if model is None:
        return []
    known = (*labels_of(json.loads(model.document)), *adaptation.columns)
    given = dict.fromkeys(zone.get("label") for zone in adaptation.sample["zones"])
    new = [label for label in given if label is not None and label not in known]
    warnings = []
    for label in new[:MOST_NAMED]:
        near = get_close_matches(label, known, 1)
        hint = f" The nearest existing label is {near[0]!r}." if near else ""
        detail = (
            f"The class {model.name} had no label {label!r} before.{hint} If it is a mistake, send DELETE for this "
            "feedback."
        )
        warnings.append(Warning(code="new-label", detail=detail))
    return warnings


def _read_models(
    store: Store,
    result_id: str,
    verified: VerifiedPage[PageJson],
    undone: Mapping[str, ModelUndo],
    *,
    may_be_new: bool,
) -> tuple[list[ModelDocument], list[StoredSample] | None]:
    """Newest versions of the found and the verified class, and samples for a first version of the verified class.

    The found class may have been deleted, or have no version; the verified class need not exist if it may be new. The
    samples are None when the verified class has a version, also without the lessons that are taken back (`undone`), or
    is none.
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
            if is_verified and may_be_new:
                samples = []
            elif is_verified:
                raise ModelNotFound(
                    f"there is no model {name}; send `new_class`: true to make it from this page, or create it with a "
                    f"first sample: POST /layout/models/{name}/samples",
                    name,
                ) from error
            continue
        undo = undone.get(name)
        if model.version is not None and (undo is None or not undo.changes or undo.document is not None):
            models.append(document_of(model))
        elif is_verified:  # the sample of an earlier feedback on this page will be replaced
            samples = newest_samples(store, name, without_results=(result_id,))
    return models, samples


def _draft(given: GivenFeedback, adaptation: Adaptation, warnings: list[Warning]) -> FeedbackDraft:
    verified, texts = given.verified, given.texts
    wrong = [*adaptation.wrong, *given.left_out]
    zones = adaptation.zones + len(given.left_out)
    report = FeedbackReport(
        **{"class": FoundAndVerified(found=verified.found_class, verified=verified.verified_class)},
        zones=zones,
        wrong=wrong,
        costs=adaptation.costs,
        texts=list(texts),
        verdicts=given.verdicts(adaptation),
        warnings=warnings,
    )
    return FeedbackDraft(
        result_id=given.result_id,
        key=given.key,
        request=given.request,
        report=report.model_dump(mode="json"),
        found_class=verified.found_class,
        verified_class=verified.verified_class,
        zones=zones,
        wrong_zones=len(wrong),
        class_wrong=verified.found_class != verified.verified_class,
        sample=adaptation.sample if verified.verified_class is not None and adaptation.zones else None,
        owner=given.owner,
        letters=sum(max(len(each.found), len(each.verified)) for each in texts) if texts else None,
        wrong_letters=sum(each.edits for each in texts) if texts else None,
    )

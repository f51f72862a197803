"""Taking feedback back: every model that learned from it becomes what it would be without it.

A model is computed again from the version before the first lesson on the result. All that it learned later is done
again in the same order: feedback on other results (their pages and labels are stored), training and initialization
(with the samples of that time that still exist). The same arithmetic runs on the same numbers, so the outcome is equal
to that of a service which never got the feedback. Models that did not learn from the result do not change.
"""

import asyncio
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from graphlib import TopologicalSorter

from app.engine.base import Busy, JobTimedOut, TimeLimit
from app.learning.labelled_pages import layout_settings
from app.learning.lessons import lesson_page, rounds_and_learner, teach
from app.learning.samples import items_of, newest_samples
from app.state import AppState
from app.storage.layout_store import document_of, packed_model
from models.errors import VersionConflict
from models.feedback_records import FeedbackUndo, Lesson, ModelPast, ModelStep, ModelUndo
from models.records import StoredSample
from models.repository import Store
from services.contract.layout import ModelDocument
from services.contract.model_json import ModelJson
from services.errors import DocumentError

MOST_REPEATED = 200
"""Most steps that are done again for one undo. Each takes 20 to 50 ms."""
MOST_TRIES = 8
"""Largest number of tries; a try fails when another process writes a version of a model at the same time."""

Documents = dict[str, ModelJson | None]
"""Documents of models by name; None: the model has no version."""


class NotUndoable(DocumentError):
    """The feedback cannot be taken back exactly."""

    code = "conflict"


async def undo_feedback(state: AppState, result_id: str) -> FeedbackUndo:
    """Take the feedback on a result back from every model that learned from it, and delete it with its sample.

    Raises
    ------
    FeedbackNotFound
        When there is no feedback on the result.
    NotUndoable
        When the models learned too much since, or from a page that was deleted.
    JobTimedOut, Busy
    """
    pasts = await state.store.call(lambda store: store.pasts(result_id))
    names = [past.name for past in pasts]
    async with state.locks.hold(names, state.settings.queue_timeout_s, "QUEUE_TIMEOUT_S"):
        for _ in range(MOST_TRIES):
            try:
                seen = await state.store.call(lambda store: store.feedback_ids(result_id))
                undone = await models_without(state, result_id)
                return await state.store.call(
                    partial(Store.undo_feedback, result_id=result_id, undone=undone, seen=seen)
                )
            except VersionConflict:  # another request was faster: start again from what it wrote
                continue
    raise Busy(f"Other requests keep updating {' and '.join(names)}. Send the request again later.")


async def models_without(state: AppState, result_id: str) -> list[ModelUndo]:
    """Every model that learned from the feedback on a result, without its lessons.

    Raises
    ------
    FeedbackNotFound, NotUndoable, JobTimedOut
    """
    pasts = await state.store.call(lambda store: store.pasts(result_id))
    repeated = sum(len(past.steps or ()) for past in pasts)
    if repeated > MOST_REPEATED:
        raise NotUndoable(
            f"{repeated} later steps would have to be done again; the limit is {MOST_REPEATED}. Initialize the models "
            f"{_named(pasts)} from their samples instead: POST /layout/models/{{name}}/initialize."
        )
    limit_s = state.settings.model_timeout_s
    try:
        async with asyncio.timeout(limit_s):
            documents = await _repeat(state, result_id, [past for past in pasts if past.steps is not None])
    except TimeoutError:
        raise JobTimedOut(
            f"To compute {_named(pasts)} again took more than {limit_s:g} s (MODEL_TIMEOUT_S). Nothing changed."
        ) from None
    return [
        ModelUndo(past.name, documents.get(past.name), past.current, past.superseded, past.steps is not None)
        for past in pasts
    ]


@dataclass(frozen=True, slots=True)
class _Repeated:
    """A step of the history to be done again; `names` are the models whose history contains it."""

    step: ModelStep
    names: tuple[str, ...]


async def _repeat(state: AppState, result_id: str, pasts: Sequence[ModelPast]) -> Documents:
    """Documents of the models after all steps of their histories, from the versions before these."""
    documents: Documents = {}
    learners = {}
    for past in pasts:
        name, base = past.name, past.base
        if base is None:
            documents[name] = None
        else:
            stored = await state.store.call(lambda store, name=name, base=base: store.any_version(name, base))  # type: ignore[misc]
            documents[name] = stored.document
        learners[name] = await state.store.call(lambda store, name=name: store.settings(name).learner)  # type: ignore[misc]
    for repeated in _in_order(pasts):
        step = repeated.step
        if step.origin == "feedback":
            await _repeat_lesson(state, result_id, repeated, documents)
            continue
        [name] = repeated.names
        samples = await state.store.call(
            lambda store, name=name, step=step: _samples_of(store, name, step, (result_id,))  # type: ignore[misc]
        )
        limit = TimeLimit(state.settings.model_timeout_s, "MODEL_TIMEOUT_S")
        pages, settings = [sample.document for sample in samples], layout_settings(state.settings)
        document = documents[name]
        if not pages:
            documents[name] = None if step.origin == "initialize" else document
        elif step.origin == "initialize":
            initialize = state.operations.initialize_model
            items = await state.store.call(lambda store, name=name: items_of(store, name))  # type: ignore[misc]
            draft = await state.engine.submit(initialize, name, pages, settings, items, time_limit=limit)
            documents[name] = draft.document
        elif document is not None:
            rounds, learner = rounds_and_learner(step.note)
            packed = await asyncio.to_thread(packed_model, document)
            model = ModelDocument(name, step.version, packed, learner=learner or learners[name])
            train = state.operations.train_model
            draft, _ = await state.engine.submit(train, model, pages, rounds, settings, time_limit=limit)
            documents[name] = draft.document
    return documents


async def _repeat_lesson(state: AppState, result_id: str, repeated: _Repeated, documents: Documents) -> None:
    """One feedback on another result again, for the models whose history contains it."""
    step = repeated.step
    lesson = None
    if step.feedback_id is not None:
        feedback_id = step.feedback_id
        lesson = await state.store.call(lambda store: store.lesson(feedback_id))
    if lesson is None:
        name = repeated.names[0]
        raise NotUndoable(
            f"Version {step.version} of {name} learned later from a page that is not stored any more. Return to an "
            f"earlier version (POST /layout/models/{name}/rollback), or initialize the model from its samples."
        )
    verified = lesson_page(lesson.document)
    models = [
        model
        for name in (verified.verified_class, verified.found_class)
        if name is not None
        and (model := await _model_for(state, name, lesson, repeated, documents)) is not None
    ]
    models = list({model.name: model for model in models}.values())
    samples = None
    right = verified.verified_class
    if right is not None and right in repeated.names and documents[right] is None:
        without = (result_id, lesson.result_id)
        samples = await state.store.call(lambda store: _samples_of(store, right, step, without))
    taught = await teach(state, verified, models, samples)
    for name in repeated.names:
        documents[name] = taught.documents.get(name, documents[name])


async def _model_for(
    state: AppState, name: str, lesson: Lesson, repeated: _Repeated, documents: Documents
) -> ModelDocument | None:
    """The model of a class when the lesson comes: as computed so far, or the version that it had at the time."""
    learner = lesson.document["learners"].get(name)
    if name in repeated.names:
        document = documents[name]
        if document is None:
            return None
        packed = await asyncio.to_thread(packed_model, document)
        model = ModelDocument(name, repeated.step.version, packed)
    else:
        old, _ = lesson.versions.get(name, (None, 0))
        if old is None:
            return None
        model = await state.store.call(lambda store: document_of(store.any_version(name, old)))
    return model if learner is None else replace(model, learner=learner)


def _in_order(pasts: Sequence[ModelPast]) -> list[_Repeated]:
    """The steps of all histories in one order. A feedback that taught two of the models is one step."""
    sorter: TopologicalSorter[tuple[str, int | str]] = TopologicalSorter()
    steps: dict[tuple[str, int | str], tuple[ModelStep, list[str]]] = {}
    for past in pasts:
        before: tuple[str, int | str] | None = None
        for step in past.steps or ():
            node = ("", step.feedback_id) if step.feedback_id is not None else (past.name, step.version)
            steps.setdefault(node, (step, []))[1].append(past.name)
            sorter.add(node, *(() if before is None else (before,)))
            before = node
    return [_Repeated(steps[node][0], tuple(steps[node][1])) for node in sorter.static_order()]


def _samples_of(store: Store, name: str, step: ModelStep, without: Sequence[str]) -> list[StoredSample]:
    """The samples that a class had at the time of a step and still has, without those of some results."""
    samples = newest_samples(store, name, without_results=without)
    return [sample for sample in samples if sample.after_version < step.version]


def _named(pasts: Sequence[ModelPast]) -> str:
    return " and ".join(past.name for past in pasts)


def fresh_models(models: Sequence[ModelDocument], undone: Mapping[str, ModelUndo]) -> list[ModelDocument]:
    """The models, each without the lessons that are taken back; those that have no version then are left out."""
    fresh = []
    for model in models:
        undo = undone.get(model.name)
        if undo is None or not undo.changes:
            fresh.append(model)
        elif undo.document is not None:
            fresh.append(replace(model, document=packed_model(undo.document)))
    return fresh

"""One lesson: models learn from one verified page in a worker, and the documents that come back."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import get_args

from app.engine.base import TimeLimit
from app.learning.labelled_pages import layout_settings
from app.learning.samples import items_of
from app.state import AppState
from models.records import StoredSample
from services.contract.layout import ModelDocument
from services.contract.layout_learning import Adaptation, Learner, LessonJson, VerifiedPage
from services.contract.model_json import ModelJson
from services.contract.page_json import PageJson


@dataclass(frozen=True, slots=True)
class Taught:
    """What a verified page has done: the answer of the worker, and the new documents of all models by name."""

    adaptation: Adaptation
    documents: dict[str, ModelJson]


async def teach(
    state: AppState,
    verified: VerifiedPage[PageJson],
    models: Sequence[ModelDocument],
    samples: Sequence[StoredSample] | None,
) -> Taught:
    """The models of the found and the verified class after they have learned from a page.

    `models` has the newest versions of both classes. `samples` are those for a first version of the verified class;
    None: the class has a version, or there is no such class.
    """
    settings = layout_settings(state.settings)
    right = verified.verified_class
    items = () if right is None else await state.store.call(lambda store: items_of(store, right))
    adaptation = await state.engine.submit(state.operations.adapt_models, verified, models, settings, items)
    documents = dict(adaptation.documents)
    if samples is not None and right is not None and adaptation.zones:
        first = await state.engine.submit(
            state.operations.initialize_model,
            right,
            [*(sample.document for sample in samples), adaptation.sample],
            settings,
            items,
            time_limit=TimeLimit(state.settings.model_timeout_s, "MODEL_TIMEOUT_S"),
        )
        documents[right] = first.document
    return Taught(adaptation, documents)


def lesson_document(
    verified: VerifiedPage[PageJson], adaptation: Adaptation, models: Sequence[ModelDocument]
) -> LessonJson | None:
    """The lesson as it is stored, with the labels of all zones; None for a page without zones: it teaches nothing."""
    if not adaptation.zones:
        return None
    lesson: LessonJson = {
        "page": verified.page,
        "found_class": verified.found_class,
        "found_labels": verified.found_labels,
        "verified_class": verified.verified_class,
        "labels": {str(zone["id"]): zone.get("label") for zone in adaptation.sample["zones"]},
        "learners": {model.name: model.learner for model in models},
    }
    if verified.found_page is not None:
        lesson["found_page"] = verified.found_page
    return lesson


def lesson_page(lesson: LessonJson) -> VerifiedPage[PageJson]:
    """The verified page of a stored lesson."""
    return VerifiedPage(
        lesson["page"],
        lesson["found_class"],
        dict(lesson["found_labels"]),
        lesson["verified_class"],
        dict(lesson["labels"]),
        lesson.get("found_page"),
    )


def training_note(rounds: int, samples: int, learner: Learner) -> str:
    """The note of a version that a training made: all that is needed to do it again."""
    return f"{rounds} rounds, {samples} samples, {learner}"


def rounds_and_learner(note: str) -> tuple[int, Learner | None]:
    """Rounds and learner of a training, from the note of its version; older notes do not have the learner."""
    rounds = re.match(r"\d+", note)
    learner = next((name for name in get_args(Learner) if note.endswith(f", {name}")), None)
    return int(rounds[0]) if rounds else 1, learner

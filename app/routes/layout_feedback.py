"""POST /layout/results/{id}/feedback: corrections of results, from which models learn."""

from collections.abc import Mapping, Sequence
from functools import partial

from fastapi import APIRouter, Request, Response

from app.access.callers import caller_of, require_own_result
from app.http.connection import while_connected
from app.http.json_answers import answer_json
from app.http.json_bodies import json_request, read_json
from app.http.paging import LINK, Cursor, Limit, first_of, link_next
from app.http.problems import documented
from app.learning.feedback import learn_from_feedback
from app.learning.undo import undo_feedback
from app.routes.common_responses import BODY, READING, WORK
from app.routes.model_answers import IdempotencyKey
from app.schemas.layout_feedback import (
    AdaptedModel,
    Feedback,
    FeedbackBody,
    FeedbackEntry,
    FeedbackList,
    FeedbackVersions,
    UndoneFeedback,
    UndoneModel,
)
from app.schemas.layout_models import ModelName
from app.state import State
from models.errors import ResultNotFound
from models.feedback_records import FeedbackSummary, StoredFeedback
from services.contract.answers.learning import FeedbackReport, FoundAndVerified
from services.contract.answers.page import Warning

router = APIRouter(tags=["layout feedback"])


@router.post(
    "/layout/results/{id}/feedback",
    operation_id="give_layout_feedback",
    response_class=Response,
    responses={
        200: {
            "description": "The stored feedback; a repeated one gets the same response again.",
            "model": Feedback,
        },
        **documented("conflict", "store-full", "invalid-model", "not-storable", *READING, *BODY, *WORK),
    },
    openapi_extra=json_request(FeedbackBody),
)
async def give_layout_feedback(
    request: Request, state: State, id: str, idempotency_key: IdempotencyKey = None
) -> Response:
    """Correct a result: its class, the labels of its zones (of all zones, or only of the wrong ones), and their texts.

    The model of the class adapts at once, and the page becomes one of its samples. If the class was wrong, the model
    of the found class also adapts, so that it fits such pages less. A class that has samples and no model yet gets its
    first version, from the samples and this page; a class that does not exist is 404, or made with `new_class`. `class`
    null means that the page belongs to none of the classes. It is then stored as an unknown page, from which new
    classes may be proposed.
    """
    caller = await require_own_result(request, state, id)
    limit = state.settings.max_zones_bytes
    body = await read_json(request, FeedbackBody, most_bytes=limit, setting="MAX_ZONES_BYTES")
    feedback = await while_connected(
        request.receive, learn_from_feedback(state, id, caller.scoped(idempotency_key), body, caller.name)
    )
    request.state.seat.release()
    if body.new_class and feedback.created:
        await _keep_sample_image(state, feedback)
    warnings = [] if feedback.created else await _without_effect(state, feedback)
    return await answer_json(partial(_answer, feedback, warnings))


@router.delete(
    "/layout/results/{id}/feedback",
    operation_id="undo_layout_feedback",
    responses=documented("conflict", "invalid-model", *READING, *WORK),
)
async def undo_layout_feedback(request: Request, state: State, id: str) -> UndoneFeedback:
    """Take back all feedback on a result, as if it had never been sent.

    Every model that learned from it gets a new version: what it learned later is done again without this page. The
    sample made from the page is deleted, and the result has its recognized zones again. `conflict` when a model
    learned too much since, or when a page that it learned from later was deleted; then nothing changes. After it the
    same feedback may be sent again.
    """
    await require_own_result(request, state, id)
    undone = await while_connected(request.receive, undo_feedback(state, id))
    return UndoneFeedback(
        result=id,
        feedback=list(undone.feedback_ids),
        models=_undone_models(undone.versions),
        samples=undone.samples,
    )


@router.get(
    "/layout/models/{name}/feedback",
    operation_id="layout_model_feedback",
    responses={200: {"headers": LINK}, **documented(*READING)},
)
async def layout_model_feedback(
    request: Request,
    response: Response,
    state: State,
    name: ModelName,
    limit: Limit = 50,
    cursor: Cursor = None,
) -> FeedbackList:
    """The latest feedbacks on pages whose found or verified class is this one, newest first.

    With API keys, those of the caller's key.
    """
    owner = caller_of(request).only
    feedbacks, has_more = await state.store.call(
        lambda store: first_of(store.feedbacks(name, limit + 1, cursor, owner), limit)
    )
    if has_more:
        link_next(request, state, response, feedbacks[-1].id)
    return FeedbackList(model=name, feedback=[_entry(feedback) for feedback in feedbacks])


async def _keep_sample_image(state: State, feedback: StoredFeedback) -> None:
    """The picture of the page as the image of its sample, if one was kept in the size of the page.

    So the first page of a class can be measured again. Images of later samples are those that people have sent.
    """
    try:
        result = (await state.store.call(lambda store: store.result(feedback.result_id))).document["result"]
        image = result.get("image")
        if feedback.sample_id is None or image is None or image["width"] != round(result["width"]):
            return
        picture = await state.images.picture(feedback.result_id, image["bytes"])
    except ResultNotFound:  # deleted meanwhile, or it gave way to newer pictures
        return
    await state.sample_images.keep({feedback.sample_id: picture})


async def _without_effect(state: State, feedback: StoredFeedback) -> list[Warning]:
    """Why a repeated feedback is no longer part of its models."""
    made = {name: new for name, (_, new) in feedback.versions.items()}
    effects = await state.store.call(lambda store: store.effects(made))
    detail = {
        "rolled-back": "Version {version} of {name} has this feedback, but the model has left that version (rollback, "
        "import or initialization), so this feedback is not in effect. To teach it again, send DELETE to this path and "
        "then the feedback.",
        "replaced": "A later feedback on this result has replaced this one in {name}. To return to this one, send "
        "DELETE to this path and then the feedback.",
    }
    return [
        Warning(code=code, detail=detail[code].format(name=name, version=made[name]))
        for name, code in effects.items()
        if code is not None
    ]


def _undone_models(versions: Mapping[str, tuple[int | None, int | None]]) -> list[UndoneModel]:
    return [
        UndoneModel(name=name, old_version=old, new_version=new)
        for name, (old, new) in sorted(versions.items())
    ]


def _answer(feedback: StoredFeedback, warnings: Sequence[Warning]) -> Feedback:
    report = FeedbackReport.model_validate(feedback.report)
    costs = {each.model: each for each in report.costs}
    return Feedback(
        id=feedback.id,
        result=feedback.result_id,
        created=feedback.created,
        **{"class": report.class_},
        zones=report.zones,
        wrong=report.wrong,
        texts=report.texts,
        models=[
            AdaptedModel(
                name=name,
                old_version=old,
                new_version=new,
                cost_found=costs[name].found if name in costs else None,
                cost_verified=costs[name].verified if name in costs else None,
            )
            for name, (old, new) in sorted(feedback.versions.items())
        ],
        taken_back=_undone_models(feedback.taken_back),
        sample=feedback.sample_id,
        warnings=[*report.warnings, *warnings],
    )


def _entry(feedback: FeedbackSummary) -> FeedbackEntry:
    return FeedbackEntry(
        id=feedback.id,
        result=feedback.result_id,
        **{"class": FoundAndVerified(found=feedback.found_class, verified=feedback.verified_class)},
        zones=feedback.zones,
        wrong=feedback.wrong_zones,
        models=[
            FeedbackVersions(
                name=name, old_version=old, new_version=new, without_effect=feedback.without_effect.get(name)
            )
            for name, (old, new) in sorted(feedback.versions.items())
        ],
        sample=feedback.sample_id,
        created=feedback.created_at,
    )

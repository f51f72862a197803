"""POST /layout/models/{name}/train: training of a model on its samples."""

import json
from typing import Annotated

from fastapi import APIRouter, Depends, Query, Request, Response

from app.engine.base import TimeLimit
from app.http.json_bodies import json_request, read_json
from app.http.preconditions import Precondition, entity_tag, parse_precondition
from app.http.problems import documented
from app.learning.labelled_pages import layout_settings
from app.learning.lessons import training_note
from app.learning.samples import samples_to_learn_from
from app.routes.common_responses import BODY, READING, WORK
from app.routes.long_work import ACCEPTED, PREFER, answer_now_or_later, check_key
from app.routes.model_answers import ETAG, IfMatch
from app.schemas.layout_models import ModelName
from app.schemas.layout_training import TrainBody, TrainedModel
from app.schemas.options import CallbackUrl
from app.state import AppState, State
from app.storage.layout_store import document_of
from models.errors import ModelNotFound, VersionConflict
from models.records import StoredModel, StoredSample
from models.repository import Store
from services.contract.layout import ModelDocument
from services.progress import ProgressSink

router = APIRouter(prefix="/layout/models/{name}", tags=["layout models"])


@router.post(
    "/train",
    operation_id="train_layout_model",
    response_class=Response,
    responses={
        200: {
            "description": "Result of the training; a new version exists only if a round reduced the error.",
            "model": TrainedModel,
            "headers": ETAG,
        },
        **ACCEPTED,
        **documented("conflict", "no-samples", "invalid-model", *READING, *BODY, *WORK, conditional=True),
    },
    openapi_extra={**json_request(TrainBody, required=False), **PREFER},
    dependencies=[Depends(check_key)],
)
async def train_layout_model(
    request: Request,
    state: State,
    name: ModelName,
    if_match: IfMatch = None,
    callback_url: Annotated[CallbackUrl, Query()] = None,
) -> Response:
    """Train the model on its samples in rounds; it learns from every error (5.5, 5.6).

    The response has the error of each round, on the samples and on held-out samples. Training stops when the held-out
    error rises, and the best round is kept. If the samples are very many or very large, only the newest are used, up to
    40000 zones in all. If feedback changes the model meanwhile, training starts again from the new version.
    """
    precondition = parse_precondition(if_match, None)
    body = await read_json(request, TrainBody, default=TrainBody())
    # Checked here too, so that no job starts for a model that does not exist.
    await state.store.call(lambda store: precondition.check(name, store.model_summary(name).version))

    async def work(progress: ProgressSink | None) -> Response:
        response = await _train_and_store(state, name, body.rounds, precondition, progress)
        request.state.seat.release()
        return response

    return await answer_now_or_later(request, state, work)


async def _train_and_store(
    state: AppState, name: str, rounds: int, precondition: Precondition, progress: ProgressSink | None
) -> Response:
    """Train the newest version. If it has changed meanwhile, train the new one under the model's lock.

    Raises
    ------
    VersionConflict
        When another process changed the model during the second training.
    """
    try:
        return await _train_newest_version(state, name, rounds, precondition, progress)
    except VersionConflict:
        async with state.locks.hold([name], state.settings.queue_timeout_s, "QUEUE_TIMEOUT_S"):
            return await _train_newest_version(state, name, rounds, precondition, progress)


async def _train_newest_version(
    state: AppState, name: str, rounds: int, precondition: Precondition, progress: ProgressSink | None
) -> Response:
    def read(store: Store) -> tuple[StoredModel, ModelDocument, list[StoredSample]]:
        model = store.model(name)
        precondition.check(name, model.version)
        samples = samples_to_learn_from(store, name)
        if model.version is None:
            raise ModelNotFound(
                f"the model {name} has no version yet, only samples ({model.samples}); "
                f"POST /layout/models/{name}/initialize makes one",
                name,
            )
        return model, document_of(model), samples

    model, sent, samples = await state.store.call(read)
    trained, report = await state.engine.submit(
        state.operations.train_model,
        sent,
        [sample.document for sample in samples],
        rounds,
        layout_settings(state.settings),
        time_limit=TimeLimit(state.settings.model_timeout_s, "MODEL_TIMEOUT_S"),
        progress=progress,
    )

    def write(store: Store) -> int | None:
        if json.loads(json.dumps(trained.document)) == model.document:
            return model.version
        note = training_note(report.kept_round, len(samples), model.settings.learner)
        return store.add_version(
            name, trained.document, "train", expected_version=model.version, note=note
        ).version

    version = await state.store.call(write)
    assert version is not None
    answer = TrainedModel(
        name=name,
        version=version,
        changed=version != model.version,
        samples=len(samples),
        learner=model.settings.learner,
        rounds=list(report.rounds),
        kept_round=report.kept_round,
        stopped=report.stopped,
    )
    headers = {"ETag": entity_tag(version)}
    return Response(answer.model_dump_json(), headers=headers, media_type="application/json")

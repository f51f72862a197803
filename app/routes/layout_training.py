"""POST /layout/models/{name}/train: the model goes through its samples again."""

import json

from fastapi import APIRouter, Request, Response

from app.engine.base import TimeLimit
from app.layout_store import document_of
from app.preconditions import Precondition, entity_tag, parse_precondition
from app.problems import documented
from app.routes.json_bodies import json_request, read_json
from app.routes.labelled_pages import layout_settings
from app.routes.long_work import ACCEPTED, PREFER, answer_now_or_later
from app.routes.model_answers import ETAG, IfMatch
from app.routes.model_samples import samples_to_learn_from
from app.routes.state import AppState, State
from app.routes.usual_problems import BODY, READING, WORK
from app.schemas.layout_models import ModelName
from app.schemas.layout_training import Round, TrainBody, TrainedModel
from models.errors import ModelNotFound, VersionConflict
from models.records import StoredModel, StoredSample
from models.repository import Store
from services.progress import ProgressSink

router = APIRouter(prefix="/layout/models/{name}", tags=["layout models"])


@router.post(
    "/train",
    operation_id="train_layout_model",
    response_class=Response,
    responses={
        200: {
            "description": "What training made of the model; a new version only when a round was better.",
            "model": TrainedModel,
            "headers": ETAG,
        },
        **ACCEPTED,
        **documented("conflict", "no-samples", "invalid-model", *READING, *BODY, *WORK),
    },
    openapi_extra={**json_request(TrainBody, required=False), **PREFER},
)
async def train_layout_model(
    request: Request, state: State, name: ModelName, if_match: IfMatch = None
) -> Response:
    """Have the model go through its samples in rounds, and learn from every error that it makes (5.5, 5.6).

    The error of each round is told, on the samples and on some that are held out; training stops when the latter
    rises, and the best round is kept. Of very many or very large samples the newest are taken, with 40000 zones in all.
    When feedback changes the model meanwhile, training begins again with that.
    """
    precondition = parse_precondition(if_match, None)
    body = await read_json(request, TrainBody, default=TrainBody())
    # So that nobody is sent away with a job for a model that is not there.
    await state.store.call(lambda store: precondition.check(name, store.model_summary(name).version))

    async def work(progress: ProgressSink | None) -> Response:
        response = await train(state, name, body.rounds, precondition, progress)
        request.state.seat.release()
        return response

    return await answer_now_or_later(request, state, work)


async def train(
    state: AppState, name: str, rounds: int, precondition: Precondition, progress: ProgressSink | None = None
) -> Response:
    """Train the model and answer.

    Raises
    ------
    VersionConflict
        When the model was changed twice meanwhile; the second time by another process, for those of this one waited.
    """
    try:
        return await _train_once(state, name, rounds, precondition, progress)
    except VersionConflict:
        async with state.locks.hold([name], state.settings.queue_timeout_s, "QUEUE_TIMEOUT_S"):
            return await _train_once(state, name, rounds, precondition, progress)


async def _train_once(
    state: AppState, name: str, rounds: int, precondition: Precondition, progress: ProgressSink | None
) -> Response:
    def read(store: Store) -> tuple[StoredModel, list[StoredSample]]:
        model = store.model(name)
        precondition.check(name, model.version)
        samples = samples_to_learn_from(store, name)
        if model.version is None:
            raise ModelNotFound(
                f"the model {name} has {model.samples} samples and no version yet; "
                f"POST /layout/models/{name}/initialize makes one",
                name,
            )
        return model, samples

    model, samples = await state.store.call(read)
    training = await state.engine.submit(
        state.operations.train_model,
        document_of(model),
        [sample.document for sample in samples],
        rounds,
        model.settings.learner,
        layout_settings(state.settings),
        time_limit=TimeLimit(state.settings.model_timeout_s, "MODEL_TIMEOUT_S"),
        progress=progress,
    )

    def write(store: Store) -> int | None:
        if json.loads(json.dumps(training.document)) == model.document:
            return model.version
        note = f"{training.kept_round} rounds, {len(samples)} samples"
        return store.add_version(
            name, training.document, "train", expected_version=model.version, note=note
        ).version

    version = await state.store.call(write)
    assert version is not None
    answer = TrainedModel(
        name=name,
        version=version,
        changed=version != model.version,
        samples=len(samples),
        learner=model.settings.learner,
        rounds=[Round(**told) for told in training.rounds],
        kept_round=training.kept_round,
        stopped=training.stopped,
    )
    headers = {"ETag": entity_tag(version)}
    return Response(answer.model_dump_json(), headers=headers, media_type="application/json")

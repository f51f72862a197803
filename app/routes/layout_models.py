"""/layout/models: the models of document classes."""

import json
from functools import partial
from typing import Annotated

from fastapi import APIRouter, Depends, Query, Request, Response
from pydantic import Field

from app.engine.base import TimeLimit
from app.http.connection import while_connected
from app.http.json_answers import answer_json
from app.http.json_bodies import refuse_body
from app.http.paging import LINK, MOST_LISTED, Cursor, Limit, first_of, link_next
from app.http.preconditions import entity_tag, parse_precondition
from app.http.problems import documented
from app.learning.labelled_pages import count_labels, layout_settings
from app.learning.samples import items_of, samples_note, samples_to_learn_from
from app.routes.common_responses import BODY, READING, STORE, WORK
from app.routes.layout_settings import health_of
from app.routes.long_work import ACCEPTED, PREFER, answer_now_or_later, check_key
from app.routes.model_answers import ETAG, LOCATION, IfMatch, IfNoneMatch
from app.schemas.layout_models import (
    ImportedModel,
    InitializedModel,
    ModelList,
    ModelName,
    ModelSummary,
)
from app.schemas.options import Absent, CallbackUrl
from app.state import State
from models.errors import ModelNotFound
from models.records import StoredModel, StoredSample
from models.repository import Store
from services.contract.layout_models import ModelDraft
from services.progress import ProgressSink

router = APIRouter(prefix="/layout/models", tags=["layout models"])

_MODEL = {
    "type": "object",
    "title": "LayoutModel",
    "description": "A layout graph model, as GET exports it.",
    "required": ["format", "format_version"],
    "properties": {"format": {"type": "string"}, "format_version": {"type": "integer"}},
}


@router.get("", operation_id="layout_models", responses={200: {"headers": LINK}, **documented(*STORE)})
async def layout_models(
    request: Request,
    response: Response,
    state: State,
    limit: Limit = MOST_LISTED,
    cursor: Cursor = None,
) -> ModelList:
    """All layout models, by name, without their content; with their health, computed from feedback."""
    ready = await state.store.ready()
    stored, healths = await state.store.call(lambda store: (store.models(), store.healths()))
    models, has_more = first_of((model for model in stored if model.name > (cursor or "")), limit)
    if has_more:
        link_next(request, state, response, models[-1].name)
    return ModelList(
        models=[
            ModelSummary(
                name=model.name,
                version=model.version,
                samples=model.samples,
                labels=list(ready[model.name].labels) if model.name in ready else [],
                health=health_of(healths[model.name]),
                created=model.created_at,
                updated=model.updated_at,
            )
            for model in models
            if model.name in healths
        ]
    )


@router.get(
    "/{name}",
    operation_id="layout_model",
    response_class=Response,
    responses={
        200: {
            "description": "The model, in the form that PUT accepts.",
            "content": {"application/json": {"schema": _MODEL}},
            "headers": ETAG,
        },
        **documented(*READING),
    },
)
async def layout_model(
    state: State,
    name: ModelName,
    version: Annotated[
        Annotated[int, Field(ge=1)] | Absent, Query(description="An earlier version; default: the newest.")
    ] = None,
) -> Response:
    """Export a model: its newest version, or an earlier one."""

    def read(store: Store) -> tuple[StoredModel, str]:
        model = store.model(name, version)
        return model, json.dumps(model.document, ensure_ascii=False, separators=(",", ":"))

    model, body = await state.store.call(read)
    if model.version is None or model.document is None:
        raise ModelNotFound(
            f"the model {name} has no version yet, only samples ({model.samples}); "
            f"create one with POST /layout/models/{name}/initialize",
            name,
        )
    return Response(body, media_type="application/json", headers={"ETag": entity_tag(model.version)})


@router.put(
    "/{name}",
    operation_id="import_layout_model",
    response_class=Response,
    responses={
        200: {"description": "A new version of the model.", "model": ImportedModel, "headers": ETAG},
        201: {
            "description": "The first version of a new model.",
            "model": ImportedModel,
            "headers": {**ETAG, **LOCATION},
        },
        **documented("store-full", "invalid-model", *READING, *BODY, *WORK, conditional=True),
    },
    openapi_extra={
        "requestBody": {"required": True, "content": {"application/json": {"schema": _MODEL}}},
    },
)
async def import_layout_model(
    request: Request,
    state: State,
    name: ModelName,
    if_match: IfMatch = None,
    if_none_match: IfNoneMatch = None,
) -> Response:
    """Import a model that GET exported, from this or another service, as the newest version under this name.

    If the document has a name, it must equal the name in the path.
    """
    precondition = parse_precondition(if_match, if_none_match)
    document = await request.body()
    work = state.engine.submit(state.operations.import_model, name, document)
    draft: ModelDraft = await while_connected(request.receive, work)
    request.state.seat.release()

    before: int | None = None

    def check(current: int | None) -> None:
        nonlocal before
        before = current
        precondition.check(name, current)

    most = state.settings.max_models
    model = await state.store.call(
        lambda store: store.add_version(
            name, draft.document, "import", expected_version=check, max_models=most
        )
    )
    assert model.version is not None
    headers = {"ETag": entity_tag(model.version)}
    if before is None:
        headers["Location"] = f"/layout/models/{name}"
    status = 201 if before is None else 200
    answer = partial(ImportedModel, name=name, version=model.version, labels=draft.labels)
    return await answer_json(answer, status, headers)


@router.delete(
    "/{name}",
    operation_id="delete_layout_model",
    status_code=204,
    response_class=Response,
    responses=documented(*READING, conditional=True),
)
async def delete_layout_model(state: State, name: ModelName, if_match: IfMatch = None) -> None:
    """Delete a model with its samples. A later model of this name continues its version numbers."""
    expected = partial(parse_precondition(if_match, None).check, name)
    await state.store.call(lambda store: store.delete_model(name, expected_version=expected))


@router.post(
    "/{name}/initialize",
    operation_id="initialize_layout_model",
    response_class=Response,
    responses={
        200: {"description": "The new version.", "model": InitializedModel, "headers": ETAG},
        **ACCEPTED,
        **documented("conflict", "no-samples", *READING, *BODY, *WORK, conditional=True),
    },
    openapi_extra=PREFER,
    dependencies=[Depends(check_key)],
)
async def initialize_layout_model(
    request: Request,
    state: State,
    name: ModelName,
    if_match: IfMatch = None,
    callback_url: Annotated[CallbackUrl, Query()] = None,
) -> Response:
    """Create a new version of the model from its samples. What it learned in other ways remains in earlier versions.

    If the samples are very many or very large, only the newest are used, up to 40000 zones in all; `samples` in the
    response counts them.
    """
    precondition = parse_precondition(if_match, None)
    await refuse_body(request)

    def read(store: Store) -> tuple[list[StoredSample], tuple[str, ...]]:
        precondition.check(name, store.model_summary(name).version)
        return samples_to_learn_from(store, name), items_of(store, name)

    samples, items = await state.store.call(read)

    async def work(progress: ProgressSink | None) -> Response:
        draft = await state.engine.submit(
            state.operations.initialize_model,
            name,
            [sample.document for sample in samples],
            layout_settings(state.settings),
            items,
            time_limit=TimeLimit(state.settings.model_timeout_s, "MODEL_TIMEOUT_S"),
            progress=progress,
        )
        request.state.seat.release()

        expected, note = partial(precondition.check, name), samples_note(samples)
        model = await state.store.call(
            lambda store: store.add_version(
                name, draft.document, "initialize", expected_version=expected, note=note
            )
        )
        assert model.version is not None
        return await answer_json(
            partial(_initialized, model, samples, draft), headers={"ETag": entity_tag(model.version)}
        )

    return await answer_now_or_later(request, state, work)


def _initialized(model: StoredModel, samples: list[StoredSample], draft: ModelDraft) -> InitializedModel:
    assert model.version is not None
    counts = count_labels(sample.document for sample in samples)
    return InitializedModel(
        name=model.name,
        version=model.version,
        samples=len(samples),
        labels={label: counts.get(label, 0) for label in draft.labels},
        warnings=draft.warnings,
    )

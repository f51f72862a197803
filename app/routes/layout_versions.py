"""/layout/models/{name}/versions: history of a model, difference of two versions, and rollback."""

from functools import partial
from typing import Annotated

from fastapi import APIRouter, Path, Query, Request, Response
from pydantic import Field

from app.http.connection import while_connected
from app.http.json_bodies import json_request, read_json
from app.http.paging import LINK, MOST_LISTED, Limit, first_of, link_next
from app.http.preconditions import entity_tag, parse_precondition
from app.http.problems import documented
from app.routes.common_responses import BODY, READING, WORK
from app.routes.model_answers import ETAG, IfMatch
from app.schemas.layout_models import ModelName
from app.schemas.layout_versions import (
    Difference,
    RestoredModel,
    RollbackBody,
    Version,
    VersionList,
)
from app.schemas.options import Absent
from app.state import State
from app.storage.layout_store import document_of, labels_of
from models.errors import ModelNotFound
from models.records import MOST_INTEGER
from models.repository import Store
from services.contract.layout import ModelDocument

router = APIRouter(prefix="/layout/models/{name}", tags=["layout models"])


@router.get(
    "/versions",
    operation_id="layout_model_versions",
    responses={200: {"headers": LINK}, **documented(*READING)},
)
async def layout_model_versions(
    request: Request,
    response: Response,
    state: State,
    name: ModelName,
    limit: Limit = MOST_LISTED,
    cursor: Annotated[
        Annotated[int, Field(ge=1, le=MOST_INTEGER)] | Absent,
        Query(description="Where the list continues, from the `Link` header of the previous part."),
    ] = None,
) -> VersionList:
    """Versions of a model, newest first; GET /layout/models/{name}?version= exports each of them."""
    versions, has_more = await state.store.call(
        lambda store: first_of(reversed(store.model_versions(name, limit + 1, cursor)), limit)
    )
    if has_more:
        link_next(request, state, response, versions[-1].version)
    return VersionList(
        name=name,
        versions=[
            Version(
                version=version.version, origin=version.origin, note=version.note, created=version.created_at
            )
            for version in versions
        ],
    )


@router.get(
    "/versions/{version}/diff",
    operation_id="layout_model_diff",
    responses=documented("invalid-model", *READING, *WORK),
)
async def layout_model_diff(
    request: Request,
    state: State,
    name: ModelName,
    version: Annotated[int, Path(ge=1, le=MOST_INTEGER)],
    against: Annotated[
        Annotated[int, Field(ge=1, le=MOST_INTEGER)] | Absent,
        Query(description="The other version; default: the previous one."),
    ] = None,
    limit: Annotated[
        int,
        Query(
            ge=0,
            le=MOST_LISTED,
            description="Largest number of changes in the response, largest first; `total` counts all.",
        ),
    ] = 100,
) -> Difference:
    """Differences between two versions of a model, ordered by their effect on costs, largest first.

    Each change has the old and the new number of an attribute, weight or look-up table. Its size is the largest
    possible change of the cost of a zone or of a pair of zones.
    """

    def read(store: Store) -> tuple[ModelDocument, ModelDocument]:
        after = document_of(store.model(name, version))
        if against is None and version == 1:
            raise ModelNotFound(
                f"the model {name} has no version before version 1; name another version in `against`", name
            )
        return document_of(store.model(name, version - 1 if against is None else against)), after

    old, new = await state.store.call(read)
    work = state.engine.submit(state.operations.compare_models, old, new, limit)
    difference = await while_connected(request.receive, work)
    return Difference(
        name=name,
        version=new.version,
        against=old.version,
        total=difference.total,
        changes=difference.changes,
    )


@router.post(
    "/rollback",
    operation_id="roll_layout_model_back",
    response_class=Response,
    responses={
        200: {"description": "The new version.", "model": RestoredModel, "headers": ETAG},
        **documented(*READING, *BODY, conditional=True),
    },
    openapi_extra=json_request(RollbackBody),
)
async def roll_layout_model_back(
    request: Request, state: State, name: ModelName, if_match: IfMatch = None
) -> Response:
    """Make the content of an earlier version the newest version; the versions between them are kept.

    The samples remain, also those that came after that version; the next initialization uses them. The response names
    these. `drop_later_samples` deletes them.
    """
    expected = partial(parse_precondition(if_match, None).check, name)
    body = await read_json(request, RollbackBody)
    model = await state.store.call(lambda store: store.rollback(name, body.version, expected))
    dropped = 0
    if body.drop_later_samples:
        dropped = await state.store.call(lambda store: store.delete_samples_after(name, body.version))
    later = await state.store.call(lambda store: store.samples_after(name, body.version))
    assert model.version is not None
    assert model.document is not None
    answer = RestoredModel(
        name=name,
        version=model.version,
        restored=body.version,
        labels=list(labels_of(model.document)),
        samples=model.samples - dropped,
        later_samples=later,
        dropped_samples=dropped,
    )
    headers = {"ETag": entity_tag(model.version)}
    return Response(answer.model_dump_json(), headers=headers, media_type="application/json")

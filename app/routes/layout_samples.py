"""/layout/models/{name}/samples: the verified pages from which a model is made."""

from fastapi import APIRouter, Request, Response

from app.access.callers import caller_of
from app.http.connection import while_connected
from app.http.form_parts import FormRoute
from app.http.paging import LINK, MOST_LISTED, Cursor, Limit, first_of, link_next
from app.http.problems import documented
from app.learning.labelled_pages import (
    LABELLED_PAGE_BODY,
    count_labels,
    labelled_page,
    layout_settings,
    read_upload,
)
from app.routes.common_responses import FORM, IMAGE, READING, STORE, WORK
from app.routes.model_answers import IdempotencyKey
from app.schemas.layout_models import ModelName
from app.schemas.layout_samples import Sample, SampleList, SampleReceipt, SampleSummary, without_words
from app.state import State
from models.records import StoredSample

router = APIRouter(prefix="/layout/models/{name}/samples", tags=["layout models"], route_class=FormRoute)


@router.post(
    "",
    operation_id="add_layout_sample",
    response_class=Response,
    responses={
        200: {"description": "The sample already existed.", "model": SampleReceipt},
        201: {
            "description": "The sample was added; the first one of a name creates the class.",
            "model": SampleReceipt,
            "headers": {"Location": {"description": "Its path.", "schema": {"type": "string"}}},
        },
        **documented("not-found", "conflict", "store-full", "not-storable", *FORM, *IMAGE, *STORE, *WORK),
    },
    openapi_extra=LABELLED_PAGE_BODY,
)
async def add_layout_sample(
    request: Request, state: State, name: ModelName, idempotency_key: IdempotencyKey = None
) -> Response:
    """Add one verified page: its zones with the correct labels (`zones` or `zones_file`), and the image if available.

    Missing properties of zones (lines, font size, text) are measured and read in the image. A label that is null or
    absent means that the zone has no label of the model; at least one zone must have a label. The model uses the
    sample after POST /layout/models/{name}/initialize. The image is kept to measure the sample again when segmentation
    improves (MAX_SAMPLE_IMAGES_BYTES).
    """
    settings, measure = layout_settings(state.settings), state.operations.measure_sample_file
    async with labelled_page(request, state.settings) as page:
        warnings = []
        if page.zones_file is None:
            zones = state.engine.submit(state.operations.measure_sample, page.image, page.zones, settings)
            document = await while_connected(request.receive, zones)
        else:
            file = state.engine.submit(measure, page.image, page.zones_file, settings)
            measured = await while_connected(request.receive, file)
            document, warnings = measured.document, measured.warnings
        picture = b"" if page.image is None else await read_upload(page.image)
    request.state.seat.release()
    sample = await state.store.call(
        lambda store: store.add_sample(
            name,
            document,
            key=caller_of(request).scoped(idempotency_key),
            max_samples=state.settings.max_samples_per_model,
            max_models=state.settings.max_models,
        )
    )
    await state.sample_images.keep({sample.id: picture})
    answer = SampleReceipt(
        id=sample.id,
        model=name,
        zones=len(sample.document["zones"]),
        labels=count_labels([sample.document]),
        warnings=warnings,
    )
    headers = {"Location": f"/layout/models/{name}/samples/{sample.id}"} if sample.created else {}
    return Response(
        answer.model_dump_json(), 201 if sample.created else 200, headers, media_type="application/json"
    )


@router.get("", operation_id="layout_samples", responses={200: {"headers": LINK}, **documented(*READING)})
async def layout_samples(
    request: Request,
    response: Response,
    state: State,
    name: ModelName,
    limit: Limit = MOST_LISTED,
    cursor: Cursor = None,
) -> SampleList:
    """Samples of a model, oldest first, without their zones."""

    def summarize(sample: StoredSample) -> SampleSummary:
        labels = count_labels([sample.document])
        zones = len(sample.document["zones"])
        return SampleSummary(id=sample.id, zones=zones, labels=labels, created=sample.created_at)

    summaries, has_more = await state.store.read_list(
        lambda store: first_of(map(summarize, store.each_sample(name, after=cursor or "")), limit)
    )
    if has_more:
        link_next(request, state, response, summaries[-1].id)
    return SampleList(model=name, samples=summaries)


@router.get("/{id}", operation_id="layout_sample", responses=documented(*READING))
async def layout_sample(state: State, name: ModelName, id: str) -> Sample:
    """One sample, with all measured properties."""
    sample = await state.store.call(lambda store: store.sample(name, id))
    return Sample.model_validate(
        {**without_words(sample.document), "id": sample.id, "model": name, "created": sample.created_at}
    )


@router.delete(
    "/{id}",
    operation_id="delete_layout_sample",
    status_code=204,
    response_class=Response,
    responses=documented(*READING),
)
async def delete_layout_sample(state: State, name: ModelName, id: str) -> None:
    """Delete a sample with its image; the model changes with the next POST .../initialize."""
    await state.store.call(lambda store: store.delete_sample(name, id))
    await state.sample_images.forget([id])

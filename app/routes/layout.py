"""POST /layout: a page or its zones -> document class and labels; and what became of it."""

from typing import Annotated, Any

from fastapi import APIRouter, Form, Request, Response

from app.operations import LayoutOptions, LayoutReply
from app.problems import documented
from app.representations import LAYOUT_MEDIA_TYPES, choose_layout_format, layout_headers
from app.routes.labelled_pages import MissingPart, layout_settings, zones_upload
from app.routes.long_work import ACCEPTED, PREFER, answer_now_or_later
from app.routes.state import State
from app.schemas.layout import LayoutForm, LayoutResult, parse_names, result_of
from services.errors import InvalidOption
from services.progress import ProgressSink

router = APIRouter(tags=["layout"])


_STRING = {"schema": {"type": "string"}}
_HEADERS: dict[str, Any] = {
    "Document-Class": {"description": "Name of the class; left out when `class` is null.", **_STRING},
    "Document-Result": {"description": "Where the result is kept as JSON.", **_STRING},
    "Document-Warnings": {"description": "Codes, separated by commas.", **_STRING},
    "Server-Timing": {"description": "Milliseconds of each stage.", **_STRING},
}


@router.post(
    "/layout",
    operation_id="layout",
    response_class=Response,
    responses={
        200: {
            "description": "Class and labels, as JSON, as PAGE-XML or ALTO (application/xml), or drawn on the page.",
            "model": LayoutResult,
            "content": {
                "application/xml": {"schema": {"type": "string"}},
                "image/png": {"schema": {"type": "string", "format": "binary"}},
            },
            "headers": _HEADERS,
        },
        **ACCEPTED,
        **documented(
            "bad-request",
            "not-found",
            "not-acceptable",
            "request-timeout",
            "too-large",
            "out-of-memory",
            "unsupported-media-type",
            "undecodable-image",
            "invalid-option",
            "invalid-model",
            "no-text",
            "worker-died",
            "internal",
            "busy",
            "shutting-down",
            "store-unavailable",
            "timed-out",
        ),
    },
    openapi_extra=PREFER,
    form_limits={"max_fields": 10, "max_files": 4},
)
async def layout(
    request: Request, state: State, form: Annotated[LayoutForm, Form(media_type="multipart/form-data")]
) -> Response:
    """Tell the class of a document and the logical label of each of its zones.

    Send the page as `image`, or its zones as `zones` or `zones_file`, or the image and its zones. What comes back
    follows `format`, or `Accept` (application/xml: PAGE-XML); with neither, JSON. The result is kept for a while
    under its id. Without any model, zones come back unlabelled and `class` is null; `class` is null too when the
    page is more likely of none of the classes, and zones then have the labels of the nearest model.
    """
    check_parts(form)
    chosen = choose_layout_format(form.format, request.headers.get("accept"))
    settings = state.settings
    models = await state.store.ready_models(None if form.models is None else parse_names(form.models))
    zones = zones_upload(form.zones, "zones", settings.max_zones_bytes)
    zones_file = zones_upload(form.zones_file, "zones_file", settings.max_zones_file_bytes)

    async def work(progress: ProgressSink | None) -> Response:
        reply: LayoutReply = await state.engine.submit(
            state.operations.recognize_layout,
            form.image,
            zones,
            zones_file,
            models,
            LayoutOptions(form.rectify, form.ocr == "auto", chosen, form.explain, _image_name(form)),
            layout_settings(settings),
            progress=progress,
        )
        request.state.seat.release()
        result_of(reply.document, "held to the contract before it is kept")
        result_id = await state.store.keep_result({"result": reply.document, "page": reply.page})
        headers = layout_headers(reply.document) | {"Document-Result": f"/layout/results/{result_id}"}
        if chosen != "json":
            return Response(reply.body, media_type=reply.media_type, headers=headers)
        body = result_of(reply.document, result_id).model_dump_json(by_alias=True)
        return Response(body, media_type=LAYOUT_MEDIA_TYPES["json"], headers=headers)

    return await answer_now_or_later(request, state, work)


@router.get(
    "/layout/results/{id}",
    operation_id="layout_result",
    response_class=Response,
    responses={
        200: {"description": "The result again.", "model": LayoutResult},
        **documented("not-found", "internal", "store-unavailable"),
    },
)
async def layout_result(state: State, id: str) -> Response:
    """The same result again, as JSON; it is kept for RESULT_TTL_S seconds, and longest MAX_RESULTS results."""
    kept = await state.store.call(lambda store: store.result(id))
    body = result_of(kept.document["result"], kept.id).model_dump_json(by_alias=True)
    return Response(body, media_type=LAYOUT_MEDIA_TYPES["json"])


def check_parts(form: LayoutForm) -> None:
    """Refuse parts that do not go together.

    Raises
    ------
    MissingPart, InvalidOption
    """
    has_zones = form.zones is not None or form.zones_file is not None
    if form.image is None and not has_zones:
        raise MissingPart(
            "image: send the page as a file part of multipart/form-data, or its zones as `zones` or `zones_file`.",
            "image",
        )
    if form.zones is not None and form.zones_file is not None:
        raise InvalidOption("zones_file: send the zones once, as zones or as zones_file.", "zones_file")
    if form.rectify and has_zones:
        raise InvalidOption(
            "rectify: zones are in pixels of the image as it is; send the image alone to have it rectified.",
            "rectify",
        )


def _image_name(form: LayoutForm) -> str:
    """What PAGE-XML and ALTO call the image: its file's name without folders."""
    name = (form.image.filename or "") if form.image is not None else ""
    return name.replace("\\", "/").rpartition("/")[2][:200] or "page"

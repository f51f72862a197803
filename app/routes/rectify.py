"""POST /rectify: one photo of a page -> its frontal flat view."""

import asyncio
from collections.abc import Coroutine
from typing import Annotated, Any, TypeVar

from fastapi import APIRouter, Form, Request, Response

from app.operations import Encoding, Reply, UploadLimits
from app.problems import documented
from app.representations import MEDIA_TYPES, SNIFFED_BYTES, choose_format, image_headers, sniff_format
from app.routes.state import State
from app.schemas.rectify import RectifyForm, RectifyResult, parse_region
from app.uploads import ClientGone
from services.rectify.parameters import RectifyParameters

T = TypeVar("T")

router = APIRouter(tags=["rectify"])

_BINARY: dict[str, Any] = {"schema": {"type": "string", "format": "binary"}}
_IMAGE_HEADERS: dict[str, Any] = {
    "Document-Kind": {"description": "planar or curved.", "schema": {"type": "string"}},
    "Document-Rotation": {
        "description": "Clockwise degrees that were applied so that it reads.",
        "schema": {"type": "string", "enum": ["0", "90", "180", "270"]},
    },
    "Document-Warnings": {"description": "Codes, separated by commas.", "schema": {"type": "string"}},
    "Server-Timing": {"description": "Milliseconds of each stage.", "schema": {"type": "string"}},
}


@router.post(
    "/rectify",
    operation_id="rectify",
    response_class=Response,
    responses={
        200: {
            "description": "The flat view, or its description as JSON; the headers are those of images.",
            "model": RectifyResult,
            "content": {media_type: _BINARY for name, media_type in MEDIA_TYPES.items() if name != "json"},
            "headers": _IMAGE_HEADERS,
        },
        **documented(
            "bad-request",
            "not-acceptable",
            "request-timeout",
            "too-large",
            "out-of-memory",
            "unsupported-media-type",
            "undecodable-image",
            "invalid-option",
            "no-text",
            "worker-died",
            "internal",
            "busy",
            "shutting-down",
            "timed-out",
        ),
    },
)
async def rectify(
    request: Request, state: State, form: Annotated[RectifyForm, Form(media_type="multipart/form-data")]
) -> Response:
    """Flatten one photo of a page, taken from any position.

    What comes back follows `Accept`, or the field `format`; with neither, an image in the upload's own
    format (HEIC: JPEG).
    """
    head = await form.image.read(SNIFFED_BYTES)
    await form.image.seek(0)
    encoding = Encoding(
        format=choose_format(form.format, request.headers.get("accept"), sniff_format(head)),
        quality=form.quality,
        embed=form.embed,
    )
    parameters = RectifyParameters(
        kind=form.kind,
        upright=form.upright,
        focal_length_px=form.focal_length_px,
        region=None if form.region is None else parse_region(form.region),
        illumination=form.illumination,
    )
    limits = UploadLimits(
        state.settings.max_upload_bytes, state.settings.max_megapixels, state.settings.max_exif_bytes
    )
    work = state.engine.submit(state.operations.rectify, form.image, parameters, encoding, limits)
    reply: Reply = await while_connected(request, work)
    request.state.seat.release()
    if encoding.format == "json":
        body = RectifyResult.model_validate(reply.document).model_dump_json()
        return Response(body, media_type="application/json", headers={"Vary": "Accept"})
    headers = image_headers(reply.document) | {"Vary": "Accept"}
    return Response(reply.body, media_type=reply.media_type, headers=headers)


async def while_connected(request: Request, work: Coroutine[Any, Any, T]) -> T:
    """Answer of `work`, which is cancelled when the client leaves.

    Raises
    ------
    ClientGone
        When it left; nobody will read the answer to that.
    """
    job = asyncio.ensure_future(work)
    leaving = asyncio.ensure_future(_until_disconnected(request))
    try:
        await asyncio.wait((job, leaving), return_when=asyncio.FIRST_COMPLETED)
        if not job.done():
            raise ClientGone("The client closed the connection before the work was done.")
        return job.result()
    finally:
        job.cancel()
        leaving.cancel()
        await asyncio.gather(job, leaving, return_exceptions=True)


async def _until_disconnected(request: Request) -> None:
    while (await request.receive())["type"] != "http.disconnect":
        pass

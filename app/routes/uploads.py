"""/uploads: files that arrive in pieces, by the protocol tus 1.0.0, and then stand in forms by their ids."""

import re
from typing import Annotated

from fastapi import APIRouter, Header, Request, Response
from starlette.datastructures import UploadFile

from app.access.callers import caller_of
from app.http.form_parts import spooled_file
from app.http.json_answers import JSON
from app.http.octets import OCTETS
from app.http.problems import documented
from app.http.tus import PIECE_TYPE, PIECE_TYPES, VERSION, Checksum, TusRoute, name_in, upload_headers
from app.http.upload_places import BodyTooSlow, UploadPlace
from app.http.uploads import ClientGone
from app.routes.common_responses import BODY, STORE
from app.schemas.uploads import UploadState
from app.state import AppState, State
from app.storage.uploads import PIECE_BYTES
from models.errors import UploadMoved, UploadNotFound
from models.records import StoredUpload
from services.errors import TooLarge, UnsupportedMediaType

router = APIRouter(prefix="/uploads", tags=["uploads"], route_class=TusRoute)

_INTEGER = {"schema": {"type": "integer", "minimum": 0}}
_STRING = {"schema": {"type": "string"}}
_OF_UPLOAD = {
    "Tus-Resumable": {"description": "Version of the protocol.", **_STRING},
    "Upload-Offset": {"description": "Bytes that have come.", **_INTEGER},
    "Upload-Length": {"description": "Bytes of the whole file.", **_INTEGER},
    "Upload-Expires": {"description": "When the upload is deleted.", **_STRING},
    "Upload-Metadata": {
        "description": "`filename` and the name of the file in base64; absent without one.",
        **_STRING,
    },
}
_VERSIONED = {
    "parameters": [
        {
            "name": "Tus-Resumable",
            "in": "header",
            "required": True,
            "description": "Version of the protocol.",
            "schema": {"type": "string", "pattern": rf"^{re.escape(VERSION)}$", "default": VERSION},
        }
    ]
}
_PIECE = {
    **_VERSIONED,
    "requestBody": {
        "required": True,
        "description": f"The next bytes of the file; clients of tus send them as {PIECE_TYPE}.",
        "content": {OCTETS: {"schema": {"type": "string", "format": "binary"}}},
    },
}
_MOST_BYTES = 2**53
"""Largest integer of JSON in a browser; the limit is far below it."""


@router.post(
    "",
    operation_id="begin_upload",
    status_code=201,
    response_model=UploadState,
    responses={
        201: {
            "description": "The upload; `Location` is its path.",
            "headers": {"Location": {"description": "The upload's path.", **_STRING}, **_OF_UPLOAD},
        },
        **documented("too-large", "busy", "invalid-option", *STORE, of_tus=True),
    },
    openapi_extra=_VERSIONED,
)
async def begin_upload(
    request: Request,
    state: State,
    upload_length: Annotated[int, Header(ge=0, le=_MOST_BYTES, description="Bytes of the file.")],
    upload_metadata: Annotated[
        str, Header(description="`filename` and the name of the file in base64.")
    ] = "",
) -> Response:
    """Begin an upload in pieces (tus 1.0.0, creation); the answer has its id."""
    most_bytes, setting = state.settings.largest_upload
    if upload_length > most_bytes:
        raise TooLarge(
            f"Upload-Length: an upload may have {most_bytes} bytes ({setting}); this one has {upload_length}.",
            "Upload-Length",
        )
    name = name_in(upload_metadata)
    upload = await state.uploads.begin(upload_length, name, caller_of(request).name)
    return _described(upload, 201, {"Location": f"/uploads/{upload.id}"})


@router.get(
    "/{id}",
    operation_id="show_upload",
    response_model=UploadState,
    responses={200: {"headers": _OF_UPLOAD}, **documented("not-found", *STORE)},
)
async def show_upload(request: Request, state: State, id: str) -> Response:
    """How far the upload has come; HEAD has it in `Upload-Offset`."""
    return _described(await own_upload(request, state, id))


@router.patch(
    "/{id}",
    operation_id="send_piece",
    status_code=204,
    responses={
        204: {"description": "All that was sent is kept.", "headers": _OF_UPLOAD},
        **documented(
            "not-found",
            "wrong-offset",
            "unsupported-media-type",
            "invalid-option",
            "checksum-mismatch",
            "busy",
            *BODY,
            *STORE,
            of_tus=True,
        ),
    },
    openapi_extra=_PIECE,
)
async def send_piece(
    request: Request,
    state: State,
    id: str,
    upload_offset: Annotated[int, Header(ge=0, le=_MOST_BYTES, description="Where the piece begins.")],
    upload_checksum: Annotated[
        str | None, Header(description="`sha1` or `sha256`, a space, and the digest of the piece in base64.")
    ] = None,
) -> Response:
    """Send the next bytes of the file, as many as are at hand; where the connection breaks, what has come is kept.

    With a checksum the piece is kept as a whole or not at all.
    """
    upload = await own_upload(request, state, id)
    if request.headers.get("content-type", "").strip().lower() not in PIECE_TYPES:
        raise UnsupportedMediaType(f"Send a piece with Content-Type: {PIECE_TYPE}.", "Content-Type")
    if upload_offset != upload.received:
        raise UploadMoved(
            f"the upload has {upload.received} bytes, and this piece begins at {upload_offset}: ask for the offset "
            "(HEAD), and go on from there"
        )
    checksum = None if upload_checksum is None else Checksum(upload_checksum)
    place = state.places.enter()
    try:
        upload = await _receive(request, state, upload, place, checksum)
    finally:
        place.leave()
    return Response(status_code=204, headers=upload_headers(upload))


@router.delete(
    "/{id}",
    operation_id="delete_upload",
    status_code=204,
    responses=documented("not-found", *STORE),
)
async def delete_upload(request: Request, state: State, id: str) -> Response:
    """Delete an upload with what has come of it."""
    await own_upload(request, state, id)
    await state.uploads.delete(id)
    return Response(status_code=204)


async def own_upload(request: Request, state: AppState, upload_id: str) -> StoredUpload:
    """An upload of the caller. Raises `UploadNotFound`, also where another key has it."""
    if "/" in upload_id:
        raise UploadNotFound(
            f"{upload_id!r} is no id of an upload: send the id alone, without its path", upload_id
        )
    upload = await state.uploads.find(upload_id)
    if not caller_of(request).sees(upload.owner):
        raise UploadNotFound(f"there is no upload {upload_id!r}, or no longer", upload_id)
    return upload


async def _receive(
    request: Request, state: AppState, upload: StoredUpload, place: UploadPlace, checksum: Checksum | None
) -> StoredUpload:
    """The upload with the body of the request, which is kept whenever `PIECE_BYTES` are there, and at its end.

    Raises
    ------
    ClientGone, BodyTooSlow
        When the body does not come to its end; what has come is kept, unless it has a checksum.
    TooLarge
        When the body goes beyond the upload's end; its last piece is not kept.
    ChecksumMismatch
    """
    piece = spooled_file()
    try:
        is_last = False
        while not is_last:
            try:
                data, is_last = await _next(request, place)
            except (ClientGone, BodyTooSlow):
                if checksum is None and piece.size:
                    await state.uploads.append(upload, piece.file, piece.size)
                raise
            if upload.received + _size(piece) + len(data) > upload.length:
                raise TooLarge(
                    f"The upload has {upload.length} bytes (Upload-Length); this piece goes beyond them.",
                    "body",
                )
            await piece.write(data)
            if checksum is not None:
                checksum.add(data)
            elif _size(piece) >= PIECE_BYTES:
                upload = await state.uploads.append(upload, piece.file, _size(piece))
                await piece.close()
                piece = spooled_file()
        if checksum is not None:
            checksum.check()
        return await state.uploads.append(upload, piece.file, _size(piece)) if piece.size else upload
    finally:
        await piece.close()


async def _next(request: Request, place: UploadPlace) -> tuple[bytes, bool]:
    """The next bytes of the body, and whether they are the last. Raises `ClientGone` and `BodyTooSlow`."""
    message = await place.receive(request.receive)
    if message["type"] == "http.disconnect":
        raise ClientGone("The client closed the connection before the body was there.")
    return message.get("body", b""), not message.get("more_body", False)


def _size(piece: UploadFile) -> int:
    return piece.size or 0


def _described(upload: StoredUpload, status: int = 200, more: dict[str, str] | None = None) -> Response:
    headers = {**upload_headers(upload), **(more or {})}
    return Response(UploadState.of(upload).model_dump_json(), status, headers, JSON)

"""What the routes that answer with a page share: its representation, its headers, its documentation."""

from typing import Any, Protocol

from fastapi import Request, Response, UploadFile
from pydantic import BaseModel

from app.operations import Encoding, Format, Reply
from app.problems import documented
from app.representations import MEDIA_TYPES, SNIFFED_BYTES, choose_format, image_headers, sniff_format
from app.routes.long_work import ACCEPTED
from app.routes.usual_problems import FORM, IMAGE, WORK

Documentation = dict[int | str, dict[str, Any]]

_BINARY: dict[str, Any] = {"schema": {"type": "string", "format": "binary"}}
_HEADERS: dict[str, Any] = {
    "Document-Rotation": {
        "description": "Clockwise degrees that were applied so that it reads.",
        "schema": {"type": "string", "enum": ["0", "90", "180", "270"]},
    },
    "Document-Warnings": {"description": "Codes, separated by commas.", "schema": {"type": "string"}},
    "Server-Timing": {"description": "Milliseconds of each stage.", "schema": {"type": "string"}},
}
_PROBLEMS = ("not-acceptable", "no-text", "internal", *FORM, *IMAGE, *WORK)


class AskedEncoding(Protocol):
    """The fields of a form that say how the answer is wanted."""

    format: Format | None
    quality: int | None
    embed: bool


def documented_page(
    model: type[BaseModel], header: str, meaning: str, problems: tuple[str, ...] = ()
) -> Documentation:
    """OpenAPI responses of a route that answers with a page or with `model`.

    `header` is the one that only this route's images carry, a string; `problems` are codes beside the usual.
    """
    return {
        200: {
            "description": "The flat view, or its description as JSON; the headers are those of images.",
            "model": model,
            "content": {media_type: _BINARY for name, media_type in MEDIA_TYPES.items() if name != "json"},
            "headers": {header: {"description": meaning, "schema": {"type": "string"}}, **_HEADERS},
        },
        **ACCEPTED,
        **documented(*_PROBLEMS, *problems),
    }


async def choose_encoding(request: Request, asked: AskedEncoding, photo: UploadFile) -> Encoding:
    """How the answer is sent: as asked for by the form or by `Accept`, else in the photo's own format.

    Raises
    ------
    NotAcceptable
        When `Accept` has room for no format.
    """
    head = await photo.read(SNIFFED_BYTES)
    await photo.seek(0)
    chosen = choose_format(asked.format, request.headers.get("accept"), sniff_format(head))
    return Encoding(format=chosen, quality=asked.quality, embed=asked.embed)


def answer_page(reply: Reply, encoding: Encoding, model: type[BaseModel]) -> Response:
    """The picture with its headers, or its description, held to `model`."""
    if encoding.format == "json":
        body = model.model_validate(reply.document).model_dump_json()
        return Response(body, media_type="application/json", headers={"Vary": "Accept"})
    headers = image_headers(reply.document) | {"Vary": "Accept"}
    return Response(reply.body, media_type=reply.media_type, headers=headers)

"""Digest of a request, by which a repeated request is recognized."""

import hashlib

from anyio import to_thread
from fastapi import Request
from starlette.datastructures import UploadFile

from app.http.form_parts import READ_BYTES, has_form


async def digest_of(request: Request) -> str:
    """Digest of method, path, options, Accept and the content of all parts of `request`.

    The body of a form is not compared as it was sent, because clients choose a new boundary for every request.
    """
    digest = hashlib.sha256()

    def add(*values: bytes) -> None:
        for value in values:
            digest.update(len(value).to_bytes(8, "big") + value)

    url = f"{request.method} {request.url.path}?{request.url.query}"
    add(
        url.encode(), request.headers.get("accept", "").encode(), request.headers.get("if-match", "").encode()
    )
    if not has_form(request.headers):
        add(await request.body())
        return digest.hexdigest()
    for name, part in (await request.form()).multi_items():
        if not isinstance(part, UploadFile):
            add(name.encode(), part.encode("utf-8", "surrogatepass"))
            continue
        add(name.encode(), (part.filename or "").encode("utf-8", "surrogatepass"))
        while data := await part.read(READ_BYTES):
            await to_thread.run_sync(digest.update, data)
        await part.seek(0)
        add(str(part.size).encode())
    return digest.hexdigest()

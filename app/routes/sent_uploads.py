"""Forms that name uploads in pieces, or kept photos, in place of files: the files take their places at once.

So every answer, every job and every Idempotency-Key is that of the files, whichever way they came.
"""

import asyncio
import re
from collections.abc import Mapping
from typing import Any, cast

from fastapi import Request
from starlette.datastructures import FormData, Headers, UploadFile

from app.http.body_limits import body_limits_of
from app.http.form_parts import FormRequest, FormRoute, spooled_file
from app.http.paths import MOSAIC_PATHS, RECTIFY_PATHS
from app.routes.kept_pages import kept_page, own_page
from app.routes.uploads import own_upload
from app.state import AppState, app_state
from models.records import StoredPage, StoredUpload
from services.errors import InvalidOption, TooLarge

MANY_FILES = 64
"""Of a form: more than its route accepts, so that the error for too many photos is about photos, not about the form."""
UPLOAD = "upload"
"""The part of a form that has the id of an upload."""
KEPT_PAGE = "kept_page"
"""The part that has the id of a kept page, whose photo is meant; of /rectify and /mosaic."""
FILE_PARTS: Mapping[str, str] = {
    **dict.fromkeys(RECTIFY_PATHS, "image"),
    **dict.fromkeys(MOSAIC_PATHS, "images"),
    "/layout": "image",
}
"""The part that an upload, or a kept page, stands for, by the path."""


class _Request(FormRequest):
    async def _get_form(self, **limits: Any) -> FormData:
        """The form, with the files of uploads and pages that it names. Raises `StoreError` and `DocumentError` too."""
        is_read = self._form is not None
        form = await super()._get_form(**limits)
        if not is_read and (UPLOAD in form or KEPT_PAGE in form):
            form = self._form = await _with_files(self, form)
        return form


class UploadFormRoute(FormRoute):
    """A route whose form takes uploads, and kept pages where its model has them."""

    request_class = _Request


async def _with_files(request: Request, form: FormData) -> FormData:
    """The form with files in place of ids, in the order of its parts.

    Raises
    ------
    InvalidOption
        When a part has no id, or its upload is not complete.
    TooLarge
        When the form has more bytes with these files than the path allows.
    UploadNotFound, KeptPageNotFound
    """
    state, path = app_state(request), request.scope["path"]
    part, takes_pages = FILE_PARTS[path], path in (*RECTIFY_PATHS, *MOSAIC_PATHS)
    uploads = {id: await own_upload(request, state, id) for id in _ids_of(form, UPLOAD)}
    pages = {
        id: await own_page(request, state, id) for id in (_ids_of(form, KEPT_PAGE) if takes_pages else ())
    }
    for upload in uploads.values():
        if upload.received < upload.length:
            raise InvalidOption(
                f"{UPLOAD}: {upload.id} is not complete: {upload.received} of {upload.length} bytes have come.",
                UPLOAD,
            )
    left = _bytes_left(request, state, form, uploads)
    made: list[tuple[str, UploadFile | str]] = []
    try:
        for name, value in form.multi_items():
            if name == UPLOAD:
                if value:
                    made.append((part, await _file_of(state, uploads[str(value)], part)))
            elif name == KEPT_PAGE and takes_pages:
                if value:
                    photo = await _photo_of(state, pages[str(value)], part, left)
                    left -= photo.size or 0
                    made.append((part, photo))
            else:
                made.append((name, value))
    except BaseException:
        await FormData(made).close()
        raise
    return FormData(made)


def _ids_of(form: FormData, part: str) -> list[str]:
    """The ids in all parts of this name. Raises `InvalidOption` where one is a file."""
    values = form.getlist(part)
    if any(isinstance(value, UploadFile) for value in values):
        raise InvalidOption(f"{part}: send an id; send a file as another part.", part)
    return [str(value) for value in values if value]


def _bytes_left(
    request: Request, state: AppState, form: FormData, uploads: Mapping[str, StoredUpload]
) -> int:
    """Bytes that further files may have. Raises `TooLarge` where those of the form and its uploads have too many."""
    limits = body_limits_of(state.settings)[1][request.scope["path"]]
    sent = [part.size or 0 for _, part in form.multi_items() if isinstance(part, UploadFile)]
    named = [uploads[cast(str, id)].length for id in form.getlist(UPLOAD) if id]
    size = sum(sent) + sum(named)
    if size > limits.max_upload_bytes:
        raise TooLarge(
            f"{UPLOAD}: all files of a request may have {limits.max_upload_bytes} bytes ({limits.size_setting}); "
            f"these have {size}.",
            UPLOAD,
        )
    return limits.max_upload_bytes - size


async def _photo_of(state: AppState, page: StoredPage, part: str, left: int) -> UploadFile:
    """The photo of a kept page, as a form would have it.

    Raises
    ------
    KeptPageNotFound
        When its photo is no longer there.
    TooLarge
        When it has more than `left` bytes.
    """
    kept = await kept_page(state, page)
    photo = await asyncio.to_thread(kept.photo)
    if len(photo) > left:
        raise TooLarge(
            f"{KEPT_PAGE}: the photo of page {page.id} makes the files of the request larger than they may be "
            "together; name fewer.",
            KEPT_PAGE,
        )
    file = _empty_file(page.document["name"] or page.id, part)
    await file.write(photo)
    await file.seek(0)
    return file


async def _file_of(state: AppState, upload: StoredUpload, part: str) -> UploadFile:
    """The file of an upload, as a form would have it."""
    file = _empty_file(upload.name or upload.id, part)
    try:
        file.size = await state.uploads.read_into(upload, file.file)
        await file.seek(0)
    except BaseException:
        await file.close()
        raise
    return file


def _empty_file(name: str, part: str) -> UploadFile:
    """A file of this name, as a form would have it in its `part`."""
    quoted = re.sub(r'(["\\])', r"\\\1", re.sub("[\r\n]", " ", name))
    disposition = f'form-data; name="{part}"; filename="{quoted}"'
    return spooled_file(name, Headers(raw=[(b"content-disposition", disposition.encode())]))

"""Forms that name uploads in pieces in place of files: the files take their places before anything else is read.

So every answer, every job and every Idempotency-Key is that of the files, whichever way they came.
"""

import re
from collections.abc import Mapping
from typing import Any, cast

from fastapi import Request
from starlette.datastructures import FormData, Headers, UploadFile

from app.http.body_limits import body_limits_of
from app.http.form_parts import FormRequest, FormRoute, spooled_file
from app.http.paths import MOSAIC_PATHS, RECTIFY_PATHS
from app.routes.uploads import own_upload
from app.state import AppState, app_state
from models.records import StoredUpload
from services.errors import InvalidOption, TooLarge

UPLOAD = "upload"
"""The part of a form that has the id of an upload."""
FILE_PARTS: Mapping[str, str] = {
    **dict.fromkeys(RECTIFY_PATHS, "image"),
    **dict.fromkeys(MOSAIC_PATHS, "images"),
    "/layout": "image",
}
"""The part that an upload stands for, by the path."""


class _Request(FormRequest):
    async def _get_form(self, **limits: Any) -> FormData:
        """The form, with the files of uploads that it names. Raises `StoreError` and `DocumentError` too."""
        is_read = self._form is not None
        form = await super()._get_form(**limits)
        if not is_read and UPLOAD in form:
            form = self._form = await _with_files(self, form)
        return form


class UploadFormRoute(FormRoute):
    """A route whose form takes uploads."""

    request_class = _Request


async def _with_files(request: Request, form: FormData) -> FormData:
    """The form with files in place of ids, in the order of its parts.

    Raises
    ------
    InvalidOption
        When a part has no id, or its upload is not complete.
    TooLarge
        When the form has more bytes with these files than the path allows.
    UploadNotFound
    """
    state, part = app_state(request), FILE_PARTS[request.scope["path"]]
    uploads = {id: await own_upload(request, state, id) for id in map(_id_of, form.getlist(UPLOAD)) if id}
    for upload in uploads.values():
        if upload.received < upload.length:
            raise InvalidOption(
                f"{UPLOAD}: {upload.id} is not complete: {upload.received} of {upload.length} bytes have come.",
                UPLOAD,
            )
    _check_size(request, state, form, uploads)
    made: list[tuple[str, UploadFile | str]] = []
    try:
        for name, value in form.multi_items():
            if name != UPLOAD:
                made.append((name, value))
            elif value:
                made.append((part, await _file_of(state, uploads[str(value)], part)))
    except BaseException:
        await FormData(made).close()
        raise
    return FormData(made)


def _id_of(value: UploadFile | str) -> str:
    if isinstance(value, UploadFile):
        raise InvalidOption(f"{UPLOAD}: send the id of an upload; send a file as another part.", UPLOAD)
    return value


def _check_size(
    request: Request, state: AppState, form: FormData, uploads: Mapping[str, StoredUpload]
) -> None:
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


async def _file_of(state: AppState, upload: StoredUpload, part: str) -> UploadFile:
    """The file of an upload, as a form would have it."""
    name = upload.name or upload.id
    quoted = re.sub(r'(["\\])', r"\\\1", re.sub("[\r\n]", " ", name))
    disposition = f'form-data; name="{part}"; filename="{quoted}"'
    headers = Headers(raw=[(b"content-disposition", disposition.encode())])
    file = spooled_file(name, headers)
    try:
        file.size = await state.uploads.read_into(upload, file.file)
        await file.seek(0)
    except BaseException:
        await file.close()
        raise
    return file

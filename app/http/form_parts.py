"""Forms: which requests have one, and errors that name the part that they are about."""

import asyncio
from collections.abc import AsyncGenerator, Callable, Coroutine
from contextlib import aclosing
from tempfile import SpooledTemporaryFile
from typing import Any, BinaryIO, cast
from urllib.parse import unquote_plus

from fastapi import Request, Response
from fastapi.routing import APIRoute
from starlette.datastructures import FormData, Headers, UploadFile
from starlette.formparsers import FormParser, MultiPartException, MultiPartParser

from services.errors import DocumentError, TooLarge

READ_BYTES = 1 << 20
"""Of a file at once."""
LONGEST_NAME = 80
"""Of a part or an option, as errors show it."""
_FORMS = ("multipart/form-data", "application/x-www-form-urlencoded")


class InvalidForm(DocumentError):
    """The body is not a valid form."""

    code = "bad-request"


def spooled_file(name: str | None = None, headers: Headers | None = None) -> UploadFile:
    """An empty file as those of forms: in memory while it is small."""
    file = SpooledTemporaryFile(MultiPartParser.spool_max_size)  # noqa: SIM115
    return UploadFile(cast(BinaryIO, file), size=0, filename=name, headers=headers)


def has_form(headers: Headers) -> bool:
    """Whether the body of a request is a form: with parts, or with encoded fields only."""
    return headers.get("content-type", "").strip().lower().startswith(_FORMS)


class FormRequest(Request):
    """A request that names the part in errors of a multipart form."""

    async def _get_form(self, **limits: Any) -> FormData:
        """The form.

        Raises
        ------
        InvalidForm, TooLarge
        """
        media_type = self.headers.get("content-type", "").partition(";")[0].strip().lower()
        if self._form is not None or media_type not in _FORMS:
            return await super()._get_form(**limits)
        async with aclosing(self.stream()) as stream:
            try:
                if media_type == "multipart/form-data":
                    self._form = await _NamingParser(self.headers, stream, **limits).parse()
                else:
                    limits.pop("max_files", None)
                    self._form = await _FieldParser(self.headers, stream, **limits).parse()
            except MultiPartException as error:
                raise InvalidForm(f"The form cannot be read: {error.message.rstrip('.')}.") from error
        return self._form


class FormRoute(APIRoute):
    """A route whose request reads forms by `_NamingParser`."""

    request_class: type[FormRequest] = FormRequest

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """The handler of the route, with a `request_class` instead of the request."""
        handle = super().get_route_handler()

        async def handle_form(request: Request) -> Response:
            return await handle(self.request_class(request.scope, request.receive))

        return handle_form


class _FieldParser(FormParser):
    """The parser of encoded fields; it decodes them in a thread, because two megabytes of `%7b` take 0.2 s."""

    def __init__(self, headers: Headers, stream: AsyncGenerator[bytes, None], **limits: Any) -> None:
        super().__init__(headers, stream, **limits)
        self._encoded: list[tuple[bytes, bytes]] = []

    def on_field_end(self) -> None:
        """Keep the field as it came, and count it."""
        self._encoded.append((bytes(self._field_name), bytes(self._field_value)))
        self._field_name = self._field_value = bytearray()
        super().on_field_end()

    async def parse(self) -> FormData:
        """The fields in their order."""
        await super().parse()
        return await asyncio.to_thread(self._decoded)

    def _decoded(self) -> FormData:
        return FormData(
            [
                (unquote_plus(name.decode("latin-1")), unquote_plus(value.decode("latin-1")))
                for name, value in self._encoded
            ]
        )


class _NamingParser(MultiPartParser):
    """The parser of the framework; its error about a large part names the part."""

    def on_part_data(self, data: bytes, start: int, end: int) -> None:
        """Add data to the current part.

        Raises
        ------
        TooLarge
            When the part is a field with more than `max_part_size` bytes.
        """
        part = self._current_part
        if part.file is None and len(part.data) + end - start > self.max_part_size:
            name = part.field_name[:LONGEST_NAME]
            raise TooLarge(
                f"{name}: a field of a form may have {self.max_part_size} bytes. Send images and other files as file "
                "parts (with a filename).",
                name,
            )
        super().on_part_data(data, start, end)

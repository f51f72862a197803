"""Responses of finished jobs, kept until a client reads them."""

import os
import tempfile
from typing import IO

from anyio import to_thread
from starlette.responses import Response

SMALL_BYTES = 65_536
"""Responses up to this size stay in memory."""


class KeptAnswer:
    """A stored response. A large body is in an unnamed temporary file, which disappears when this process ends."""

    def __init__(self, answer: Response, file: IO[bytes] | None = None) -> None:
        """`file` holds the body; None: the body is in memory."""
        self.size = len(answer.body)
        self._status = answer.status_code
        self._headers = answer.raw_headers
        self._body = bytes(answer.body) if file is None else b""
        self._file = file

    @classmethod
    async def of(cls, answer: Response) -> "KeptAnswer":
        """Store the response; the file is written in a thread, not in the event loop."""
        if len(answer.body) <= SMALL_BYTES:
            return cls(answer)
        return cls(answer, await to_thread.run_sync(_spool, answer.body))

    async def response(self) -> Response:
        """The stored response."""
        body = self._body
        if self._file is not None:
            # The job may expire during the read. The duplicated descriptor stays open.
            descriptor = os.dup(self._file.fileno())
            try:
                body = await to_thread.run_sync(os.pread, descriptor, self.size, 0)
            finally:
                os.close(descriptor)
        response = Response(body, self._status)
        response.raw_headers = list(self._headers)
        return response

    def close(self) -> None:
        """Close the file."""
        if self._file is not None:
            self._file.close()


def _spool(body: bytes | memoryview) -> IO[bytes]:
    """Unnamed temporary file with the body; it exists as long as its job."""
    file = tempfile.TemporaryFile(buffering=0)  # noqa: SIM115
    try:
        view = memoryview(body)
        while view:
            view = view[file.write(view) :]
    except BaseException:
        file.close()
        raise
    return file

"""Several pages within their time: a page that hangs, or the end of the time, does not lose those that are done.

The worker writes every page that is done to a file. Where the file does not grow for as long as one photo may take,
the worker is stopped, and another one goes on with the page behind. When the time of all pages ends, another one binds
those that are done. A document of `/layout` has one time for all: its class follows from all of its pages.
"""

import asyncio
import time
from pathlib import Path
from tempfile import NamedTemporaryFile

from fastapi import UploadFile

from app.engine.base import JobTimedOut, TimeLimit
from app.routes.document_uploads import document_limits
from app.state import AppState
from services.contract.images import Encoding, PageReply
from services.contract.rectify import RectifyParameters
from services.progress import ProgressSink

LOOK_EVERY_S = 0.5
"""Pause between two looks at the file."""


async def flatten_pages(
    state: AppState,
    images: list[UploadFile],
    parameters: RectifyParameters,
    encoding: Encoding,
    limit: TimeLimit,
    progress: ProgressSink | None,
) -> PageReply:
    """The flat pages, or those that are done within `limit`, each within JOB_TIMEOUT_S.

    Raises
    ------
    DocumentError
        What `Engine.submit` raises, for the time only where no page was done.
    """
    page_s, left_s = state.settings.job_timeout_s, limit.seconds
    too_slow = f"the page exceeded the limit of {page_s:g} s (JOB_TIMEOUT_S) and was stopped."
    too_late = f"the work exceeded its limit of {limit.seconds:g} s ({limit.setting}) and was stopped."
    with NamedTemporaryFile(prefix="pages-") as journal:
        while left_s > 0.0:
            attempt = _Attempt(Path(journal.name), page_s, progress)
            work = asyncio.ensure_future(
                state.engine.submit(
                    state.operations.rectify,
                    images,
                    parameters,
                    encoding,
                    document_limits(state.settings),
                    journal.name,
                    too_slow,
                    time_limit=TimeLimit(left_s, limit.setting),
                    progress=attempt.note,
                )
            )
            try:
                if not await attempt.is_stuck(work):
                    return work.result()
            except JobTimedOut:
                break
            finally:  # stops the worker where it is still at work
                work.cancel()
                await asyncio.gather(work, return_exceptions=True)
            left_s -= attempt.seconds()
            for image in images:
                await image.seek(0)
        return await state.engine.submit(state.operations.bind_done_pages, journal.name, encoding, too_late)


class _Attempt:
    """A run of one worker: when it has begun, and when a page was done last."""

    def __init__(self, journal: Path, page_s: float, progress: ProgressSink | None) -> None:
        self._journal = journal
        self._page_s = page_s
        self._progress = progress
        self._began_s: float | None = None

    def note(self, stage: str, fraction: float) -> None:
        """Progress of the worker; the first report is that it has begun."""
        if self._began_s is None:
            self._began_s = time.monotonic()
        if self._progress is not None:
            self._progress(stage, fraction)

    def seconds(self) -> float:
        """Time since it has begun."""
        return 0.0 if self._began_s is None else time.monotonic() - self._began_s

    async def is_stuck(self, work: "asyncio.Future[PageReply]") -> bool:
        """Wait for the end of the work; True as soon as no page was done for as long as one may take.

        Where there is one page only, nothing is written, and the limit of all pages is its own.
        """
        done_s, size = 0.0, self._size()
        while not work.done():
            await asyncio.wait((work,), timeout=min(LOOK_EVERY_S, self._page_s / 4))
            if self._size() != size:
                done_s, size = self.seconds(), self._size()
            elif size and self.seconds() - done_s > self._page_s and not work.done():
                return True
        return False

    def _size(self) -> int:
        return self._journal.stat().st_size

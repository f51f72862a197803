"""The two clients. They differ in how they wait."""

import asyncio
import time
from collections.abc import Sequence
from types import TracebackType
from typing import Self, Unpack

import httpx

from document_rectification_client import calls, flows, uploading
from document_rectification_client.calls import Answer, Call, Content, File, Photo, Upload
from document_rectification_client.flows import Flow, Job, Progress
from document_rectification_client.models import (
    DocumentResult,
    JobStatus,
    LayoutOptions,
    LayoutResult,
    MosaicOptions,
    PlainMosaicResult,
    PlainPagesResult,
    RectifyOptions,
    StackResult,
)

URL = "http://127.0.0.1:8000"
TRIES = 5
PIECES_ABOVE = 8 << 20
"""Two photos of a phone; at 1 MB/s more than that takes long enough to break off."""
TIMEOUT = httpx.Timeout(60.0, connect=10.0, read=600.0)
"""Of reading: the service itself ends work that takes longer (504 `timed-out`)."""


class Client:
    """Sends photos to the service at `url`, and waits for the answers.

    All methods raise `ProblemError`; a `url` that is none is a ValueError. Options are those of the service's forms
    (docs/api.md). With `progress` the work is a job, and the function is called with its state until it ends.

    Parameters
    ----------
    url
        Where the service is, with the prefix of a proxy, if any.
    key
        An API key, if the service wants one.
    tries
        How often a request is sent at most, where the service is busy or is not reached.
    pieces_above
        Photos of a call that have more bytes than this together are sent in pieces before (`upload`), so that a broken
        connection costs no more than what it was just sending; None: only what is asked for.
    http
        A client of httpx with settings of your own (certificates, a proxy); its base URL is set.
    """

    def __init__(
        self,
        url: str = URL,
        key: str | None = None,
        tries: int = TRIES,
        http: httpx.Client | None = None,
        pieces_above: int | None = PIECES_ABOVE,
    ) -> None:
        self._http = http or httpx.Client(timeout=TIMEOUT)
        self._tries = tries
        self._pieces_above = pieces_above
        _prepare(self._http, url, key)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Close the connections."""
        self._http.close()

    def flatten(
        self,
        photos: Sequence[Photo],
        format: str = "pdf",
        *,
        progress: Progress | None = None,
        **options: Unpack[RectifyOptions],
    ) -> File:
        """Photos of pages as one file of flat pages: PDF, image, text or archive."""
        return self.answer(calls.flatten(photos, format, **options), progress)

    def flatten_pages(
        self, photos: Sequence[Photo], *, progress: Progress | None = None, **options: Unpack[RectifyOptions]
    ) -> PlainPagesResult:
        """What is known of the flat pages of the photos."""
        return self.answer(calls.flatten_pages(photos, **options), progress)

    def mosaic(
        self,
        photos: Sequence[Photo],
        format: str = "pdf",
        *,
        progress: Progress | None = None,
        **options: Unpack[MosaicOptions],
    ) -> File:
        """Overlapping photos of one page as one file of the whole page."""
        return self.answer(calls.mosaic(photos, format, **options), progress)

    def mosaic_page(
        self, photos: Sequence[Photo], *, progress: Progress | None = None, **options: Unpack[MosaicOptions]
    ) -> PlainMosaicResult:
        """What is known of the whole page that overlapping photos show."""
        return self.answer(calls.mosaic_page(photos, **options), progress)

    def layout(
        self,
        images: Sequence[Photo] = (),
        *,
        progress: Progress | None = None,
        **options: Unpack[LayoutOptions],
    ) -> LayoutResult | DocumentResult | StackResult:
        """Class and labels of a page; of several images, of the document and of its pages."""
        return self.answer(calls.layout(images, **options), progress)

    def upload(self, photo: Content, name: str | None = None) -> Upload:
        """A photo that the service keeps for some time, sent in pieces: where the connection breaks, it goes on.

        The upload stands for the photo in all methods, in any number of calls. `name` is that of bytes.
        """
        return self._follow(uploading.upload(*_named(photo, name), self._tries))

    def forget(self, upload: Upload) -> None:
        """Delete an upload before its time."""
        self._follow(uploading.forget(upload, self._tries))

    def answer(self, call: Call[Answer], progress: Progress | None = None) -> Answer:
        """The answer to a call."""
        return self._follow(
            uploading.sent_before(
                call, self._pieces_above, self._tries, lambda sent: flows.answer(sent, progress, self._tries)
            )
        )

    def start(self, call: Call[Answer], key: str | None = None) -> Job[Answer]:
        """The job of a call; the same call with the same `key` finds the same job."""
        return self._follow(
            uploading.sent_before(
                call, self._pieces_above, self._tries, lambda sent: flows.start(sent, key, self._tries)
            )
        )

    def look(self, job: Job[Answer]) -> JobStatus:
        """The state of a job."""
        return self._follow(flows.look(job, self._tries))

    def result(self, job: Job[Answer], progress: Progress | None = None) -> Answer:
        """The answer of a job, when it has ended."""
        return self._follow(flows.result(job, progress, self._tries))

    def cancel(self, job: Job[Answer]) -> None:
        """Stop the work of a job."""
        self._follow(flows.cancel(job, self._tries))

    def _follow(self, flow: Flow[Answer]) -> Answer:
        received: flows.Received = None
        while True:
            try:
                step = flow.send(received)
            except StopIteration as end:
                result: Answer = end.value
                return result
            if isinstance(step, flows.Pause):
                time.sleep(step.seconds)
                received = None
                continue
            try:
                received = self._http.request(
                    step.method,
                    step.path,
                    headers=step.headers,
                    content=step.content,
                    files=step.files,
                    data=step.data,
                )
            except httpx.TransportError as error:
                received = error


class AsyncClient:
    """`Client` for programs with an event loop; the methods are the same."""

    def __init__(
        self,
        url: str = URL,
        key: str | None = None,
        tries: int = TRIES,
        http: httpx.AsyncClient | None = None,
        pieces_above: int | None = PIECES_ABOVE,
    ) -> None:
        self._http = http or httpx.AsyncClient(timeout=TIMEOUT)
        self._tries = tries
        self._pieces_above = pieces_above
        _prepare(self._http, url, key)

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.close()

    async def close(self) -> None:
        """Close the connections."""
        await self._http.aclose()

    async def flatten(
        self,
        photos: Sequence[Photo],
        format: str = "pdf",
        *,
        progress: Progress | None = None,
        **options: Unpack[RectifyOptions],
    ) -> File:
        """Photos of pages as one file of flat pages: PDF, image, text or archive."""
        return await self.answer(await asyncio.to_thread(calls.flatten, photos, format, **options), progress)

    async def flatten_pages(
        self, photos: Sequence[Photo], *, progress: Progress | None = None, **options: Unpack[RectifyOptions]
    ) -> PlainPagesResult:
        """What is known of the flat pages of the photos."""
        return await self.answer(await asyncio.to_thread(calls.flatten_pages, photos, **options), progress)

    async def mosaic(
        self,
        photos: Sequence[Photo],
        format: str = "pdf",
        *,
        progress: Progress | None = None,
        **options: Unpack[MosaicOptions],
    ) -> File:
        """Overlapping photos of one page as one file of the whole page."""
        return await self.answer(await asyncio.to_thread(calls.mosaic, photos, format, **options), progress)

    async def mosaic_page(
        self, photos: Sequence[Photo], *, progress: Progress | None = None, **options: Unpack[MosaicOptions]
    ) -> PlainMosaicResult:
        """What is known of the whole page that overlapping photos show."""
        return await self.answer(await asyncio.to_thread(calls.mosaic_page, photos, **options), progress)

    async def layout(
        self,
        images: Sequence[Photo] = (),
        *,
        progress: Progress | None = None,
        **options: Unpack[LayoutOptions],
    ) -> LayoutResult | DocumentResult | StackResult:
        """Class and labels of a page; of several images, of the document and of its pages."""
        return await self.answer(await asyncio.to_thread(calls.layout, images, **options), progress)

    async def upload(self, photo: Content, name: str | None = None) -> Upload:
        """A photo that the service keeps for some time, sent in pieces: where the connection breaks, it goes on.

        The upload stands for the photo in all methods, in any number of calls. `name` is that of bytes.
        """
        named = await asyncio.to_thread(_named, photo, name)
        return await self._follow(uploading.upload(*named, self._tries))

    async def forget(self, upload: Upload) -> None:
        """Delete an upload before its time."""
        await self._follow(uploading.forget(upload, self._tries))

    async def answer(self, call: Call[Answer], progress: Progress | None = None) -> Answer:
        """The answer to a call."""
        return await self._follow(
            uploading.sent_before(
                call, self._pieces_above, self._tries, lambda sent: flows.answer(sent, progress, self._tries)
            )
        )

    async def start(self, call: Call[Answer], key: str | None = None) -> Job[Answer]:
        """The job of a call; the same call with the same `key` finds the same job."""
        return await self._follow(
            uploading.sent_before(
                call, self._pieces_above, self._tries, lambda sent: flows.start(sent, key, self._tries)
            )
        )

    async def look(self, job: Job[Answer]) -> JobStatus:
        """The state of a job."""
        return await self._follow(flows.look(job, self._tries))

    async def result(self, job: Job[Answer], progress: Progress | None = None) -> Answer:
        """The answer of a job, when it has ended."""
        return await self._follow(flows.result(job, progress, self._tries))

    async def cancel(self, job: Job[Answer]) -> None:
        """Stop the work of a job."""
        await self._follow(flows.cancel(job, self._tries))

    async def _follow(self, flow: Flow[Answer]) -> Answer:
        received: flows.Received = None
        while True:
            try:
                step = flow.send(received)
            except StopIteration as end:
                result: Answer = end.value
                return result
            if isinstance(step, flows.Pause):
                await asyncio.sleep(step.seconds)
                received = None
                continue
            try:
                received = await self._http.request(
                    step.method,
                    step.path,
                    headers=step.headers,
                    content=step.content,
                    files=step.files,
                    data=step.data,
                )
            except httpx.TransportError as error:
                received = error


def _named(photo: Content, name: str | None) -> tuple[str, bytes]:
    own, content = calls.named(photo)
    return name or own, content


def _prepare(http: httpx.Client | httpx.AsyncClient, url: str, key: str | None) -> None:
    address = httpx.URL(url)
    if address.scheme not in ("http", "https") or not address.host:
        raise ValueError(f"{url}: an address begins with http:// or https://")
    http.base_url = address
    if key is not None:
        http.headers["X-API-Key"] = key

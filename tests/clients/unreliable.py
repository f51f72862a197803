"""A network on which things go wrong."""

import asyncio
import ssl
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any

import httpx
import pytest

from document_rectification_client import AsyncClient, Client, clients
from tests.app.serving import POLL_S

NO_TLS = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
"""Certificates that nobody asks for, which would be read for each test."""
Fate = httpx.Response | Exception
"""What comes in place of the service's answer. An error that is raised `after` lets the request through before."""


class Network(httpx.BaseTransport, httpx.AsyncBaseTransport):
    """Meets requests with their fates, in order; None is none, and they get through. `sent` has all of them."""

    def __init__(self) -> None:
        self.fates: list[Fate | tuple[str, Exception] | None] = []
        self.sent: list[httpx.Request] = []
        self.pauses: list[float] = []
        self.lost: list[bytes] = []
        self._sync, self._async = httpx.HTTPTransport(NO_TLS), httpx.AsyncHTTPTransport(NO_TLS)

    def handle_request(self, request: httpx.Request) -> httpx.Response:
        fate = self._fate_of(request)
        if fate is None:
            return self._sync.handle_request(request)
        if isinstance(fate, tuple):
            self.lost.append(self._sync.handle_request(request).read())
            raise fate[1]
        return fate

    async def handle_async_request(self, request: httpx.Request) -> httpx.Response:
        fate = self._fate_of(request)
        if fate is None:
            return await self._async.handle_async_request(request)
        if isinstance(fate, tuple):
            self.lost.append(await (await self._async.handle_async_request(request)).aread())
            raise fate[1]
        return fate

    def _fate_of(self, request: httpx.Request) -> httpx.Response | tuple[str, Exception] | None:
        self.sent.append(request)
        fate = self.fates.pop(0) if self.fates else None
        if isinstance(fate, Exception):
            raise fate
        if isinstance(fate, httpx.Response):  # a new one: an answer is read once
            return httpx.Response(fate.status_code, headers=fate.headers, content=fate.content)
        return fate


@contextmanager
def on(network: Network, kind: str, url: str, monkeypatch: pytest.MonkeyPatch, **more: Any) -> Iterator[Any]:
    """A client of this kind (`sync` or `async`) on the network; its methods wait for their answers.

    Its pauses are those of tests; the network has what they would have been.
    """

    def pause(seconds: float) -> None:
        network.pauses.append(seconds)
        time.sleep(POLL_S)

    async def pause_loop(seconds: float) -> None:
        pause(seconds)

    monkeypatch.setattr(clients, "time", SimpleNamespace(sleep=pause))
    monkeypatch.setattr(clients, "asyncio", SimpleNamespace(sleep=pause_loop, to_thread=asyncio.to_thread))
    if kind == "sync":
        with Client(url, http=httpx.Client(transport=network), **more) as client:
            yield client
        return
    with asyncio.Runner() as runner:
        waiting = AsyncClient(url, http=httpx.AsyncClient(transport=network), **more)

        class Waiting:
            def __getattr__(self, name: str) -> Any:
                return lambda *given, **options: runner.run(getattr(waiting, name)(*given, **options))

        yield Waiting()
        runner.run(waiting.close())

"""Responses of JSON that are made in a thread: between two steps of the event loop nobody else is answered."""

import asyncio
from collections.abc import Callable, Mapping

from fastapi import Response
from pydantic import BaseModel

JSON = "application/json"


async def answer_json(
    make: Callable[[], BaseModel], status: int = 200, headers: Mapping[str, str] | None = None
) -> Response:
    """The response with the model that `make` returns, which is validated and written in a thread.

    Every response whose size grows with the upload or with the store is made so; the largest take 0.4 s.
    """
    body = await asyncio.to_thread(lambda: make().model_dump_json(by_alias=True).encode())
    return Response(body, status, headers, JSON)

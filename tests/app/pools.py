"""Pools of worker processes for the tests, and waiting for what they do."""

import asyncio
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from typing import TypeVar

from app.engine.base import (
    JobRecord,
)
from app.engine.local import LocalEngine, PoolLimits
from services.contract.operations import Operation
from tests.app.jobs import (
    say_warm,
)

T = TypeVar("T")
MEMORY_BYTES = 1 << 30


def named(function: Callable[..., T]) -> Operation[T]:
    """The name of a function, as workers find it."""
    return Operation(f"{function.__module__}:{function.__qualname__}")


@asynccontextmanager
async def engine(
    workers: int = 1, records: list[JobRecord] | None = None, **limits: object
) -> AsyncIterator[LocalEngine]:
    observed: list[JobRecord] = [] if records is None else records
    settings = {"worker_memory_bytes": MEMORY_BYTES, "job_timeout_s": 20.0, "queue_timeout_s": 20.0, **limits}
    pool = LocalEngine(
        PoolLimits(workers=workers, **settings),  # type: ignore[arg-type]
        warm_up=named(say_warm),
        preload=("tests.app.jobs",),
        observe=observed.append,
    )
    await pool.start()
    try:
        yield pool
    finally:
        await pool.drain(0)


async def until(condition: object, seconds: float = 10.0) -> None:
    """Wait for a condition that must come true."""
    assert callable(condition)
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "it did not come true"
        await asyncio.sleep(0.005)
